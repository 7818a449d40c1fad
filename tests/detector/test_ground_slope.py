"""The slope of the ground: what a rover learns of it, what it does not, and tilt that is counted from it."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, degrees, radians, sin, tan
from random import Random
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.detector.rover import BACK, FULL, PIVOT, SETTINGS, STEP_M, TICK_S, Detection, Rover, moved
from wayfarer.detector.detector import DetectorTick
from wayfarer.detector.ground import LEARN_M, LEVEL_DEG, SLOPE_MAX_DEG, TILTS, GroundSlope
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Anomaly
from wayfarer.hal import STOP, CompassReading, WheelCommand
from wayfarer.safety.conditions import Condition

ARC = WheelCommand(1.0, 0.0)
LEFT_TURN = WheelCommand(-1.0, 1.0)
FIFTEEN = replace(SETTINGS, tilt_deg=15.0)  # the limit of ForestRover
TURN_STEP_DEG = 10.0


class Hillside(Rover):
    """A rover on ground that rises by ``slope_deg`` towards the compass angle ``uphill_deg``; ``nose_deg`` is added."""

    def __init__(self, slope_deg: float, uphill_deg: float = 0.0, settings: DetectorSettings = FIFTEEN) -> None:
        super().__init__(settings)
        self.slope_deg, self.uphill_deg = slope_deg, uphill_deg
        self.true_deg = self.nose_deg = 0.0
        self.noise = Random(0)
        self.noise_deg = 0.0
        self.sees_ground = True

    def attitude(self) -> dict[str, Any]:
        """Heading, pitch and roll of a body on a plane: roll turns about the body's own axis."""
        rise, bearing = tan(radians(self.slope_deg)), radians(self.uphill_deg - self.true_deg)
        pitch = atan(rise * cos(bearing))
        roll = -atan(rise * sin(bearing) * cos(pitch))
        noisy = [self.noise.uniform(-self.noise_deg, self.noise_deg) for _ in range(2)]
        return {
            "heading_deg": self.true_deg % 360.0,
            "pitch_deg": degrees(pitch) + self.nose_deg + noisy[0],
            "roll_deg": degrees(roll) + noisy[1],
        }

    def step(self, applied: WheelCommand = STOP, *, share: float = 1.0, **fields: Any) -> Detection:
        """One tick, in which the body does that share of what is commanded."""
        ahead = (applied.left + applied.right) / 2
        self.true_deg += (applied.left - applied.right) / 2 * TURN_STEP_DEG
        quality = 1.0 if self.sees_ground else 0.0
        return self.tick(applied, share * ahead * STEP_M, quality=quality, **(self.attitude() | fields))

    def go(self, metres: float, applied: WheelCommand = FULL, **fields: Any) -> None:
        """Drive, whatever is found."""
        for _ in range(round(metres / STEP_M)):
            self.step(applied, **fields)

    def begin(self) -> None:
        """Begin a mission here."""
        self.step()
        self.detector.begin_mission(DetectorTick(self.t_s))
        self.armed = True

    def tilts(self, ticks: int = 6, applied: WheelCommand = STOP, **fields: Any) -> set[Anomaly]:
        """Return the tilts that some ticks find."""
        return {tilt for _ in range(ticks) for tilt in self.step(applied, **fields).anomalies if tilt in TILTS}


SLOPES = st.floats(0.0, SLOPE_MAX_DEG)
BEARINGS = st.floats(0.0, 360.0)
WAYS = st.lists(st.tuples(st.sampled_from([FULL, BACK, PIVOT, LEFT_TURN, STOP]), st.integers(1, 30)), max_size=12)


@given(SLOPES, BEARINGS, WAYS, st.floats(0.0, 3.0))
@example(25.0, 0.0, [(PIVOT, 9), (STOP, 20), (FULL, 20), (PIVOT, 18), (BACK, 30), (LEFT_TURN, 30)], 3.0)
def test_hillside_is_no_tilt_however_a_rover_drives_and_turns_on_it(
    slope_deg: float, uphill_deg: float, ways: list[tuple[WheelCommand, int]], noise_deg: float
) -> None:
    rover = Hillside(slope_deg, uphill_deg)
    rover.noise_deg = noise_deg
    rover.begin()
    for applied, ticks in ways:
        assert rover.tilts(ticks, applied) == set()


