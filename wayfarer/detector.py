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
    axes and both signs with margin for rough ground. ``overturned_deg`` acts at once. A heading may change by
    ``heading_jump_deg`` from one reading to the next (field catalogue, fault 5: 45 degrees), and by twice the fastest
    commanded turn.
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
    heading_rate_max_deg_s: DegreesPerSecond = 360.0
    heading_jump_deg: Degrees = 45.0
    implausible_s: Seconds = 0.5
    motion_speed_max_m_s: MetresPerSecond = 5.0


class Detection(NamedTuple):
    """What one update found."""

    anomalies: tuple[Anomaly, ...]
    conditions: tuple[Condition, ...]


ALL_WELL = Detection((), ())


class Stall:
    """Finds commanded driving that does not move the ground; ``found`` says whether a whole window of it did not."""

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
        self.found = False

    def add(self, dt_s: float, commanded_m: float, moved_m: float) -> None:
        """Add an interval: how long, how far the wheels were told to go, how far the ground went (both signed)."""
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
        # Moving the other way (rolling back down a slope) is not moving either.
        share_m = self._share * self._commanded_m
        too_little = self._moved_m < share_m if self._ahead else self._moved_m > share_m
        self.found = too_little and self._span_s >= self._window_s


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

    ``max_speed_m_s`` is the ground speed at full duty. ``watches_motion`` and ``needs_contact`` say whether silence of
    that sensor is a condition, ``watches_contact`` whether a touch is an anomaly as well. ``compass`` is the newest
    reading that can be true, None before the first: what fails the plausibility check never reaches a decision.
    """

    def __init__(
        self,
        settings: DetectorSettings,
        max_speed_m_s: float,
        *,
        watches_motion: bool = True,
        watches_contact: bool = False,
        needs_contact: bool = False,
    ) -> None:
        self._settings = settings
        self._half_speed_m_s = max_speed_m_s / 2
        self._watches_motion = watches_motion
        self._watches_contact = watches_contact
        self._needs_contact = needs_contact or watches_contact
        self.compass: CompassReading | None = None
        self._stall = Stall(settings)
        self._tilts = {tilt: Persistent(settings.tilt_s) for tilt in _TILTS}
        self._tilted = False
        self._tilt_deg = settings.tilt_deg
        self._touched = Persistent(settings.touch_s)
        self._implausible = Persistent(settings.implausible_s)
        self._jumped = False
        self._commanded_m = 0.0
        self._started_t_s: float | None = None
        self._last_t_s = self._read_t_s = self._compass_t_s = self._motion_t_s = self._moved_t_s = 0.0

    def update(self, snapshot: Snapshot, applied: WheelCommand) -> Detection:
        """Take in one tick: what the sensors say now and what the wheels were told since the previous tick."""
        t_s, compass, motion, contact = snapshot
        if self._started_t_s is None:
            self._start(t_s)
        self._commanded_m += (applied.left + applied.right) * self._half_speed_m_s * (t_s - self._last_t_s)
        self._last_t_s = t_s
        anomalies: list[Anomaly] = []
        conditions: list[Condition] = []
        if compass is not None and compass is not self.compass:
            self._take_compass(compass, conditions)
        if motion is not None:
            self._take_motion(motion, conditions)
        if self._stall.found:
            anomalies.append(Anomaly.IMMOBILISED)
        self._check_ages(t_s, conditions)
        self._check_tilt(t_s, anomalies, conditions)
        if self._needs_contact:
            self._check_contact(t_s, contact, anomalies, conditions)
        return Detection(tuple(anomalies), tuple(conditions)) if anomalies or conditions else ALL_WELL

    def _start(self, t_s: float) -> None:
        """Begin all ages now: what has not spoken yet is as old as the run."""
        self._started_t_s = self._last_t_s = self._read_t_s = t_s
        self._compass_t_s = self._motion_t_s = self._moved_t_s = t_s

    def _take_compass(self, reading: CompassReading, conditions: list[Condition]) -> None:
        _, heading_deg, pitch_deg, roll_deg, _ = reading
        if not (0.0 <= heading_deg < 360.0 and abs(pitch_deg) <= 180.0 and abs(roll_deg) <= 180.0):
            return  # no such angle, or NaN, however often it is repeated; soon there is no fresh heading
        last = self.compass
        since_s, self._read_t_s = reading.t_s - self._read_t_s, reading.t_s
        if last is not None and not self._plausible(last, reading, since_s):
            self._jumped = True
            if not self._implausible.update(reading.t_s, True):
                return
            # It insists: the rover may have been turned by hand. Believe it again, but not without a stop.
            conditions.append(Condition.COMPASS_IMPLAUSIBLE)
        if self._jumped:
            self._jumped = self._implausible.update(reading.t_s, False)
        self.compass = reading
        self._compass_t_s = reading.t_s

    def _plausible(self, last: CompassReading, reading: CompassReading, since_s: float) -> bool:
        """Tell whether the rover can have turned that far since the previous reading, believed or not."""
        turned_deg = abs((reading.heading_deg - last.heading_deg + 180.0) % 360.0 - 180.0)
        if turned_deg <= self._settings.heading_jump_deg:
            return True
        return turned_deg <= self._settings.heading_jump_deg + self._settings.heading_rate_max_deg_s * since_s

    def _take_motion(self, reading: MotionReading, conditions: list[Condition]) -> None:
        t_s, forward_m, right_m, quality, signed = reading
        dt_s, self._motion_t_s = t_s - self._motion_t_s, t_s
        if dt_s <= 0.0:
            return  # the first one: it says how far since nobody knows when
        commanded_m, self._commanded_m = self._commanded_m, 0.0
        if not signed and commanded_m < 0.0:
            forward_m = -forward_m  # the sense cannot tell which way; believe the wheels
        limit_m = self._settings.motion_speed_max_m_s * dt_s
        if not abs(forward_m) <= limit_m >= abs(right_m):
            conditions.append(Condition.MOTION_IMPLAUSIBLE)
        elif quality >= self._settings.quality_min:
            self._moved_t_s = t_s
            self._stall.add(dt_s, commanded_m, forward_m)
            return
        self._stall.clear()

    def _check_ages(self, t_s: float, conditions: list[Condition]) -> None:
        settings = self._settings
        compass_age_s = t_s - self._compass_t_s
        if compass_age_s > settings.compass_stale_s or self.compass is None:
            lost = compass_age_s > settings.compass_lost_s
            conditions.append(Condition.COMPASS_LOST if lost else Condition.COMPASS_STALE)
        if self._watches_motion and t_s - self._moved_t_s > settings.motion_stale_s:
            self._check_motion_age(t_s, conditions)

    def _check_motion_age(self, t_s: float, conditions: list[Condition]) -> None:
        settings = self._settings
        unknown_s = t_s - self._moved_t_s
        if t_s - self._motion_t_s > settings.motion_stale_s:
            self._stall.clear()
            conditions.append(Condition.MOTION_STALE)
        elif unknown_s > settings.motion_lost_s:
            conditions.append(Condition.MOTION_LOST)
        elif unknown_s > settings.motion_unknown_s:
            conditions.append(Condition.MOTION_UNKNOWN)

    def _check_tilt(self, t_s: float, anomalies: list[Anomaly], conditions: list[Condition]) -> None:
        if self.compass is None:
            return
        _, _, pitch_deg, roll_deg, _ = self.compass
        limit_deg = self._tilt_deg
        if abs(pitch_deg) < limit_deg > abs(roll_deg) and not self._tilted:
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
        spoken_t_s = reading.t_s if reading is not None else self._started_t_s
        if spoken_t_s is None or t_s - spoken_t_s > self._settings.contact_stale_s:
            self._touched.update(t_s, False)
            conditions.append(Condition.CONTACT_STALE)
        elif self._touched.update(t_s, self._watches_contact and reading is not None and bool(reading.sides)):
            anomalies.append(Anomaly.TOUCHED)


_TILTS = (Anomaly.NOSE_UP, Anomaly.NOSE_DOWN, Anomaly.RIGHT_DOWN, Anomaly.LEFT_DOWN)
