"""Status of a sensor from its readings: age of the last one, and rate. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from wayfarer.fieldlog.fields import number

WINDOW_S = 2.0  # for the rate
STALE_S = 0.5  # where the rover file gives no limit; PX4 and ArduPilot allow flow as much
PERIODS = 4.0  # of a slow sensor, such as a receiver at 1 Hz, before it counts as late


class SensorStatus:
    """Follows one sensor. ``rate_hz`` is what its rover file asks for, and ``stale_s`` when it counts as silent."""

    def __init__(self, rate_hz: float | None, stale_s: float | None) -> None:
        self._wanted_hz = rate_hz
        self._stale_s = max(stale_s or STALE_S, PERIODS / rate_hz if rate_hz else 0.0)
        self._times_s: deque[float] = deque(maxlen=400)
        self._note = ""
        self._failures = 0

    def take(self, reading: Mapping[str, Any]) -> None:
        """Take what the sensor said last; the same reading again does not count."""
        t_s = number(reading, "t_s")
        if t_s is None or (self._times_s and t_s <= self._times_s[-1]):
            return
        self._times_s.append(t_s)
        while t_s - self._times_s[0] > WINDOW_S:
            self._times_s.popleft()
        self._note = _note(reading)

    def fail(self) -> None:
        """Count a failure that the log tells of."""
        self._failures += 1

    def now(self, t_s: float) -> dict[str, Any]:
        """Return how it does; ``age_s`` is None where it has never spoken."""
        times_s = self._times_s
        span_s = times_s[-1] - times_s[0] if len(times_s) > 1 else 0.0
        age_s = max(0.0, t_s - times_s[-1]) if times_s else None
        return {
            "age_s": None if age_s is None else round(age_s, 2),
            "rate_hz": round((len(times_s) - 1) / span_s, 1) if span_s else None,
            "wanted_hz": self._wanted_hz,
            "late": age_s is None or age_s > self._stale_s,
            "failures": self._failures,
            "note": self._note,
        }


def _note(reading: Mapping[str, Any]) -> str:
    """Say how good a reading is, in the sensor's own terms."""
    quality, calibration, error_m = (number(reading, key) for key in ("quality", "calibration", "error_m"))
    if quality is not None:
        return f"quality {quality:.0%}"
    if calibration is not None:
        return f"calibration {calibration:.0f} of 3"
    return "" if error_m is None else f"error {error_m:.0f} m"