@given(SLOPES, BEARINGS, st.floats(60.0, 140.0), st.floats(0.3, 1.0), st.sampled_from([15.0, 20.0]))
@example(25.0, 180.0, 60.0, 0.3, 15.0)
@example(4.9, 180.0, 60.0, 0.3, 15.0)
def test_nose_that_rises_at_a_trunk_is_found_on_any_hillside_in_the_time_of_level_ground(
    slope_deg: float, uphill_deg: float, deg_per_m: float, speed: float, tilt_deg: float
) -> None:
    """MuJoCo's nose rises by up to 140 degrees per metre; 60 bring it to the limit within the length of a body.

    The body is seen to move meanwhile. What it learns then, and what counts as level, delay the finding a little.
    """
    rover = Hillside(slope_deg, uphill_deg, replace(SETTINGS, tilt_deg=tilt_deg))
    rover.begin()
    rover.go(3.0)
    beyond_s = 0.0
    while Anomaly.NOSE_UP not in rover.step(WheelCommand(speed, speed)).anomalies:
        rover.nose_deg += deg_per_m * speed * STEP_M
        beyond_s += TICK_S * (rover.nose_deg >= tilt_deg + LEVEL_DEG + 1.5)
        assert beyond_s <= SETTINGS.tilt_s + TICK_S


def test_pitch_that_becomes_roll_in_a_turn_on_the_spot_is_no_tilt() -> None:
    rover = Hillside(20.0)
    rover.begin()
    assert rover.tilts(9, PIVOT) == set()
    assert rover.attitude()["roll_deg"] == pytest.approx(20.0)
    assert rover.tilts(20) == set()


def test_body_that_leans_to_the_other_side_than_the_ground_is_tilted() -> None:
    rover = Hillside(16.0)
    rover.begin()
    rover.nose_deg = -32.0
    assert rover.tilts() == {Anomaly.NOSE_DOWN}


@pytest.mark.parametrize(
    ("applied", "share", "sees"),
    [
        (STOP, 0.0, True),  # held
        (FULL, 0.0, True),  # the wheels spin
        (FULL, 1.0, False),
        (PIVOT, 1.0, True),
    ],
)
def test_tilt_of_a_body_that_is_not_seen_to_drive_never_becomes_ground(
    applied: WheelCommand, share: float, sees: bool
) -> None:
    rover = Hillside(0.0)
    rover.begin()
    rover.nose_deg, rover.sees_ground = 14.0, sees
    for _ in range(1000):
        rover.step(applied, share=share)
    rover.nose_deg = 15.0
    assert rover.tilts(applied=applied, share=share) == {Anomaly.NOSE_UP}


def test_body_that_rolls_without_a_command_learns_nothing() -> None:
    rover = Hillside(0.0)
    rover.begin()
    rover.nose_deg = 14.0
    for _ in range(1000):
        rover.tick(STOP, STEP_M, **rover.attitude())
    rover.nose_deg = 15.0
    assert rover.tilts() == {Anomaly.NOSE_UP}


def test_slope_that_a_rover_drives_over_becomes_ground() -> None:
    rover = Hillside(12.0)
    rover.noise_deg = 0.01
    rover.step()
    rover.go(5.0 * LEARN_M)
    rover.nose_deg = 14.0
    assert rover.tilts() == set()
    rover.nose_deg = 16.0
    assert rover.tilts() == {Anomaly.NOSE_UP}
    rover.nose_deg = -16.0
    assert rover.tilts() == {Anomaly.NOSE_DOWN}


def test_tilt_that_a_rover_drives_on_with_for_metres_was_ground() -> None:
    """A slope that began at once is found as a trunk is, and ends to be one: else every way out would be blocked."""
    rover = Hillside(20.0)
    rover.step()
    assert rover.tilts(applied=FULL) == {Anomaly.NOSE_UP}
    rover.go(4.0, BACK)
    assert rover.tilts() == set()


def test_hillside_that_begins_over_some_metres_is_no_tilt() -> None:
    rover = Hillside(0.0)
    rover.begin()
    for tenth_deg in range(200):
        rover.slope_deg = tenth_deg / 10.0
        assert rover.tilts(1, FULL) == set()  # 1.6 degrees per metre


