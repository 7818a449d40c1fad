"""Whether a turn on the spot gets on: small commands may be too weak to turn anything, and trunks hold a body."""

from __future__ import annotations

from math import inf

from wayfarer.escape.api import Vehicle

# The heading must come nearer by so much to count as moved: three times the noise of a compass.
MOVED_DEG = 3.0
# The released field code drives at 0.3 of full duty; a turn that has stood still for half a second gets no less.
PUSH_AFTER_S = 0.5
PUSH_DUTY = 0.3
# Then it is no use: field catalogue, faults 29 and 58, allow 3 s, and noise may look like a move once.
GIVE_UP_AFTER_S = 2.0


class TurnWatch:
    """Watches one turn after another: ``pushes`` once the turn was found to stand, ``stands`` when it is no use."""

    def __init__(self) -> None:
        self.rest()

    def rest(self) -> None:
        """Forget the turn: nothing is turned now."""
        self._least_deg = inf
        self._moved_t_s = 0.0
        self.pushes = self.stands = False

    def update(self, t_s: float, left_deg: float) -> None:
        """Take the angle that is left to turn at a time in which a turn is commanded."""
        if left_deg <= self._least_deg - MOVED_DEG:
            self._least_deg, self._moved_t_s = left_deg, t_s
            return
        stood_s = t_s - self._moved_t_s
        self.pushes = self.pushes or stood_s >= PUSH_AFTER_S
        self.stands = stood_s >= GIVE_UP_AFTER_S


def push_rad_s(vehicle: Vehicle) -> float:
    """Return the rate of a turn on the spot at ``PUSH_DUTY``."""
    return PUSH_DUTY * 2 * vehicle.max_speed_m_s / vehicle.track_m
