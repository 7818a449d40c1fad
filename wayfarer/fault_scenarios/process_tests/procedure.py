"""What a procedure finds out, and its result.

What ends a run, disarms it or refuses to arm has reached S3: the wheels stand until a person acts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from wayfarer.fault_scenarios.result import Procedure, Result, Tried
from wayfarer.fault_scenarios.scenario import Reached


@dataclass(slots=True)
class Observed:
    """What a procedure has seen so far; the fields are those of ``Result``.

    ``remark`` adds measured figures to what the procedure always remarks.
    """

    reached: Reached = Reached.NONE
    changed: str = ""
    detected_s: float | None = None
    stopped_s: float | None = None
    cause: str = ""
    remark: str = ""
    problems: list[str] = field(default_factory=list)

    def demand(self, holds: object, otherwise: str) -> None:
        """Note a problem where something does not hold."""
        if not holds:
            self.problems.append(otherwise)


def procedure(
    name: str,
    row: int,
    about: str,
    *,
    asked: str,
    expected: Reached,
    within_s: float | None = None,
    tried: Tried = Tried.DAEMON,
    remark: str = "",
) -> Callable[[Callable[[Observed], None]], Procedure]:
    """Make a procedure of a function that tries a row of the catalogue; the arguments are the fields of ``Result``."""

    def made(try_it: Callable[[Observed], None]) -> Procedure:
        def run() -> Result:
            found = Observed()
            try:
                try_it(found)
            except Exception as error:  # one row that breaks must not hide the others
                found.problems.append(f"{type(error).__name__}: {error}")
            _judge(found, expected, within_s)
            return Result(
                name, row, about, tried, asked, expected, found.reached, within_s, found.changed, found.detected_s,
                found.stopped_s, found.cause, tuple(found.problems), "; ".join(filter(None, (found.remark, remark))),
            )  # fmt: skip

        return Procedure(name, row, about, run)

    return made


def _judge(found: Observed, expected: Reached, within_s: float | None) -> None:
    found.demand(found.changed, "nothing shows that the fault happened")
    found.demand(found.reached == expected, f"{found.reached} was reached, {expected} is expected")
    for what, time_s in (("detected", found.detected_s), ("the wheels stood", found.stopped_s)):
        if time_s is not None and within_s is not None:
            found.demand(time_s <= within_s, f"{what} after {time_s:.3f} s, {within_s:g} s are allowed")
