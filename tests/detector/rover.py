"""A rover for the detector's tests: what its sensors say, tick by tick."""

from __future__ import annotations

from random import Random
from typing import Any, NamedTuple

from wayfarer.detector import Detector, DetectorSettings
from wayfarer.detector.detector import DetectorTick
from wayfarer.escape.api import Anomaly
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import STOP, CompassReading, ContactReading, MotionReading, Snapshot, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.settings import SafetySettings
from wayfarer.safety.tick_interval import MOST_SHARE, IntervalTimer, Moved

MAX_SPEED_M_S = 1.0
VEHICLE = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=MAX_SPEED_M_S)
TICK_S = 0.0625  # binary, so that times are exact
SETTINGS = DetectorSettings(
    immobilised_s=0.25, tilt_s=0.25, compass_stale_s=0.25, motion_stale_s=0.5, contact_stale_s=0.5
)
FULL = WheelCommand(1.0, 1.0)
BACK = WheelCommand(-1.0, -1.0)
PIVOT = WheelCommand(1.0, -1.0)
STEP_M = MAX_SPEED_M_S * TICK_S
NOISE_M = 1e-4


class Detection(NamedTuple):
    """What one tick found."""

    anomalies: tuple[Anomaly, ...]
    conditions: tuple[Condition, ...]


ALL_WELL = Detection((), ())


class Rover:
    """Feeds a detector; all sensors speak each tick and say that all is well unless told otherwise."""

    def __init__(self, settings: DetectorSettings = SETTINGS, vehicle: Vehicle = VEHICLE, **watches: Any) -> None:
        self.detector = Detector(settings, vehicle, **watches)
        self.timer = IntervalTimer(SafetySettings().tick_late_s, vehicle.max_speed_m_s)
        self.t_s = 0.0
        self.armed = False
        self._noise = Random(0)
        self.compass: CompassReading | None = None
        self.contact: ContactReading | None = None

    def tick(
        self,
        applied: WheelCommand = STOP,
        moved_m: float | None = 0.0,
        *,
        compass: bool = True,
        quality: float = 1.0,
        signed: bool = True,
        dt_s: float = TICK_S,
        **fields: Any,
    ) -> Detection:
        """One tick; ``moved_m`` None and ``compass`` False mean that the sensor is silent."""
        self.t_s += dt_s
        if compass:
            self.compass = CompassReading(self.t_s, 0.0, 0.0, 0.0, None)._replace(**fields)
        motion = (
            MotionReading(self.t_s, moved_m, self._noise_m(moved_m), quality, signed) if moved_m is not None else None
        )
        return self.sees(Snapshot(self.t_s, self.compass, motion, self.contact), applied)

    def _noise_m(self, moved_m: float) -> float:
        """Return noise sideways: no sensor that sees ground that moves repeats a reading to the last digit."""
        return self._noise.uniform(-NOISE_M, NOISE_M) if moved_m else 0.0

    def sees(self, snapshot: Snapshot, applied: WheelCommand = STOP) -> Detection:
        """One tick with any snapshot."""
        tick = DetectorTick(snapshot.t_s, applied)
        tick.compass, tick.motion, tick.contact = snapshot.compass, snapshot.motion, snapshot.contact
        tick.rims = snapshot.wheels
        self.timer.measure(tick)
        self.detector.update(tick, armed=self.armed)
        return Detection(tick.anomalies, tick.conditions)

    def drive(self, ticks: int, applied: WheelCommand = FULL, moved_m: float | None = 0.0, **fields: Any) -> list[bool]:
        """Tick and tell for each whether the rover is called immobilised."""
        return [Anomaly.IMMOBILISED in self.tick(applied, moved_m, **fields).anomalies for _ in range(ticks)]

    def headings(self, *headings_deg: float, **fields: Any) -> list[tuple[Condition, ...]]:
        """Stand, while the compass reads these; return the conditions of each tick."""
        return [self.tick(heading_deg=heading_deg, **fields).conditions for heading_deg in headings_deg]

    @property
    def heading_deg(self) -> float:
        """The heading that is believed."""
        assert self.detector.compass is not None
        return self.detector.compass.heading_deg


def moved(
    commanded_m: float, forward_m: float | None, driven_s: float = TICK_S, *, straight: float = 1.0, slid_m: float = 0.0
) -> Moved:
    """Return what one reading shows; ``forward_m`` None: nothing is known. ``straight`` is the share of the push."""
    each = Moved()
    each.commanded_m, each.way_m, each.pushed_m = commanded_m, abs(commanded_m), abs(commanded_m) / straight
    each.most_m = MOST_SHARE * each.way_m
    each.driven_s = each.read_s = driven_s
    if forward_m is not None:
        each.see(forward_m, slid_m, signed=True)
    return each


def started(settings: DetectorSettings = SETTINGS, **watches: Any) -> Rover:
    """A rover whose first tick was well."""
    rover = Rover(settings, **watches)
    assert rover.tick() == ALL_WELL
    return rover
