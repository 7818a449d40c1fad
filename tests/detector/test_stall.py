"""Commanded driving that moves nothing, and what only looks like it."""

from __future__ import annotations

from math import degrees
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import ALL_WELL, BACK, FULL, PIVOT, SETTINGS, STEP_M, TICK_S, VEHICLE, Rover, moved, started
from wayfarer.config.rover_file import load_rover
from wayfarer.detector import StallMonitor
from wayfarer.escape.api import Anomaly
from wayfarer.hal import STOP, WheelCommand


@pytest.mark.parametrize("wheels", [FULL, BACK])
def test_stall_is_found_after_the_window_and_not_a_tick_earlier(wheels: WheelCommand) -> None:
    assert started().drive(6, wheels) == [False, False, False, True, True, True]


@pytest.mark.parametrize(("wheels", "way"), [(FULL, 1.0), (BACK, -1.0)])
def test_moving_rover_is_not_stalled(wheels: WheelCommand, way: float) -> None:
    assert not any(started().drive(40, wheels, moved_m=way * STEP_M))


def test_body_that_is_held_ahead_and_swings_as_its_wheels_lead_is_stalled() -> None:
    """Its wheels lead by 0.2 m/s about the middle, half a track away: 46 degrees per second, none of it ahead."""
    rover, arc, swing_deg = started(), WheelCommand(0.6, 0.2), degrees(0.2 / (VEHICLE.track_m / 2)) * TICK_S
    found = [rover.drive(1, arc, heading_deg=n * swing_deg)[0] for n in range(1, 9)]
    assert found[-1]


@pytest.mark.parametrize(("share", "stalled"), [(0.28, True), (0.32, False)])
def test_rover_that_leads_nowhere_moves_less_than_a_share_of_what_was_commanded(share: float, stalled: bool) -> None:
    """It slides along a trunk: it does not stand, but after two seconds it is held as well."""
    rover = started()
    rover.drive(40, moved_m=STEP_M)
    found = rover.drive(40, moved_m=share * STEP_M)
    assert not any(found[8:20]), "but for the moment at which it met the trunk"
    assert found[-1] is stalled


@pytest.mark.parametrize(("wheels", "way"), [(FULL, -1.0), (BACK, 1.0)])
def test_rolling_the_other_way_from_a_stand_is_a_stall(wheels: WheelCommand, way: float) -> None:
    assert any(started().drive(6, wheels, moved_m=way * STEP_M))


@pytest.mark.parametrize(("wheels", "way"), [(FULL, -1.0), (BACK, 1.0)])
def test_rover_that_still_rolls_the_other_way_is_a_stall_when_it_leads_nowhere(
    wheels: WheelCommand, way: float
) -> None:
    rover = started()
    rover.drive(20, WheelCommand(-wheels.left, -wheels.right), moved_m=way * STEP_M)
    found = rover.drive(80, wheels, moved_m=way * STEP_M)
    assert not any(found[:30])
    assert found[-1]


@pytest.mark.parametrize(("wheels", "way"), [(FULL, 1.0), (BACK, -1.0)])
def test_body_that_something_threw_back_a_moment_ago_is_not_stalled(wheels: WheelCommand, way: float) -> None:
    """It gains speed as slowly as the most slippery ground lets it, from the speed of its last reading."""
    rover = started()
    rover.drive(3, WheelCommand(-wheels.left, -wheels.right))
    rover.drive(1, WheelCommand(-wheels.left, -wheels.right), moved_m=-way * 0.6 * TICK_S)
    for tick in range(40):
        speed_m_s = SETTINGS.gain_m_s2 * (tick + 0.5) * TICK_S - 0.6
        assert rover.tick(wheels, way * speed_m_s * TICK_S).anomalies == ()


