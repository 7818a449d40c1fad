"""What a conformance check is: one promise of an interface, how it is tried, and a report of what was tried."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple
from unittest import SkipTest

NO_HARDWARE = "no maker of a part whose hardware does not answer was given (unreachable)"

Try = Callable[[Any], Coroutine[Any, Any, None]]


class Check(NamedTuple):
    """One check of one part or algorithm.

    ``asyncio.run(check.run())`` raises ``AssertionError`` if the promise is not kept, and ``unittest.SkipTest`` with
    the reason if that cannot be tried, which pytest shows as skipped.
    """

    name: str
    promise: str
    run: Callable[[], Coroutine[Any, Any, None]]

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Report:
    """Which checks ran, all of which passed, and why the others did not."""

    kind: str
    ran: tuple[str, ...]
    skipped: Mapping[str, str]

    def __str__(self) -> str:
        """Return it for people: how many ran, and a line for each that did not."""
        count = f"{self.kind}: {len(self.ran)} of {len(self.ran) + len(self.skipped)} checks ran, and passed"
        return "\n".join([count, *(f"  not tried: {name}: {why}" for name, why in self.skipped.items())])


@dataclass(frozen=True, slots=True)
class Promise:
    """A sentence of an interface, where it is, and what tries it: on a part, or on one ``without_hardware``."""

    name: str
    where: str
    sentence: str
    kinds: tuple[str, ...]
    attempt: Try
    without_hardware: bool

    def check(self, make: Any, unreachable: Any, gap: str | None) -> Check:
        """Return the check of what ``make`` makes; a ``gap`` is why the promise is known not to be kept."""
        given = unreachable if self.without_hardware else make

        async def run() -> None:
            if given is None:
                raise SkipTest(NO_HARDWARE)
            broken = await self._broken(given)
            if gap is not None:
                if broken is None:
                    raise AssertionError(f"{self.name} is listed as a gap ({gap}) and passes: take it from the list")
                raise SkipTest(f"a known gap, {gap}: {broken}")
            if broken is not None:
                raise AssertionError(f'{self.name}: {broken}; {self.where} promises: "{self.sentence}"')

        return Check(self.name, self.sentence, run)

    async def _broken(self, given: Any) -> str | None:
        """Return how the promise is broken, None if it is kept."""
        try:
            await self.attempt(given)
        except SkipTest:
            raise
        except AssertionError as error:
            return str(error)
        except Exception as error:
            return f"{type(error).__name__} was raised ({error})"
        return None


def promised(
    table: list[Promise], where: str, sentence: str, *kinds: str, name: str = "", without_hardware: bool = False
) -> Callable[[Try], Try]:
    """Put what tries a promise into a table, under its own name if no other is given."""

    def put(attempt: Try) -> Try:
        table.append(Promise(name or attempt.__name__.strip("_"), where, sentence, kinds, attempt, without_hardware))
        return attempt

    return put


def checks_in(
    table: Iterable[Promise], kind: str, make: Any, unreachable: Any, gaps: Mapping[str, str] | None
) -> list[Check]:
    """Return the checks of a kind.

    Raises:
        ValueError: there is no such kind, or no such check among the gaps.
    """
    rows = [row for row in table if kind in row.kinds]
    names = [row.name for row in rows]
    if not rows or (unknown := sorted(set(gaps or ()) - set(names))):
        known = {each for row in table for each in row.kinds} if not rows else names
        raise ValueError(f"no check for {kind if not rows else unknown}: there are {', '.join(sorted(known))}")
    return [row.check(make, unreachable, (gaps or {}).get(row.name)) for row in rows]


async def run_all(kind: str, checks: Iterable[Check]) -> Report:
    """Run checks one after the other.

    Raises:
        AssertionError: the first promise that is not kept.
    """
    ran, skipped = [], {}
    for check in checks:
        try:
            await check.run()
        except SkipTest as why:
            skipped[check.name] = str(why)
        else:
            ran.append(check.name)
    return Report(kind, tuple(ran), skipped)
