"""The interface between the live page and a demo: pause and speed.

Only ``wayfarer demo`` gives a page such controls. A page without them refuses these requests: a rover has no clock that
could be paused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from wayfarer.errors import BadInput

VERBS = ("pause", "play", "speed")
LEAST_SPEED, MOST_SPEED = 0.1, 1000.0  # chosen by us: slow enough to follow a turn, more than a computer can simulate


class DemoState(NamedTuple):
    """How a demo is now. ``log`` is the folder of the run's log, empty before the first record."""

    seed: int
    speed: float
    paused: bool
    log: str


class DemoControls(Protocol):
    """What the page of a demo can ask for. All methods are called on the page's loop, and none waits."""

    def now(self) -> DemoState:
        """Return how the demo is."""

    def seen(self) -> None:
        """Note that a viewer has opened the page."""

    def pause(self, paused: bool) -> None:
        """Let the time of the demo stand still, or continue."""

    def run_at(self, speed: float) -> None:
        """Let the time of the demo go ``speed`` times as fast as the clock, and end a pause."""


def perform(fields: Mapping[str, Any], demo: DemoControls) -> None:
    """Do what a page asks of a demo; ``fields["do"]`` is one of ``VERBS``.

    Raises:
        BadInput: the speed is none.
    """
    match fields["do"]:
        case "speed":
            demo.run_at(checked_speed(fields.get("times")))
        case "pause" | "play" as do:
            demo.pause(do == "pause")


def checked_speed(value: object) -> float:
    """Return a speed, in times real time.

    Raises:
        BadInput: it is no number, too small or too large.
    """
    if isinstance(value, int | float) and not isinstance(value, bool) and LEAST_SPEED <= value <= MOST_SPEED:
        return float(value)
    raise BadInput(f"a speed is a number from {LEAST_SPEED:g} to {MOST_SPEED:g}, in times real time")
