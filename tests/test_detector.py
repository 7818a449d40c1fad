"""Each anomaly and each condition, present and absent."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import Any

import pytest

from wayfarer.conditions import Condition
from wayfarer.detector import ALL_WELL, Detection, Detector, DetectorSettings
from wayfarer.escape.api import Anomaly
from wayfarer.hal import STOP, CompassReading, ContactReading, MotionReading, Side, WheelCommand
from wayfarer.latest import Snapshot

MAX_SPEED_M_S = 1.0
TICK_S = 0.0625  # binary, so that times are exact
SETTINGS = DetectorSettings(
    immobilised_s=0.25, tilt_s=0.25, compass_stale_s=0.25, motion_stale_s=0.5, contact_stale_s=0.5, implausible_s=0.5
)
FULL = WheelCommand(1.0, 1.0)
BACK = WheelCommand(-1.0, -1.0)
PIVOT = WheelCommand(1.0, -1.0)
STEP_M = MAX_SPEED_M_S * TICK_S


class Rover:
    """Feeds a detector; all sensors speak each tick and say that all is well unless told otherwise."""

    def __init__(self, settings: DetectorSettings = SETTINGS, **watches: bool) -> None:
        self.detector = Detector(settings, MAX_SPEED_M_S, **watches)
        self.t_s = 0.0
        self.contact: ContactReading | None = None

    def tick(
        self,
        applied: WheelCommand = STOP,
        moved_m: float | None = 0.0,
        *,
        compass: bool = True,
        quality: float = 1.0,
        signed: bool = True,
        **tilt: Any,
    ) -> Detection:
        """One tick; ``moved_m`` None and ``compass`` False mean that the sensor is silent."""
        self.t_s += TICK_S
        reading = CompassReading(self.t_s, 0.0, 0.0, 0.0, None)._replace(**tilt) if compass else self.detector.compass
        motion = MotionReading(self.t_s, moved_m, 0.0, quality, signed) if moved_m is not None else None
        return self.detector.update(Snapshot(self.t_s, reading, motion, self.contact), applied)

    def drive(self, ticks: int, applied: WheelCommand = FULL, moved_m: float = 0.0) -> list[bool]:
        """Tick and tell for each whether the rover is called immobilised."""
        return [Anomaly.IMMOBILISED in self.tick(applied, moved_m).anomalies for _ in range(ticks)]


def started(settings: DetectorSettings = SETTINGS, **watches: bool) -> Rover:
    rover = Rover(settings, **watches)
    assert rover.tick() == ALL_WELL
    return rover


# -- immobilised -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wheels", [FULL, BACK])
def test_stall_is_found_after_the_window_and_not_a_tick_earlier(wheels: WheelCommand) -> None:
    assert started().drive(6, wheels) == [False, False, False, True, True, True]


@pytest.mark.parametrize(("wheels", "way"), [(FULL, 1.0), (BACK, -1.0)])
def test_moving_rover_is_not_stalled(wheels: WheelCommand, way: float) -> None:
    assert not any(started().drive(40, wheels, moved_m=way * STEP_M))


@pytest.mark.parametrize(("share", "stalled"), [(0.28, True), (0.32, False)])
def test_stall_means_less_than_a_share_of_what_was_commanded(share: float, stalled: bool) -> None:
    assert started().drive(10, moved_m=share * STEP_M)[-1] is stalled


@pytest.mark.parametrize(("wheels", "way"), [(FULL, -1.0), (BACK, 1.0)])
def test_rolling_the_other_way_is_a_stall(wheels: WheelCommand, way: float) -> None:
    assert started().drive(6, wheels, moved_m=way * STEP_M)[-1]


def test_noise_that_sums_to_zero_does_not_hide_a_stall() -> None:
    rover = started()
    noise = [rover.tick(FULL, moved_m=STEP_M * sign).anomalies for sign in [1, -1, 1, -1, 1, -1]]
    assert noise[-1] == (Anomaly.IMMOBILISED,)


def test_one_zero_sample_does_not_fake_a_stall() -> None:
    rover = started()
    found = [rover.tick(FULL, 0.0 if n % 4 == 3 else STEP_M).anomalies for n in range(40)]
    assert found == [()] * 40


def test_stall_ends_when_the_rover_moves() -> None:
    rover = started()
    assert rover.drive(8)[-1]
    assert not rover.drive(4, moved_m=STEP_M)[-1]


@pytest.mark.parametrize("wheels", [STOP, PIVOT, WheelCommand(0.05, 0.05)], ids=["stopped", "pivoting", "creeping"])
def test_nothing_is_claimed_while_little_motion_is_commanded(wheels: WheelCommand) -> None:
    assert not any(started().drive(20, wheels))


def test_pivot_forgets_what_was_before() -> None:
    rover = started()
    assert rover.drive(3) == [False] * 3
    assert rover.drive(1, PIVOT) == [False]
    assert rover.drive(4) == [False, False, False, True]


def test_change_of_direction_needs_a_whole_new_window() -> None:
    rover = started()
    assert rover.drive(8)[-1]
    assert rover.drive(4, BACK) == [False, False, False, True]


@pytest.mark.parametrize(("quality", "claims"), [(0.0, False), (0.19, False), (0.2, True), (1.0, True)])
def test_low_quality_means_unknown_never_still(quality: float, claims: bool) -> None:
    rover = started()
    found = {Anomaly.IMMOBILISED in rover.tick(FULL, 0.0, quality=quality).anomalies for _ in range(12)}
    assert (True in found) is claims


def test_one_doubtful_sample_forgets_the_window() -> None:
    rover = started()
    rover.drive(3)
    rover.tick(FULL, quality=0.1)
    assert rover.drive(4) == [False, False, False, True]


def test_slow_motion_sensor_loses_no_commanded_distance() -> None:
    """The sensor speaks each third tick: what was commanded in between counts."""
    rover = started()
    found = [rover.tick(FULL, 3 * STEP_M if n % 3 == 2 else None).anomalies for n in range(30)]
    assert found == [()] * 30
    stalled = [rover.tick(FULL, 0.0 if n % 3 == 2 else None).anomalies for n in range(12)]
    assert stalled[-1] == (Anomaly.IMMOBILISED,)


@pytest.mark.parametrize("wheels", [FULL, BACK])
def test_sense_without_a_direction_tells_a_moving_rover_from_a_stuck_one_both_ways(wheels: WheelCommand) -> None:
    """A forward-looking camera sees that it moves, not which way: its metres are magnitudes."""
    moving, stuck = started(), started()
    for _ in range(20):
        assert moving.tick(wheels, STEP_M, signed=False) == ALL_WELL
        found = stuck.tick(wheels, 0.0, signed=False)
    assert found.anomalies == (Anomaly.IMMOBILISED,)


# -- tilt --------------------------------------------------------------------------------------------------------

TILTS = [
    ("pitch_deg", 1, Anomaly.NOSE_UP),
    ("pitch_deg", -1, Anomaly.NOSE_DOWN),
    ("roll_deg", 1, Anomaly.RIGHT_DOWN),
    ("roll_deg", -1, Anomaly.LEFT_DOWN),
]


def angle(axis: str, angle_deg: float) -> dict[str, Any]:
    return {axis: angle_deg}


@pytest.mark.parametrize(("axis", "sign", "anomaly"), TILTS)
def test_tilt_counts_once_it_has_lasted(axis: str, sign: int, anomaly: Anomaly) -> None:
    rover = started()
    found = [rover.tick(**angle(axis, sign * 20.0)).anomalies for _ in range(6)]
    assert found == [(), (), (), (), (anomaly,), (anomaly,)]
    assert rover.tick().anomalies == ()


@pytest.mark.parametrize(("axis", "sign", "_anomaly"), TILTS)
def test_tilt_below_the_limit_is_rough_ground(axis: str, sign: int, _anomaly: Anomaly) -> None:
    rover = started()
    assert {rover.tick(**angle(axis, sign * 19.9)) for _ in range(20)} == {ALL_WELL}


def test_tilt_must_last_without_a_gap() -> None:
    rover = started()
    assert {rover.tick(pitch_deg=25.0 if n % 4 else 0.0) for n in range(40)} == {ALL_WELL}


def test_each_tilt_persists_by_itself() -> None:
    rover = started()
    assert {rover.tick(pitch_deg=25.0 * (-1) ** n) for n in range(20)} == {ALL_WELL}


def test_both_axes_can_be_wrong_at_once() -> None:
    rover = started()
    for _ in range(5):
        detection = rover.tick(pitch_deg=-30.0, roll_deg=-30.0)
    assert set(detection.anomalies) == {Anomaly.NOSE_DOWN, Anomaly.LEFT_DOWN}


@pytest.mark.parametrize(("axis", "sign", "_anomaly"), TILTS)
@pytest.mark.parametrize(("angle_deg", "over"), [(59.9, False), (60.0, True), (180.0, True)])
def test_overturned_acts_at_once(axis: str, sign: int, _anomaly: Anomaly, angle_deg: float, over: bool) -> None:
    conditions = started().tick(**angle(axis, sign * angle_deg)).conditions
    assert (Condition.OVERTURNED in conditions) is over


# -- compass -----------------------------------------------------------------------------------------------------


def test_compass_goes_stale_and_then_lost_and_comes_back() -> None:
    rover = started()
    found = [rover.tick(compass=False).conditions for _ in range(90)]
    assert found[:4] == [()] * 4
    assert set(found[4:80]) == {(Condition.COMPASS_STALE,)}
    assert set(found[80:]) == {(Condition.COMPASS_LOST,)}
    assert rover.tick() == ALL_WELL


def test_compass_that_never_spoke_is_stale_from_the_start() -> None:
    rover = Rover()
    assert rover.tick(compass=False).conditions == (Condition.COMPASS_STALE,)
    assert [rover.tick(compass=False) for _ in range(81)][-1].conditions == (Condition.COMPASS_LOST,)


def test_possible_turn_is_believed() -> None:
    rover = started()
    for heading_deg in (40.0, 80.0, 20.0, 325.0):
        assert rover.tick(heading_deg=heading_deg) == ALL_WELL
        assert rover.detector.compass is not None
        assert rover.detector.compass.heading_deg == heading_deg


SLOW_TO_TURN = replace(SETTINGS, heading_rate_max_deg_s=30.0)


def test_impossible_heading_never_reaches_a_decision() -> None:
    rover = started(SLOW_TO_TURN)
    rover.tick(heading_deg=180.0)
    assert rover.detector.compass is not None
    assert rover.detector.compass.heading_deg == 0.0
    assert rover.tick(heading_deg=1.0) == ALL_WELL
    assert rover.detector.compass.heading_deg == 1.0


def test_heading_that_insists_is_believed_after_a_stop() -> None:
    rover = started(SLOW_TO_TURN)
    found = [rover.tick(heading_deg=180.0).conditions for _ in range(10)]
    assert Condition.COMPASS_IMPLAUSIBLE not in {each for conditions in found[:8] for each in conditions}
    assert found[4:8] == [(Condition.COMPASS_STALE,)] * 4, "a rejected reading is no reading"
    assert found[8:] == [(Condition.COMPASS_IMPLAUSIBLE,), ()]
    assert rover.detector.compass is not None
    assert rover.detector.compass.heading_deg == 180.0


def test_impossible_readings_must_insist_without_a_gap() -> None:
    rover = started(SLOW_TO_TURN)
    for n in range(60):
        detection = rover.tick(heading_deg=180.0 if n % 4 else 0.0)
        assert detection == ALL_WELL
        assert rover.detector.compass is not None
        assert rover.detector.compass.heading_deg == 0.0


@pytest.mark.parametrize("jump_deg", [100.0, 180.0])
def test_shipped_thresholds_do_not_believe_a_jump_without_a_stop(jump_deg: float) -> None:
    """A compass that lies beside iron and stays there must hold the wheels before its heading is used."""
    rover = started(DetectorSettings())
    conditions = [rover.tick(heading_deg=jump_deg).conditions for _ in range(40)]
    assert (Condition.COMPASS_IMPLAUSIBLE,) in conditions


# -- motion sensor -----------------------------------------------------------------------------------------------


def test_silent_motion_sensor_is_stale_and_no_stall_is_claimed() -> None:
    rover = started()
    assert rover.drive(8)[-1]
    found = [rover.tick(FULL, moved_m=None) for _ in range(12)]
    assert [detection.conditions for detection in found[:8]] == [()] * 8
    assert {detection.conditions for detection in found[8:]} == {(Condition.MOTION_STALE,)}
    assert found[-1].anomalies == ()
    assert rover.tick().conditions == ()


def test_poor_motion_is_unknown_and_then_lost() -> None:
    rover = started()
    found = [rover.tick(quality=0.0).conditions for _ in range(170)]
    assert found[:16] == [()] * 16
    assert set(found[16:160]) == {(Condition.MOTION_UNKNOWN,)}
    assert set(found[160:]) == {(Condition.MOTION_LOST,)}
    assert rover.tick() == ALL_WELL


def test_rover_without_motion_sensor_does_not_miss_it() -> None:
    rover = started(watches_motion=False)
    assert {rover.tick(FULL, moved_m=None) for _ in range(100)} == {ALL_WELL}


@pytest.mark.parametrize(("speed_m_s", "implausible"), [(4.9, False), (5.1, True), (-5.1, True)])
def test_impossible_speed_is_implausible(speed_m_s: float, implausible: bool) -> None:
    conditions = started().tick(moved_m=speed_m_s * TICK_S).conditions
    assert (Condition.MOTION_IMPLAUSIBLE in conditions) is implausible


def test_impossible_speed_is_no_evidence_of_motion() -> None:
    rover = started()
    rover.drive(3)
    rover.tick(FULL, moved_m=9.0)
    assert rover.drive(4) == [False, False, False, True]


def test_first_reading_of_a_run_is_not_called_implausible() -> None:
    """It comes at the very time at which the run begins, with a count of noise."""
    detector = Detector(SETTINGS, MAX_SPEED_M_S)
    compass = CompassReading(0.0, 0.0, 0.0, 0.0, None)
    detector.update(Snapshot(0.0, None, None, None), STOP)
    detection = detector.update(Snapshot(TICK_S, compass, MotionReading(0.0, 0.0004, 0.0002, 0.8), None), STOP)
    assert Condition.MOTION_IMPLAUSIBLE not in detection.conditions


# -- contact -----------------------------------------------------------------------------------------------------


def touching(rover: Rover, *sides: Side) -> Detection:
    rover.contact = ContactReading(rover.t_s, sides, None)
    return rover.tick()


@pytest.mark.parametrize("side", Side)
def test_touch_counts_at_once_where_contact_is_watched(side: Side) -> None:
    rover = Rover(watches_contact=True)
    assert touching(rover) == ALL_WELL
    assert touching(rover, side).anomalies == (Anomaly.TOUCHED,)
    assert touching(rover).anomalies == ()


def test_touch_is_no_anomaly_where_motion_is_watched() -> None:
    assert touching(started(), Side.FRONT) == ALL_WELL


def test_touch_may_have_to_last() -> None:
    rover = Rover(replace(SETTINGS, touch_s=2 * TICK_S), watches_contact=True)
    assert [touching(rover, Side.LEFT).anomalies for _ in range(4)] == [(), (), *[(Anomaly.TOUCHED,)] * 2]


def test_silent_contact_sensor_is_stale_and_touches_nothing() -> None:
    rover = Rover(watches_contact=True)
    assert touching(rover, Side.FRONT).anomalies == (Anomaly.TOUCHED,)
    found = [rover.tick() for _ in range(12)]
    assert {detection.anomalies for detection in found[:7]} == {(Anomaly.TOUCHED,)}
    assert set(found[8:]) == {Detection((), (Condition.CONTACT_STALE,))}
    assert touching(rover) == ALL_WELL


def test_contact_sensor_that_never_spoke_is_stale() -> None:
    rover = Rover(watches_contact=True)
    found = [rover.tick().conditions for _ in range(12)]
    assert found[0] == ()
    assert found[-1] == (Condition.CONTACT_STALE,)


def test_contact_that_is_only_needed_is_no_anomaly_but_must_not_fall_silent() -> None:
    detector = Detector(SETTINGS, MAX_SPEED_M_S, watches_motion=False, needs_contact=True)
    compass = CompassReading(0.0, 0.0, 0.0, 0.0, None)
    touch = ContactReading(0.0, (Side.LEFT,), None)
    assert detector.update(Snapshot(0.0, compass, None, touch), STOP) == ALL_WELL
    late_s = SETTINGS.contact_stale_s + TICK_S
    late = detector.update(Snapshot(late_s, compass._replace(t_s=late_s), None, touch), STOP)
    assert late.conditions == (Condition.CONTACT_STALE,)


@pytest.mark.parametrize(
    "angles_deg", [(nan, 0.0, 0.0), (0.0, nan, 0.0), (0.0, 0.0, inf), (360.0, 0.0, 0.0), (0.0, -1e9, 0.0)]
)
def test_reading_that_no_compass_can_give_is_never_believed(angles_deg: tuple[float, float, float]) -> None:
    detector = Detector(SETTINGS, MAX_SPEED_M_S, watches_motion=False)
    for tick in range(100):
        reading = CompassReading(tick * TICK_S, *angles_deg, None)
        detection = detector.update(Snapshot(tick * TICK_S, reading, None, None), STOP)
        assert detector.compass is None
    assert detection.conditions == (Condition.COMPASS_LOST,)
