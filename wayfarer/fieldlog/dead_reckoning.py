"""Dead reckoning over the records of a log. Pure.

The motion sensor says how far, while it can; where it cannot tell, the wheels' commands do. The compass alone says
which way. Good enough to draw a path and to search for a lost rover; no decision ever sees it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from wayfarer.angles import displacement_m

QUALITY_MIN = 0.2  # as ``DetectorSettings.quality_min``: below it the sensor cannot tell
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

    ``path_m`` is how far the rover went, forwards and backwards both counted up.

    Args:
        header: the log's first record, for the speed at full duty; without one commands count for nothing.
    """

    def __init__(self, header: dict[str, Any]) -> None:
        vehicle = header.get("config", {}).get("vehicle", {})
        self._half_speed_m_s = float(vehicle.get("max_speed_m_s", 0.0)) / 2.0
        self._north_m = self._east_m = 0.0
        self._t_s: float | None = None
        self._spoke_t_s = float("-inf")
        self._commanded_m = 0.0
        self._applied = (0.0, 0.0)
        self.path_m = 0.0
        self.place: ReckonedPose | None = None

    def take(self, tick: dict[str, Any]) -> ReckonedPose | None:
        """Take the next ``tick`` record, and return where the rover is then."""
        t_s, heading_deg = tick["t_s"], tick.get("heading_deg")
        dt_s, self._t_s = t_s - (self._t_s if self._t_s is not None else t_s), t_s
        if dt_s <= GAP_S:
            self._commanded_m += sum(self._applied) * self._half_speed_m_s * dt_s
        self._applied = (tick.get("applied_left") or 0.0, tick.get("applied_right") or 0.0)
        forward_m, right_m = self._gone(tick.get("motion"), t_s)
        if heading_deg is None:
            return None
        north_m, east_m = displacement_m(heading_deg, forward_m, right_m)
        self._north_m += north_m
        self._east_m += east_m
        self.path_m += abs(forward_m)
        self.place = ReckonedPose(t_s, self._north_m, self._east_m, heading_deg)
        return self.place

    def _gone(self, motion: dict[str, Any] | None, t_s: float) -> tuple[float, float]:
        """Return how far the rover went since the last answer, forward and to the right."""
        if motion is None:
            if t_s - self._spoke_t_s <= SILENT_S:
                return 0.0, 0.0  # it comes with the next reading
            return self._taken(), 0.0
        silent_s, self._spoke_t_s = t_s - self._spoke_t_s, t_s
        commanded_m = self._taken()
        forward_m, right_m, quality = motion["forward_m"], motion["right_m"], motion["quality"]
        if forward_m is None or right_m is None or quality is None or quality < QUALITY_MIN:
            return commanded_m, 0.0
        if max(abs(forward_m), abs(right_m)) > self._most_m(silent_s):
            return commanded_m, 0.0
        if not motion.get("signed", True) and commanded_m < 0.0:
            forward_m = -forward_m  # the sense cannot tell which way; believe the wheels
        return forward_m, right_m

    def _most_m(self, silent_s: float) -> float:
        """Return how far the rover can have gone since the last answer."""
        if silent_s == float("inf"):
            return READING_MAX_M
        return max(READING_MAX_M, TOO_FAST * 2.0 * self._half_speed_m_s * silent_s)

    def _taken(self) -> float:
        commanded_m, self._commanded_m = self._commanded_m, 0.0
        return commanded_m
