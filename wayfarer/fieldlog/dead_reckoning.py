"""Dead reckoning over the ticks of a log. Pure.

The motion sensor says how far, while it can; where it cannot tell, the wheels' commands do. The compass alone says
which way. Good enough to draw a path and to search for a lost rover; no decision sees it. That of the mission's radius
is another (``safety/mission.py``).
"""

from __future__ import annotations

from math import inf, nan
from typing import NamedTuple

from wayfarer.angles import displacement_m
from wayfarer.detector.settings import DetectorSettings
from wayfarer.hal import MotionReading

GAP_S = 1.0  # no tick is that late: records are missing, and nobody knows what the wheels did meanwhile
SILENT_S = 0.5  # a motion sensor that has said nothing for so long says nothing of the distance either
READING_MAX_M = 1.0  # no rover goes so far from one reading to the next: the sensor is wrong
TOO_FAST = 2.0  # times the speed at full duty, after a silence: nor does one that slides go faster


class ReckonedPose(NamedTuple):
    """A position relative to where the log begins, metres, and the heading in degrees from magnetic north."""

    t_s: float
    north_m: float
    east_m: float
    heading_deg: float


class DeadReckoning:
    """Follows the ticks of one log; ``place`` is the latest position, None before the first heading.

    ``path_m`` is how far the rover went, forwards and backwards both counted up. ``measured_m_s`` is the speed by the
    last reading of the motion sensor that could tell, NaN if that is more than ``GAP_S`` ago. It is divided by the time
    between two readings, not by that between the ticks which saw them: ticks jitter.

    ``max_speed_m_s`` is the speed at full duty; at 0, if it is not known, commands count for nothing. Below
    ``quality_min`` the motion sensor cannot tell.
    """

    def __init__(self, max_speed_m_s: float = 0.0) -> None:
        self.max_speed_m_s = max_speed_m_s
        self.quality_min = DetectorSettings().quality_min
        self._north_m = self._east_m = 0.0
        self._t_s: float | None = None
        self._spoke_t_s = self._read_t_s = self._measured_t_s = -inf
        self._commanded_m = 0.0
        self._duties = 0.0
        self._follows = False
        self.path_m = 0.0
        self.measured_m_s = nan
        self.place: ReckonedPose | None = None

    def take(
        self, t_s: float, heading_deg: float | None, duties: float, motion: MotionReading | None
    ) -> ReckonedPose | None:
        """Take the next tick, and return where the rover is then; ``duties`` is the sum of both sides."""
        dt_s, self._t_s = t_s - (self._t_s if self._t_s is not None else t_s), t_s
        if dt_s <= GAP_S:
            self._commanded_m += self._duties * self.max_speed_m_s / 2.0 * dt_s
        self._duties = duties
        if t_s - self._measured_t_s > GAP_S:
            self.measured_m_s = nan
        forward_m, right_m = self._gone(motion, t_s)
        if heading_deg is None:
            return None
        north_m, east_m = displacement_m(heading_deg, forward_m, right_m)
        self._north_m += north_m
        self._east_m += east_m
        self.path_m += abs(forward_m)
        self.place = ReckonedPose(t_s, self._north_m, self._east_m, heading_deg)
        return self.place

    def interrupted(self) -> None:
        """Note that records are missing: nobody knows since when the next reading of the motion sensor counts."""
        self._follows, self.measured_m_s = False, nan

    def _gone(self, motion: MotionReading | None, t_s: float) -> tuple[float, float]:
        """Return how far the rover went since the last answer, forward and to the right."""
        if motion is None:
            if t_s - self._spoke_t_s <= SILENT_S:
                return 0.0, 0.0  # it comes with the next reading
            return self._taken(), 0.0
        silent_s, self._spoke_t_s = t_s - self._spoke_t_s, t_s
        follows, self._follows = self._follows, True
        commanded_m, most_m = self._taken(), self._most_m(silent_s)
        read_t_s, forward_m, right_m, quality, signed = motion
        since_s, self._read_t_s = read_t_s - self._read_t_s, read_t_s
        told = quality >= self.quality_min and abs(forward_m) <= most_m and abs(right_m) <= most_m  # False for NaN
        if not told:
            return commanded_m, 0.0
        if not signed and commanded_m < 0.0:
            forward_m = -forward_m  # the sense cannot tell which way; believe the wheels
        if follows and 0.0 < since_s < GAP_S:
            self.measured_m_s, self._measured_t_s = forward_m / since_s, t_s
        return forward_m, right_m

    def _most_m(self, silent_s: float) -> float:
        """Return how far the rover can have gone since the last answer."""
        return READING_MAX_M if silent_s == inf else max(READING_MAX_M, TOO_FAST * self.max_speed_m_s * silent_s)

    def _taken(self) -> float:
        commanded_m, self._commanded_m = self._commanded_m, 0.0
        return commanded_m
