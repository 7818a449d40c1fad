"""The commands that are sent to a running rover over its control socket."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

import typer

from wayfarer.angles import wrap360
from wayfarer.cli.options import AsJson, examples
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.fields import escape_document
from wayfarer.logview.terminal import print_json, say_next

ANSWER_S = 5.0  # above ``safety.permission.PERMISSION_S``: what is not answered by then does not happen later

Heading = Annotated[
    float, typer.Argument(metavar="DEG", min=-360, max=360, help="Degrees clockwise from north; -20 is 340.")
]
North = Annotated[
    Literal["magnetic", "true"], typer.Option(help="Which north DEG counts from; true needs declination_deg.")
]


def status(*, as_json: AsJson = False) -> None:
    """Show rover status."""
    if as_json:
        print_json(_answer("status"))
        return
    from wayfarer.cli.status_text import status_text

    answer = _ask("status")
    with _as_this_version():
        print(status_text(answer))


def arm(
    heading_deg: Annotated[
        float | None,
        typer.Argument(
            metavar="DEG",
            min=-360,
            max=360,
            help="Goal heading. (default: the rover's heading at the end of the start delay)",
        ),
    ] = None,
    *,
    north: North = "magnetic",
    without_log: Annotated[
        bool, typer.Option("--without-log", help="Arm even if the log cannot be written: nothing is recorded then.")
    ] = False,
) -> None:
    """Run the checks that need no motion, wait for the start delay, then drive. Step away from the rover."""
    keys: dict[str, Any] = {} if heading_deg is None else {"heading_deg": wrap360(heading_deg), "north": north}
    reply = _ask("arm", **keys, **({"without_log": True} if without_log else {}))
    with _as_this_version():
        for warning in reply["warnings"]:
            print("warning:", warning)
        print(f"arming: the wheels can turn after {reply['start_delay_s']:g} s")


def disarm() -> None:
    """Stop the wheels until the rover is re-armed."""
    _ask("disarm")
    print("disarmed")


def hold() -> None:
    """Pause: stop the wheels until `wayfarer resume`; the mission continues after that."""
    reply = _ask("hold")
    with _as_this_version():
        print("held; continue with wayfarer resume" if reply["held"] else "stopped: nobody drives by hand any more")


def resume() -> None:
    """Continue the mission after `wayfarer hold`."""
    _ask("resume")
    print("resumed")


def goal(heading_deg: Heading, *, north: North = "magnetic") -> None:
    """Set a new goal heading."""
    reply = _ask("goal", heading_deg=wrap360(heading_deg), north=north)
    with _as_this_version():
        print(f"heading for {reply['goal_heading_deg']:g} degrees magnetic")


def mark(words: Annotated[list[str], typer.Argument(metavar="TEXT", help="The note, such as: hit log")]) -> None:
    """Write a note into the field log."""
    _ask("mark", text=" ".join(words))
    print("noted")


def stop() -> None:
    """Stop the wheels and end the run."""
    reply = _ask("stop")
    with _as_this_version():
        print(f"stopped; the log is in {reply['log']}")
        say_next("wayfarer", "logs", "summary", reply["log"])


COMMANDS = (status, arm, disarm, hold, resume, goal, mark, stop)
EXAMPLES = {
    status: examples("wayfarer status", "wayfarer status --json"),
    arm: examples("wayfarer arm", "wayfarer arm 90", "wayfarer arm 90 --north true"),
    goal: examples("wayfarer goal 270", "wayfarer goal -20 --north true"),
    mark: examples("wayfarer mark hit a log"),
}
ACCEPT_NEGATIVE = {arm, goal, mark}  # -20 is a heading, or a word of a note, and no option


@contextmanager
def _as_this_version() -> Iterator[None]:
    """Say so if the details of an answer are not those that this version gives."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError):
        raise WayfarerError(
            "the command was carried out, but the daemon's answer is not as expected: "
            "it may be another version, restart it"
        ) from None


def _ask(do: str, **keys: object) -> dict[str, Any]:
    """Return the daemon's answer, fit for a terminal."""
    answer: dict[str, Any] = escape_document(_answer(do, **keys))
    return answer


def _answer(do: str, **keys: object) -> dict[str, Any]:
    from wayfarer.daemon.socket.client import ask

    return ask({"do": do, **keys}, timeout_s=ANSWER_S)