@given(
    gain_m_s2=st.floats(0.5, 8.0),
    from_m_s=st.floats(-1.0, 1.0),
    cruise_m_s=st.floats(0.15, 1.0),
    backwards=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_healthy_body_on_any_ground_is_never_stalled(
    gain_m_s2: float, from_m_s: float, cruise_m_s: float, backwards: bool, seed: int
) -> None:
    """From any speed either way, with the sensor's noise: it gains speed as the ground's grip allows."""
    rover, rng, speed_m_s = started(), Random(seed), from_m_s
    way, dt_s = -1.0 if backwards else 1.0, 0.1
    for _ in range(4):
        rover.tick(STOP, way * speed_m_s * dt_s, dt_s=dt_s)
    for n in range(50):
        then_m_s, speed_m_s = speed_m_s, min(cruise_m_s, speed_m_s + gain_m_s2 * dt_s)
        seen_m = way * (then_m_s + speed_m_s) / 2 * dt_s * rng.gauss(1.0, 0.03) + rng.gauss(0.0, 0.0004)
        wheels = WheelCommand(way * cruise_m_s, way * cruise_m_s)
        assert rover.tick(wheels, seen_m, dt_s=dt_s, heading_deg=n % 2).anomalies == ()


def test_body_that_gains_no_speed_from_a_stand_is_stalled() -> None:
    """The test above can fail."""
    assert started().drive(6, WheelCommand(0.15, 0.15), moved_m=0.0)[-1]


@pytest.mark.parametrize(
    ("rate_deg_s", "stalled"), [(160.0, False), (60.0, True)], ids=["it spins", "a trunk turns it"]
)
def test_body_that_spins_with_its_wheels_against_each_other_is_not_judged_by_its_speed(
    rate_deg_s: float, stalled: bool
) -> None:
    """What it had of speed ahead becomes sideways. A trunk turns a body that it holds, but not that fast."""
    rover = started()
    rover.drive(10, moved_m=STEP_M)
    found = [rover.tick(WheelCommand(1.0, 0.0), 0.0, heading_deg=n * rate_deg_s * TICK_S).anomalies for n in range(20)]
    assert ((Anomaly.IMMOBILISED,) in found) is stalled


@pytest.mark.parametrize(("straight", "stalled"), [(1.0, True), (0.4, False)])
def test_body_that_could_hardly_have_moved_yet_does_not_stand(straight: float, stalled: bool) -> None:
    """From a stand it gains 0.5 m/s2 with all of its grip: 16 mm in the window. While it turns it has less: 6 mm."""
    stall = StallMonitor(SETTINGS, VEHICLE)
    for _ in range(5):
        stall.add(moved(0.05, 0.0, 0.05, straight=straight))
    assert stall.found is stalled


def test_noise_that_sums_to_zero_does_not_hide_a_stall() -> None:
    rover = started()
    noise = [rover.tick(FULL, moved_m=STEP_M * sign).anomalies for sign in [1, -1, 1, -1, 1, -1]]
    assert noise[-1] == (Anomaly.IMMOBILISED,)


def test_one_zero_sample_does_not_fake_a_stall() -> None:
    rover = started()
    found = [rover.tick(FULL, 0.0 if n % 4 == 3 else STEP_M).anomalies for n in range(40)]
    assert found == [()] * 40


@pytest.mark.parametrize("wheels", [STOP, PIVOT, WheelCommand(0.05, 0.05)], ids=["stopped", "pivoting", "creeping"])
def test_nothing_is_claimed_while_little_motion_is_commanded(wheels: WheelCommand) -> None:
    assert not any(started().drive(20, wheels))


@pytest.mark.parametrize(
    ("legs", "found"),
    [
        ([(8, FULL, 0.0), (4, FULL, STEP_M)], [False]),
        ([(3, FULL, 0.0), (1, PIVOT, 0.0), (4, FULL, 0.0)], [False, False, False, True]),
        ([(8, FULL, 0.0), (4, BACK, 0.0)], [False, False, False, True]),
    ],
    ids=["it moves again", "a pivot", "the other way"],
)
def test_new_leg_needs_a_whole_new_window(legs: list[tuple[int, WheelCommand, float]], found: list[bool]) -> None:
    rover = started()
    said = [rover.drive(*leg) for leg in legs]
    assert said[0][-1] is (legs[0][0] == 8)
    assert said[-1][-len(found) :] == found


@pytest.mark.parametrize(("quality", "claims"), [(0.0, False), (0.19, False), (0.2, True), (1.0, True)])
def test_low_quality_means_unknown_never_still(quality: float, claims: bool) -> None:
    rover = started()
    found = {Anomaly.IMMOBILISED in rover.tick(FULL, 0.0, quality=quality).anomalies for _ in range(12)}
    assert (True in found) is claims


@pytest.mark.parametrize("unsure", [(1,), (2, 3), (1, 3)], ids=str)
def test_readings_that_are_unsure_do_not_clear_what_the_sure_ones_said(unsure: tuple[int, ...]) -> None:
    """Zeros, of which some of each four are unsure: the window grows until it has three that are sure."""
    rover = started()
    found = [rover.tick(FULL, quality=0.1 if n % 4 in unsure else 1.0).anomalies for n in range(16)]
    assert found[7] == (Anomaly.IMMOBILISED,)
    assert all(found[7:])


def test_readings_that_are_unsure_do_not_count_as_driven() -> None:
    """One sure reading in ten, spread over a longer time than a motor may be held, is too little for a stall."""
    rover = started()
    for n in range(60):
        assert rover.tick(FULL, quality=1.0 if n % 24 == 0 else 0.1).anomalies == () or n * STEP_M > 2.5


@pytest.mark.parametrize("every", [2, 3, 5])
def test_body_that_moves_is_not_stalled_by_unsure_zeros(every: int) -> None:
    rover = started()
    for n in range(80):
        moved_m, quality = (STEP_M, 1.0) if n % every == 0 else (0.0, 0.1)
        assert rover.tick(FULL, moved_m, quality=quality).anomalies == ()


GARBAGE_M = [0.03, 0.1, 0.24, 30.0]  # what a chip can see, what none can, what no rover goes, what nothing goes


@pytest.mark.parametrize("garbage_m", GARBAGE_M)
@pytest.mark.parametrize(
    ("name", "phase"), [(name, n) for name in ("sim", "forestrover", "minirover") for n in range(5)]
)
def test_stall_is_found_within_two_seconds_under_garbage_twice_a_second(
    name: str, phase: int, garbage_m: float
) -> None:
    """Fault catalogue, fault 16: the rover is stuck, and garbage goes on whenever it began."""
    config = load_rover(name)
    rover, dt_s = Rover(config.detector, config.vehicle), 1.0 / config.rates.motion_hz
    every, wheels = round(0.5 / dt_s), config.vehicle.mix(config.escape.cruise_m_s, 0.0)
    found = [
        Anomaly.IMMOBILISED
        in rover.tick(
            wheels, garbage_m if n % every == phase else 0.0, dt_s=dt_s, signed=name != "minirover", heading_deg=n % 2
        ).anomalies
        for n in range(round(2.0 / dt_s))
    ]
    assert any(found)


def test_rolling_on_after_slowing_down_is_motion() -> None:
    rover, slow = started(), WheelCommand(0.25, 0.25)
    rover.drive(4, moved_m=STEP_M)
    rolling = [rover.tick(slow, share * STEP_M).anomalies for share in (0.9, 0.5)]
    assert rolling == [(), ()]
    assert rover.drive(3) == [False, False, True]


@pytest.mark.parametrize("share", [0.35, 1.0, 3.0])
def test_garbage_and_readings_of_more_than_was_commanded_fake_no_stall(share: float) -> None:
    """A scale that is wrong, rolling on downhill, garbage of either sign in between: the rover moves."""
    rover, rng = started(), Random(1)
    for n in range(200):
        moved_m = rng.choice([-30.0, 30.0]) if n % 8 == 7 else share * STEP_M
        assert rover.tick(FULL, moved_m).anomalies == ()


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


@pytest.mark.parametrize("name", ["sim", "forestrover"])
@pytest.mark.parametrize("seed", range(20))
def test_stall_is_found_within_two_seconds_under_random_counts(name: str, seed: int) -> None:
    """Fault catalogue, fault 16: flow that jitters by up to 100 counts of 0.2 mm a reading, at 20 Hz."""
    config, rng = load_rover(name), Random(seed)
    rover = Rover(config.detector, config.vehicle)
    wheels = config.vehicle.mix(config.escape.cruise_m_s, 0.0)
    found = [
        Anomaly.IMMOBILISED
        in rover.tick(wheels, rng.randint(-100, 100) * 0.0002, dt_s=0.05, heading_deg=n % 2).anomalies
        for n in range(40)
    ]
    assert any(found)


def test_flow_that_saturates_is_not_motion_that_is_absent() -> None:
    """Fault catalogue, fault 17: 7.4 rad/s at 0.1 m above ground are 0.74 m/s, the rover goes at 1.4."""
    config = load_rover("forestrover")
    rover = Rover(config.detector, config.vehicle)
    rng = Random(1)
    for _ in range(200):
        moved_m = 0.74 * 0.05 * rng.gauss(1.0, 0.03)
        assert rover.tick(FULL, moved_m, dt_s=0.05, heading_deg=rng.choice([0.0, 0.1])) == ALL_WELL


def test_body_that_skates_sideways_does_not_stand() -> None:
    """Its speed ahead is gone, but the ground goes by; one under which it does not go by stands."""
    found = []
    for slid_m in (0.03, 0.0):
        stall = StallMonitor(SETTINGS, VEHICLE)
        for moved_m in (0.03, 0.03, 0.0, 0.0, 0.0, 0.0):
            stall.add(moved(0.05, moved_m, 0.1, slid_m=slid_m))
        found.append(stall.found)
    assert found == [False, True]
