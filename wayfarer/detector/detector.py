"""The detector: one tick's readings and command in, anomalies and conditions out."""

from __future__ import annotations

from math import inf, radians

from wayfarer.detector.compass import TURNS_FROM_DEG_S, CompassMonitor, HeadingEstimator
from wayfarer.detector.ground import TILTS, GradeCompensation, GroundSlope, TiltMonitor
from wayfarer.detector.motion import MotionMonitor
from wayfarer.detector.response import TurnabilityMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.detector.wheels import WheelMonitor
from wayfarer.escape.api import Anomaly
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import STOP, CompassReading, ContactReading, MotionReading, Snapshot, WheelCommand, WheelReading
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import Debounce, Moved, TickInterval


class DetectorTick(TickInterval):
    """The readings of the sensors at a tick, and what the detector found in them.

    A reading is None if the sensor has not answered yet (motion and rims: since the last tick). ``rims`` is what the
    wheels did, as their sensor says, and ``duties`` then those of the motors, with what a slope takes up.
    """

    compass: CompassReading | None = None
    motion: MotionReading | None = None
    contact: ContactReading | None = None
    rims: WheelReading | None = None
    duties: WheelCommand = STOP
    anomalies: tuple[Anomaly, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @property
    def snapshot(self) -> Snapshot:
        """The readings alone, to keep or compare them."""
        return Snapshot(self.t_s, self.compass, self.motion, self.contact, self.rims)


class Detector:
    """Turns readings and applied commands into anomalies and conditions, one control tick at a time.

    ``vehicle`` gives the ground speed and the turn rate at full duty, ``calibration_min`` (0 to 3) the calibration that
    arming demands of the compass, ``duty_max`` the highest duty that the gate allows. ``watches_motion`` and
    ``needs_contact`` say whether silence of that sensor is a condition. ``watches_contact`` says whether a touch is an
    anomaly; then silence is a condition as well. ``has_wheels`` says whether there is a sensor of the wheels, and
    ``witnesses`` who of ``wheels``, ``current`` and ``yaw`` is asked whether the rover is stuck. ``may_reckon`` says
    whether a mission goes on without a compass (``HeadingEstimator``).

    ``grade`` compensates the ground's slope in the duties, ``odometer`` measures the way.

    ``compass`` and ``contact`` are the newest plausible readings, None before the first; ``moved`` is what this tick's
    motion reading shows, None if there is none. Decisions use no others.
    """

    def __init__(
        self,
        settings: DetectorSettings,
        vehicle: Vehicle,
        *,
        calibration_min: int = 0,
        duty_max: float = 1.0,
        watches_motion: bool = True,
        has_wheels: bool = False,
        witnesses: frozenset[str] = frozenset(),
        watches_contact: bool = False,
        needs_contact: bool = False,
        may_reckon: bool = True,
    ) -> None:
        self._turning_duty = radians(TURNS_FROM_DEG_S) * vehicle.track_m / vehicle.max_speed_m_s
        self._compass = CompassMonitor(settings, calibration_min)
        self._heading = HeadingEstimator(vehicle, may_reckon=may_reckon)
        self._wheels = WheelMonitor(settings, vehicle, witnesses) if has_wheels else None
        self._motion = MotionMonitor(
            settings, vehicle, watched=watches_motion, sightless=bool(witnesses) and not watches_motion,
            by_yaw="yaw" in witnesses, measures=watches_motion or not has_wheels,
        )  # fmt: skip
        self._by_wheels = has_wheels and not watches_motion
        self._needs_contact = needs_contact or watches_contact
        self._contact = ContactMonitor(settings, touch_counts=watches_contact, needed=self._needs_contact)
        self._ground = GroundSlope()
        self._tilt = TiltMonitor(settings, self._ground)
        self.grade = GradeCompensation(vehicle)
        self._turns = TurnabilityMonitor(settings, duty_max)
        self._started = False
        self.compass: CompassReading | None = None
        self.moved: Moved | None = None
        self.odometer = self._motion.odometer
        self.contact: ContactReading | None = None

    def update(self, tick: DetectorTick, *, armed: bool = False) -> None:
        """Judge one tick, of a mission if ``armed``: fill in its anomalies and conditions."""
        t_s, contact = tick.t_s, tick.contact
        if not self._started:  # the age of a sensor that has not answered yet is that of the run
            self._started = True
            self._compass.believed_t_s = self._contact.spoke_t_s = t_s
            self._motion.start(t_s)
            if (wheels := self._wheels) is not None:
                wheels.start(t_s)
        left, right = tick.left, tick.right
        turns = abs(left - right) >= self._turning_duty
        before_deg, turned_deg = self._heading.gained_deg, self._compass.gained_deg
        driven_s = tick.driven_s if left or right else 0.0
        conditions = self._compass.update(t_s, driven_s, tick.compass, turns=turns, moves=self._motion.moves)
        turned_deg = self._compass.gained_deg - turned_deg
        self._heading.update(tick, self._compass.reading, turned_deg, conditions, armed=armed)
        gained_deg = self._heading.gained_deg
        doubtful = bool(conditions)
        if not (left or right) and (believed := self._heading.reading) is not None:
            rises_deg, falls_deg, _, _ = self._ground.towards_deg(believed.heading_deg)
            pitch_deg, runaway = 0.0 if doubtful else believed.pitch_deg, self._motion.runaway
            runaway.falls_ahead_deg, runaway.falls_back_deg = max(-pitch_deg, falls_deg), max(pitch_deg, rises_deg)
        stood = False
        if (wheels := self._wheels) is not None:
            wheels.update(tick, tick.duties, gained_deg - before_deg, tick.rims, conditions)
            if self._by_wheels:
                self.odometer.update(tick.forward_m, wheels.moved, wheels.rims.since_m)
            stood = wheels.stood
            self._motion.rolls = self._by_wheels and wheels.turns
        self._motion.update(tick, gained_deg - before_deg, tick.motion, conditions)
        stood = stood and not self._motion.moves  # who sees the ground pass is believed
        if stood:
            self._motion.begin_stride()
        self.moved = moved = self._motion.moved
        anomalies = [Anomaly.IMMOBILISED] if self._motion.stall.found or self._motion.stride_over or stood else []
        self.compass = believed = self._heading.reading
        if believed is not None:
            self._tilt.update(t_s, believed, anomalies, conditions)
            moves = self._motion.moves
            self._ground.update(believed, moved, tick.forward_m, moves=moves, heading_known=not doubtful)
            pitch_deg = self._ground.pitch_deg(believed.heading_deg)
            self.grade.update(tick, moved, pitch_deg, free=moves and not anomalies)
        if contact is not None or self._needs_contact:
            self._contact.update(t_s, contact, anomalies, conditions)
            self.contact = self._contact.reading
        if found := self._turns.update(tick, gained_deg, free=self._ground.flat and not doubtful):
            conditions += found
        if anomalies or conditions:
            tick.anomalies, tick.conditions = tuple(anomalies), tuple(conditions)

    def begin_arming(self) -> None:
        """Forget turns that failed before the rover was armed: a person has looked at it since."""
        self._turns.reset()

    def begin_mission(self, tick: DetectorTick) -> None:
        """Take the ground to be as the body stands on it now, where a person has put it: that is not an anomaly."""
        if self.compass is not None:
            self._ground.begin(self.compass)
        tick.anomalies = tuple(each for each in tick.anomalies if each not in TILTS)


class ContactMonitor:
    """Keeps the newest plausible reading in ``reading``, None before the first.

    ``touch_counts`` says whether a touch is an anomaly, ``needed`` whether silence is a condition.
    """

    def __init__(self, settings: DetectorSettings, *, touch_counts: bool, needed: bool) -> None:
        self._stale_s = settings.contact_stale_s
        self._touch_counts = touch_counts
        self._needed = needed
        self._touched = Debounce(settings.touch_s)
        self.reading: ContactReading | None = None
        self._seen: ContactReading | None = None
        self._read_t_s = -inf
        self.spoke_t_s = 0.0

    def update(
        self, t_s: float, reading: ContactReading | None, anomalies: list[Anomaly], conditions: list[Condition]
    ) -> None:
        """Take in a tick, and add what is found."""
        if reading is not None and reading is not self._seen:
            self._seen = reading
            read_t_s, bearing_deg = reading.t_s, reading.obstacle_bearing_deg
            if self._read_t_s <= read_t_s <= t_s and (bearing_deg is None or 0.0 <= bearing_deg < 180.0):
                self.reading = reading
                self._read_t_s = self.spoke_t_s = read_t_s
        if not self._needed:
            return
        stale = t_s - self.spoke_t_s > self._stale_s
        touches = self._touch_counts and self.reading is not None and bool(self.reading.sides)
        if self._touched.update(t_s, touches and not stale):
            anomalies.append(Anomaly.TOUCHED)
        if stale:
            conditions.append(Condition.CONTACT_STALE)
