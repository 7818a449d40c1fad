"""Start delay and capture of the goal heading. Pure: time and readings are inputs."""

from __future__ import annotations

from collections import deque
from typing import Final

from wayfarer.angles import circular_mean, wrap180
from wayfarer.hal import CompassReading
from wayfarer.safety.settings import SafetySettings

# The compass gets this many settling times to come to rest before arming is refused.
PATIENCE: Final = 10.0


class ArmingSequence:
    """Waits out the start delay, then takes the goal heading.

    A heading given by the user is used as it is. Otherwise the rover's own heading is taken at the END of the delay, as
    the mean over a settling time in which it stayed within a narrow spread. It is not taken earlier, because a person
    with keys and a phone is still near the compass when the delay begins.
    """

    def __init__(self, settings: SafetySettings, t_s: float, goal_heading_deg: float | None) -> None:
        self._settings = settings
        self._goal_heading_deg = goal_heading_deg
        self._delay_ends_s = t_s + settings.start_delay_s
        self._headings: deque[tuple[float, float]] = deque()

    def update(self, compass: CompassReading) -> float | None:
        """Return the goal heading once it is known, None while waiting."""
        t_s = compass.t_s
        if t_s < self._delay_ends_s:
            return None
        if self._goal_heading_deg is not None:
            return self._goal_heading_deg
        self._headings.append((t_s, compass.heading_deg))
        if t_s - self._headings[0][0] < self._settings.settle_s:
            return None
        mean_deg, _ = circular_mean(heading_deg for _, heading_deg in self._headings)
        if all(
            abs(wrap180(heading_deg - mean_deg)) <= self._settings.settle_spread_deg
            for _, heading_deg in self._headings
        ):
            return mean_deg
        self._headings.popleft()
        return None

    def too_late(self, t_s: float) -> bool:
        """Return whether arming must be refused, because the heading has not come to rest in time."""
        return t_s > self._delay_ends_s + PATIENCE * self._settings.settle_s