def test_near_tipping_a_tilt_counts_on_any_ground() -> None:
    for slope_deg in (0.0, 20.0, 25.0, 40.0):
        rover = Hillside(slope_deg)
        rover.begin()
        rover.go(20.0)
        rover.nose_deg = 38.0 - slope_deg  # tipping_deg less half of the limit, 37.5
        assert Anomaly.NOSE_UP in rover.tilts(), slope_deg


def test_limit_beyond_that_of_tipping_counts_as_it_is() -> None:
    rover = Hillside(0.0, settings=replace(SETTINGS, tilt_deg=44.0))
    rover.nose_deg = 43.0
    assert rover.tilts() == set()
    rover.nose_deg = 45.0
    assert rover.tilts() == {Anomaly.NOSE_UP}


def test_hillside_where_a_mission_begins_is_no_tilt_from_its_first_tick_on() -> None:
    rover = Hillside(16.0)
    assert rover.tilts() == {Anomaly.NOSE_UP}
    tick = DetectorTick(rover.t_s)
    tick.anomalies = (Anomaly.NOSE_UP, Anomaly.TOUCHED)
    rover.detector.begin_mission(tick)
    assert list(tick.anomalies) == [Anomaly.TOUCHED]
    assert rover.tilts() == set()


def test_mission_cannot_begin_on_what_no_ground_is() -> None:
    rover = Hillside(41.0)
    rover.begin()
    assert rover.tilts() == {Anomaly.NOSE_UP}


@pytest.mark.parametrize("true_turn_deg", [0.0, 90.0, 180.0, 240.0])
def test_while_the_heading_is_reckoned_a_hillside_may_rise_to_any_side(true_turn_deg: float) -> None:
    rover = Hillside(16.0)
    rover.begin()
    while Condition.HEADING_RECKONED not in rover.step(ARC, heading_deg=0.0).conditions:  # frozen
        assert rover.t_s < 10.0
    rover.true_deg = true_turn_deg
    assert rover.tilts(20, heading_deg=0.0) == set()
    rover.true_deg, rover.nose_deg = 0.0, 16.0
    assert rover.tilts(20, heading_deg=0.0) == {Anomaly.NOSE_UP}


def test_after_a_metre_without_sight_a_hillside_may_rise_to_any_side_until_ground_is_seen_for_some_metres() -> None:
    rover = Hillside(16.0)
    rover.begin()
    rover.sees_ground = False
    rover.go(1.5)
    rover.nose_deg = -32.0
    assert rover.tilts() == set()
    rover.nose_deg, rover.sees_ground = 0.0, True
    rover.go(2.0 * LEARN_M)
    rover.nose_deg = -32.0
    assert rover.tilts() == {Anomaly.NOSE_DOWN}


def test_noise_on_level_ground_leaves_it_level() -> None:
    ground, noise = GroundSlope(), Random(1)
    for n in range(5000):
        t_s = n * 0.05
        reading = CompassReading(t_s, n % 360, noise.gauss(0.0, 3.0), noise.gauss(0.0, 3.0), None)
        ground.update(reading, moved(0.02, 0.02), 0.02, moves=True, heading_known=True)
        assert ground.flat
        assert ground.towards_deg(reading.heading_deg) == (0.0, 0.0, 0.0, 0.0)


@given(st.lists(st.tuples(BEARINGS, st.floats(-180.0, 180.0), st.floats(-180.0, 180.0)), max_size=60))
def test_estimate_is_bounded_and_changes_by_five_degrees_a_metre_at_most(
    attitudes: list[tuple[float, float, float]],
) -> None:
    ground = GroundSlope()
    ground.begin(CompassReading(0.0, 0.0, LEVEL_DEG, 0.0, None))
    for heading_deg, pitch_deg, roll_deg in attitudes:
        before_deg = ground.towards_deg(0.0)
        reading = CompassReading(0.0, heading_deg, pitch_deg, roll_deg, None)
        ground.update(reading, moved(0.1, 0.1), 0.1, moves=True, heading_known=True)
        after_deg = ground.towards_deg(0.0)
        assert max(after_deg) <= SLOPE_MAX_DEG + 1e-9
        if ground.flat or not any(before_deg):
            continue  # what counts as level jumps by LEVEL_DEG
        assert max(abs(a - b) for a, b in zip(after_deg, before_deg, strict=True)) <= 0.5 + 1e-9
