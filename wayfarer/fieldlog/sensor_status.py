"""Status of a sensor from its readings: age of the last one, rates, pauses and failures. Pure."""

from __future__ import annotations

from collections import deque
from math import nan

from wayfarer.fieldlog.record import Compass, Contact, Fix, Motion, Wheels

WINDOW_S = 2.0  # for the rate now
STALE_S = 0.5  # if the rover file gives no limit; PX4 and ArduPilot allow flow as much
PERIODS = 4.0  # of a slow sensor, such as a receiver at 1 Hz, before it counts as late


class SensorStatus:
    """Follows one sensor.

    ``readings`` counts what it said, ``failures`` the ``sensor_failed`` events, ``doubtful`` the motion readings that
    could not be used. ``longest_gap_s`` is the longest pause; none is measured across missing records.

    Args:
        wanted_hz: the rate that the rover file asks for.
        stale_s: the age at which it counts as silent.
    """

    def __init__(self, wanted_hz: float | None = None, stale_s: float | None = None) -> None:
        self.wanted_hz = wanted_hz
        self._stale_s = max(stale_s or STALE_S, PERIODS / wanted_hz if wanted_hz else 0.0)
        self.readings = self.failures = self.doubtful = 0
        self.longest_gap_s = 0.0
        self._gaps = 0
        self._spoken_s = 0.0
        self._times_s: deque[float] = deque(maxlen=400)
        self._last: Compass | Motion | Contact | Wheels | Fix | None = None
        self._unbroken = False

    def add(self, reading: Compass | Motion | Contact | Wheels | Fix) -> None:
        """Take what the sensor said last; a tick repeats it until there is more."""
        t_s, times_s = reading.t_s, self._times_s
        before_s = times_s[-1] if times_s else None
        if t_s is None or t_s == before_s:
            return
        if before_s is not None and t_s < before_s:
            times_s.clear()  # the part's own clock began again
        elif before_s is not None and self._unbroken:
            self._gaps += 1
            self._spoken_s += t_s - before_s
            self.longest_gap_s = max(self.longest_gap_s, t_s - before_s)
        self.readings += 1
        self._unbroken = True
        self._last = reading
        times_s.append(t_s)
        while t_s - times_s[0] > WINDOW_S:
            times_s.popleft()

    def interrupted(self) -> None:
        """Note that records are missing: the next reading follows no other."""
        self._unbroken = False

    def fell_silent(self, t_s: float) -> None:
        """Note that the log ends: a sensor that said nothing more has a pause up to there."""
        if self._unbroken:
            self.longest_gap_s = max(self.longest_gap_s, t_s - self._times_s[-1])

    def age_s(self, t_s: float) -> float | None:
        """Return how old the last reading is; None if it has never spoken."""
        return max(0.0, t_s - self._times_s[-1]) if self._times_s else None

    def is_late(self, t_s: float) -> bool:
        """Return whether it counts as silent."""
        age_s = self.age_s(t_s)
        return age_s is None or age_s > self._stale_s

    @property
    def rate_hz(self) -> float:
        """Return the readings per second over the whole run, NaN if there are not two."""
        return self._gaps / self._spoken_s if self._spoken_s > 0.0 else nan

    @property
    def rate_now_hz(self) -> float | None:
        """Return the readings per second of the last ``WINDOW_S``, None if there are not two."""
        times_s = self._times_s
        span_s = times_s[-1] - times_s[0] if times_s else 0.0
        return (len(times_s) - 1) / span_s if span_s > 0.0 else None

    @property
    def note(self) -> str:
        """Return how good the last reading is, in the sensor's own terms."""
        match self._last:
            case Motion(quality=quality) if quality is not None:
                return f"quality {quality:.0%}"
            case Compass(calibration=calibration) if calibration is not None:
                return f"calibration {calibration} of 3"
            case Fix(error_m=error_m) if error_m is not None:
                return f"error {error_m:.0f} m"
        return ""
