"""The anomaly detector: from readings and commands to "something is wrong". Pure: time comes in as data.

It tells two things apart. *Anomalies* are what the forest does (blocked, tilted, touched) and go to the escape
handler. *Conditions* are what the rover's own senses do (stale, implausible, blind) and go to the safety gate.

Immobilised means: over a window of commanded driving, the ground moved by less than a share of what was commanded.
Sums over a window, not single samples, so that one noise count cannot hide a stall and one zero cannot fake one.
Nothing is claimed while the rover turns on the spot, while the command has just changed direction, or while the
motion sensor's quality is low: **low quality means unknown, never still**.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

from wayfarer.angles import wrap180
from wayfarer.bounds import Degrees, DegreesPerSecond, Fraction, MetresPerSecond, Seconds, SecondsOrNone
from wayfarer.conditions import Condition
from wayfarer.escape.api import Anomaly
from wayfarer.hal import CompassReading, ContactReading, MotionReading, WheelCommand
from wayfarer.latest import Snapshot


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """Thresholds, each with its own unit.

    ``stale`` ages: PX4 gives a compass 0.3 s, ArduPilot gives flow 0.5 s and a failed link 1.5 s. Tilt persists 0.2 s
    as PX4's attitude trigger persists 0.3 s; the released field code stops beyond 15 degrees of pitch, here on both
    axes and both signs with margin for rough ground. ``overturned_deg`` acts at once.
    """

    immobilised_s: Seconds = 0.3
    immobilised_below: Fraction = 0.3
    immobilised_from_m_s: MetresPerSecond = 0.1
    tilt_deg: Degrees = 20.0
    tilt_s: SecondsOrNone = 0.2
    overturned_deg: Degrees = 60.0
    touch_s: SecondsOrNone = 0.0
    quality_min: Fraction = 0.2
    compass_stale_s: Seconds = 0.3
    compass_lost_s: Seconds = 5.0
    motion_stale_s: Seconds = 0.5
    contact_stale_s: Seconds = 0.5
    motion_unknown_s: Seconds = 1.0
    motion_lost_s: Seconds = 10.0
    heading_rate_max_deg_s: DegreesPerSecond = 720.0
    heading_jump_deg: Degrees = 45.0
    implausible_s: Seconds = 0.5
    motion_speed_max_m_s: MetresPerSecond = 5.0


class Detection(NamedTuple):
    """What one update found. ``compass`` is the newest reading that can be true, None before the first."""

    anomalies: tuple[Anomaly, ...]
    conditions: tuple[Condition, ...]
    compass: CompassReading | None


class Stall:
    """Finds commanded driving that does not move the ground."""

    def __init__(self, settings: DetectorSettings) -> None:
        self._window_s = settings.immobilised_s - 1e-6  # sums of periods fall a rounding error short
        self._share = settings.immobilised_below
        self._from_m_s = settings.immobilised_from_m_s
        self._intervals: deque[tuple[float, float, float]] = deque()
        self.clear()

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._intervals.clear()
        self._span_s = self._commanded_m = self._moved_m = 0.0
        self._ahead = True

    def add(self, dt_s: float, commanded_m: float, moved_m: float) -> None:
        """Add an interval: how long, how far the wheels were told to go (signed), how far the ground went."""
        if abs(commanded_m) < self._from_m_s * dt_s:
            self.clear()
            return
        if (commanded_m > 0.0) is not self._ahead:
            self.clear()
            self._ahead = commanded_m > 0.0
        self._intervals.append((dt_s, commanded_m, moved_m))
        self._span_s += dt_s
        self._commanded_m += commanded_m
        self._moved_m += moved_m
        while self._span_s - self._intervals[0][0] >= self._window_s:
            dt_s, commanded_m, moved_m = self._intervals.popleft()
            self._span_s -= dt_s
            self._commanded_m -= commanded_m
            self._moved_m -= moved_m

    @property
    def found(self) -> bool:
        """Whether a whole window of commanded driving hardly moved the ground, or moved it the other way."""
        if self._span_s < self._window_s:
            return False
        moved_m = self._moved_m if self._ahead else -self._moved_m
        return moved_m < self._share * abs(self._commanded_m)


class Persistent:
    """Holds back a condition until it has lasted."""

    __slots__ = ("_for_s", "_since_s")

    def __init__(self, for_s: float) -> None:
        self._for_s = for_s - 1e-6
        self._since_s: float | None = None

    def update(self, t_s: float, present: bool) -> bool:
        """Return whether it has been present, without a gap, for long enough."""
        if not present:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = t_s
        return t_s - self._since_s >= self._for_s


class Detector:
    """Turns snapshots and applied commands into anomalies and conditions, one control tick at a time.

    ``max_speed_m_s`` is the ground speed at full duty; ``watches_contact`` says whether a touch is an anomaly and a
    silent contact sensor a condition; ``watches_motion`` likewise for the motion sensor.
    """

    def __init__(
        self,
        settings: DetectorSettings,
        max_speed_m_s: float,
        *,
        watches_motion: bool = True,
        watches_contact: bool = False,
    ) -> None:
        self._settings = settings
        self._max_speed_m_s = max_speed_m_s
        self._watches_motion = watches_motion
        self._watches_contact = watches_contact
        self._compass: CompassReading | None = None
        self._stall = Stall(settings)
        self._tilts = {tilt: Persistent(settings.tilt_s) for tilt in _TILTS}
        self._tilted = False
        self._touched = Persistent(settings.touch_s)
        self._implausible = Persistent(settings.implausible_s)
        self._commanded_m = 0.0
        self._last_t_s: float | None = None
        self._last_motion_t_s = self._last_known_t_s = 0.0

    def update(self, snapshot: Snapshot, applied: WheelCommand) -> Detection:
        """Take in one tick: what the sensors say now and what the wheels were told since the previous tick."""
        t_s = snapshot.t_s
        if self._last_t_s is None:
            self._last_motion_t_s = self._last_known_t_s = self._started_t_s = self._last_t_s = t_s
        self._commanded_m += (applied.left + applied.right) * 0.5 * self._max_speed_m_s * (t_s - self._last_t_s)
        self._last_t_s = t_s
        conditions = self._check_compass(t_s, snapshot.compass)
        if snapshot.motion is not None:
            self._add_motion(snapshot.motion, conditions)
        if self._watches_motion:
            self._check_motion_age(t_s, conditions)
        anomalies: list[Anomaly] = []
        if self._stall.found:
            anomalies.append(Anomaly.IMMOBILISED)
        self._check_tilt(t_s, anomalies, conditions)
        if self._watches_contact:
            self._check_contact(t_s, snapshot.contact, anomalies, conditions)
        return Detection(tuple(anomalies), tuple(conditions), self._compass)

    def _check_compass(self, t_s: float, reading: CompassReading | None) -> list[Condition]:
        settings = self._settings
        last = self._compass
        if reading is not None and reading is not last:
            if last is None or self._plausible(last, reading):
                self._implausible.update(t_s, False)
                self._compass = last = reading
            elif self._implausible.update(t_s, True):
                # It insists: the world may have turned under us. Believe it again, but not before a stop.
                self._compass = reading
                return [Condition.COMPASS_IMPLAUSIBLE]
        age_s = t_s - (last.t_s if last is not None else self._started_t_s)
        if age_s <= settings.compass_stale_s and last is not None:
            return []
        return [Condition.COMPASS_LOST if age_s > settings.compass_lost_s else Condition.COMPASS_STALE]

    def _plausible(self, last: CompassReading, reading: CompassReading) -> bool:
        allowed_deg = self._settings.heading_jump_deg + self._settings.heading_rate_max_deg_s * (
            reading.t_s - last.t_s
        )
        return abs(wrap180(reading.heading_deg - last.heading_deg)) <= allowed_deg

    def _add_motion(self, reading: MotionReading, conditions: list[Condition]) -> None:
        dt_s = reading.t_s - self._last_motion_t_s
        commanded_m, self._commanded_m = self._commanded_m, 0.0
        self._last_motion_t_s = reading.t_s
        limit_m = self._settings.motion_speed_max_m_s * dt_s
        if abs(reading.forward_m) > limit_m or abs(reading.right_m) > limit_m:
            conditions.append(Condition.MOTION_IMPLAUSIBLE)
        elif reading.quality >= self._settings.quality_min:
            self._last_known_t_s = reading.t_s
            self._stall.add(dt_s, commanded_m, reading.forward_m)
            return
        self._stall.clear()

    def _check_motion_age(self, t_s: float, conditions: list[Condition]) -> None:
        settings = self._settings
        unknown_s = t_s - self._last_known_t_s
        if unknown_s <= settings.motion_stale_s:
            return
        if t_s - self._last_motion_t_s > settings.motion_stale_s:
            self._stall.clear()
            conditions.append(Condition.MOTION_STALE)
        elif unknown_s > settings.motion_lost_s:
            conditions.append(Condition.MOTION_LOST)
        elif unknown_s > settings.motion_unknown_s:
            conditions.append(Condition.MOTION_UNKNOWN)

    def _check_tilt(self, t_s: float, anomalies: list[Anomaly], conditions: list[Condition]) -> None:
        if self._compass is None:
            return
        pitch_deg, roll_deg, limit_deg = self._compass.pitch_deg, self._compass.roll_deg, self._settings.tilt_deg
        if -limit_deg < pitch_deg < limit_deg and -limit_deg < roll_deg < limit_deg and not self._tilted:
            return
        self._tilted = False
        for tilt, angle_deg in zip(_TILTS, (pitch_deg, -pitch_deg, roll_deg, -roll_deg), strict=True):
            beyond = angle_deg >= limit_deg
            self._tilted |= beyond
            if self._tilts[tilt].update(t_s, beyond):
                anomalies.append(tilt)
        if max(abs(pitch_deg), abs(roll_deg)) >= self._settings.overturned_deg:
            conditions.append(Condition.OVERTURNED)

    def _check_contact(
        self,
        t_s: float,
        reading: ContactReading | None,
        anomalies: list[Anomaly],
        conditions: list[Condition],
    ) -> None:
        last_t_s = reading.t_s if reading is not None else self._started_t_s
        if t_s - last_t_s > self._settings.contact_stale_s:
            self._touched.update(t_s, False)
            conditions.append(Condition.CONTACT_STALE)
        elif self._touched.update(t_s, reading is not None and bool(reading.sides)):
            anomalies.append(Anomaly.TOUCHED)


_TILTS = (Anomaly.NOSE_UP, Anomaly.NOSE_DOWN, Anomaly.RIGHT_DOWN, Anomaly.LEFT_DOWN)
