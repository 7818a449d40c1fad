"""What a person wants at a moment, and what tells it: the keys of a terminal, or a gamepad."""

from __future__ import annotations

from time import CLOCK_MONOTONIC, clock_gettime
from typing import NamedTuple, Protocol


class Wish(NamedTuple):
    """Shares of full speed and turn rate, -1 to 1, ahead and clockwise positive; ``taken_s`` on ``CLOCK_MONOTONIC``."""

    forward: float
    turn: float
    taken_s: float


def now_s() -> float:
    """Return the time now, on the clock of the daemon's loop, which is that of the whole computer."""
    return clock_gettime(CLOCK_MONOTONIC)


class Source(Protocol):
    """Where wishes come from. ``driver`` is its name in the log."""

    driver: str

    @property
    def help(self) -> str:
        """What to press, in a line."""

    def wait(self, for_s: float) -> None:
        """Wait until something is pressed or let go, at most so long, and take it.

        Raises:
            WayfarerError: it has gone.
        """

    def wish(self, t_s: float) -> Wish | None:
        """Return the newest wish, None where it was told already: nobody has pressed anything since."""

    @property
    def is_over(self) -> bool:
        """Whether the person wants to end."""
