"""The live page: a running rover in a browser, with buttons to hold, resume, mark and stop.

Only ``wayfarer demo`` gives a page controls of the clock (``DemoControls``). A page without them refuses these
requests: a rover has no clock that could be paused.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from wayfarer.errors import BadInput

HOST, PORT = "127.0.0.1", 8088  # like 8080, which the servers of other software take so often

DEMO_VERBS = ("pause", "play", "speed")
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


def checked_speed(value: object) -> float:
    """Return a speed, in times real time; raise ``BadInput`` if it is not a number, too small or too large."""
    if isinstance(value, int | float) and not isinstance(value, bool) and LEAST_SPEED <= value <= MOST_SPEED:
        return float(value)
    raise BadInput(f"a speed is a number from {LEAST_SPEED:g} to {MOST_SPEED:g}, in times real time")
