"""Whether a turn on the spot gets on: a trunk, or the ground, may hold the body."""

from __future__ import annotations

from math import inf

from wayfarer.hal import WheelCommand

# The heading must come nearer by so much to count as moved: three times the noise of a compass.
MOVED_DEG = 3.0
# Then it is no use: field catalogue, faults 29 and 58, allow 3 s, and noise may look like a move once.
GIVE_UP_AFTER_S = 2.0
# With less than this share of the turn duty for going ahead, nothing else notices that the body is held.
AHEAD_SHARE = 0.2


class TurnWatch:
    """Watches one turn after another: ``stands`` when it is no use."""

    def __init__(self) -> None:
        self.rest()

    def rest(self) -> None:
        """Forget the turn: nothing is turned now."""
        self._least_deg = inf
        self._moved_t_s = 0.0
        self.stands = False

    def see(self, t_s: float, left_deg: float, wheels: WheelCommand) -> None:
        """Take the wheels of a manoeuvre that is to go ahead: a held body may leave them nothing but the turn."""
        left, right = wheels
        if abs(left + right) <= AHEAD_SHARE * abs(left - right):
            self.update(t_s, left_deg)
        else:
            self.rest()

    def update(self, t_s: float, left_deg: float) -> None:
        """Take the angle that is left to turn at a time in which a turn is commanded."""
        if left_deg <= self._least_deg - MOVED_DEG:
            self._least_deg, self._moved_t_s = left_deg, t_s
        else:
            self.stands = t_s - self._moved_t_s >= GIVE_UP_AFTER_S
