"""Calibrating how a simulated rover turns and gains speed, in physics-light and in virtual time."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from itertools import pairwise
from math import degrees
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.rover import Flow, Rig, Script
from wayfarer.commissioning.calibrate import calibrate
from wayfarer.commissioning.calibrate.free_ground import Sample, rate_deg_s, speed_gain, turn_response
from wayfarer.commissioning.calibrate.turning import ARCS, table
from wayfarer.commissioning.manual_drive import RATE_HZ
from wayfarer.config.calibration_file import Calibration, FlowEntry, MotorsEntry, TurningEntry, TurnResponse, stamp
from wayfarer.config.factory import calibrated
from wayfarer.errors import NotResponding, WayfarerError

AS_TOLD_DEG_S = degrees(2.0 * 1.4 / 0.5)  # of the rig's world: full speed of both sides over the track


def take(rig: Rig, **answers: bool) -> tuple[TurningEntry | None, Script]:
    someone = Script(rig.world, answers)
    return rig.calibrate(someone, "turning").turning, someone


def measured(rig: Rig) -> TurningEntry:
    entry, _ = take(rig)
    assert entry is not None
    return entry


# -- what is measured ----------------------------------------------------------------------------------------------


def test_body_that_turns_as_told_has_no_dead_zone_and_its_own_track(rig: Rig) -> None:
    entry = measured(rig)
    for response in (entry.clockwise, entry.anticlockwise):
        assert response is not None
        assert response.from_duty < 0.02
        assert response.deg_s_per_duty == pytest.approx(AS_TOLD_DEG_S, rel=0.02)
    assert entry.arc is not None
    assert entry.arc.deg_s_per_duty == pytest.approx(AS_TOLD_DEG_S, rel=0.1)
    vehicle = calibrated(rig.config, Calibration(turning=entry)).vehicle
    assert vehicle.track_m == pytest.approx(0.5, rel=0.02)
    assert vehicle.turn_from_duty < 0.02


@pytest.mark.parametrize("dead_band", [0.18, 0.58])
def test_duty_below_which_the_wheels_do_not_turn_is_found_within_a_step(rig: Rig, dead_band: float) -> None:
    rig.world.set_faults(dead_band=dead_band)
    entry = measured(rig)
    assert entry.on_the_spot is not None
    assert dead_band - 0.05 - 1e-9 <= entry.on_the_spot.stood_at_duty < dead_band
    assert entry.on_the_spot.from_duty < 0.05, "once they turn, they turn in full: the line begins lower"
    assert entry.on_the_spot.deg_s_per_duty == pytest.approx(AS_TOLD_DEG_S, rel=0.05)


def test_speed_is_gained_in_the_time_of_the_motors(rig: Rig) -> None:
    entry = measured(rig)
    assert entry.speed is not None
    assert entry.speed.speed_m_s == pytest.approx(1.0, rel=0.02)
    # A first-order lag of 0.1 s is behind by 0.1 s, as is a body that gains its speed evenly in 0.2 s; the gate takes
    # two ticks to let the duty grow, so it is behind by about one more, and a world's step is as long as a tick.
    assert entry.speed.takes_s == pytest.approx(0.2 + 0.1, abs=0.1)
    assert entry.speed.gain_m_s2 == pytest.approx(entry.speed.speed_m_s / entry.speed.takes_s)


def test_motion_sensor_is_scaled_as_calibrated_if_it_is_the_same(tmp_path: Path) -> None:
    speeds_m_s = []
    for part in (Flow.name, "another"):
        rig = Rig(tmp_path)
        rig.keep(flow=FlowEntry(**stamp(part, 1.0), scale=2.0))
        speed = measured(rig).speed
        assert speed is not None
        speeds_m_s.append(speed.speed_m_s)
    assert speeds_m_s == pytest.approx([2.0, 1.0], rel=0.02)


@pytest.mark.parametrize("blind", ["none", "dark", "held"])
def test_without_a_sight_of_the_ground_turning_is_measured_and_speed_is_not(rig: Rig, blind: str) -> None:
    if blind == "none":
        rig.rover = replace(rig.rover, motion=None)
    elif blind == "dark":
        rig.motion.quality = 0.1
    else:
        rig.motion.on_blocks = True
    entry, someone = take(rig)
    assert entry is not None
    assert entry.speed is None
    assert entry.on_the_spot is not None
    assert any("Gaining speed was not measured" in text for text in someone.told)


def test_field_of_the_motors_is_not_taken_for_a_turn(rig: Rig) -> None:
    rig.world.set_faults(snagged=True)
    rig.compass.bias_deg = lambda: 10.0 * rig.world.commanded[0]
    entry = measured(rig)
    assert (entry.clockwise, entry.anticlockwise, entry.arc) == (None, None, None)


def test_rover_that_cannot_turn_is_told_what_to_do_and_left_as_its_file_says(rig: Rig) -> None:
    rig.world.set_faults(snagged=True)
    entry, someone = take(rig)
    assert entry is not None
    assert any("lighter" in text and "duty_max" in text for text in someone.told)
    assert calibrated(rig.config, Calibration(turning=entry)) == rig.config


def test_uneven_sides_are_told(rig: Rig) -> None:
    def told(one: float, other: float) -> bool:
        ways = [TurnResponse(stood_at_duty=0.3, from_duty=0.3, deg_s_per_duty=rate) for rate in (one, other)]
        entry = TurningEntry(
            **stamp("p", 1.0), ground="", duty_max=1.0, clockwise=ways[0], anticlockwise=ways[1], arc=None, speed=None
        )
        return any("less easily in one direction" in line for line in table(entry, rig.config))

    assert told(250.0, 180.0)
    assert told(180.0, 250.0)
    assert not told(250.0, 230.0)


def test_wheels_get_no_more_than_the_rover_file_allows_and_grow_as_in_a_mission(rig: Rig) -> None:
    rig.set(safety={"duty_max": 0.8, "slew_per_s": 4.0})
    entry = measured(rig)
    assert entry.duty_max == 0.8
    assert rig.world.most <= 0.8
    for before, after in pairwise(rig.motors.commands):
        for one, next_one in zip(before, after, strict=True):
            grown = abs(next_one) - (abs(one) if one * next_one > 0.0 else 0.0)
            assert grown <= 4.0 / RATE_HZ + 1e-9


def test_rover_that_cruises_at_its_highest_duty_has_no_arc(rig: Rig) -> None:
    rig.set(safety={"duty_max": 0.7})  # 1 m/s is a duty of 0.71
    entry = measured(rig)
    assert entry.arc is None
    assert rig.world.most <= 0.7


def test_needed_room_is_told_and_kept(rig: Rig) -> None:
    start, furthest_m = (rig.world.x_m, rig.world.y_m), [0.0]
    rig.world.after_step = lambda world: furthest_m.append(
        max(furthest_m.pop(), abs(world.x_m - start[0]), abs(world.y_m - start[1]))
    )
    _, someone = take(rig)
    assert any("within 4 m" in text for text in someone.told)
    assert 1.5 < furthest_m[0] < 4.0


# -- what is kept --------------------------------------------------------------------------------------------------


def test_result_is_kept_with_date_part_and_ground_and_leaves_the_rest(rig: Rig) -> None:
    old = MotorsEntry(**stamp("motors", 1.0), shift_half_deg=1.0, shift_full_deg=2.0, passed=True)
    rig.keep(motors=old)
    entry = measured(rig)
    assert (entry.date, entry.part, entry.ground) == ("2026-11-18", rig.motors.name, "short grass")
    assert rig.kept == Calibration(motors=old, turning=entry)


def test_long_note_is_cut(rig: Rig) -> None:
    someone = Script(rig.world, {})
    someone.noted = "  mud " + "x" * 200
    found = rig.calibrate(someone, "turning").turning
    assert found is not None
    assert found.ground.startswith("mud x")
    assert rig.kept.turning == found


# -- safety --------------------------------------------------------------------------------------------------------


def test_no_wheel_turns_without_a_yes(rig: Rig) -> None:
    entry, _ = take(rig, **{"free, level ground": False})
    assert entry is None
    assert rig.world.most == 0.0
    assert not rig.host.calibration_file.exists()


@pytest.mark.parametrize(("deadman_s", "tells", "why"), [(None, True, "by itself"), (0.25, False, "nobody has seen")])
def test_board_that_may_not_stop_the_wheels_by_itself_drives_no_rover_on_the_ground(
    rig: Rig, deadman_s: float | None, tells: bool, why: str
) -> None:
    rig.motors.deadman_s, rig.motors.tells = deadman_s, tells
    with pytest.raises(WayfarerError, match=why):
        take(rig)
    assert rig.world.most == 0.0


def test_wheels_are_stopped_after_each_drive(rig: Rig) -> None:
    measured(rig)
    drives = 2 + 2 * ARCS + 2  # on the spot both ways, each arc and the straight line there and back
    assert rig.motors.halts >= drives


def test_rover_that_tilts_is_stopped(rig: Rig) -> None:
    async def soon() -> None:
        asyncio.get_running_loop().call_later(5.0, setattr, rig.compass, "tilt_deg", 30.0)

    asked = Script(rig.world, {}, {"free, level ground": soon})
    with pytest.raises(WayfarerError, match="tilts by 30°"):
        rig.calibrate(asked, "turning")
    assert not rig.host.calibration_file.exists()


def test_rover_that_turns_the_other_way_is_stopped_at_once(rig: Rig) -> None:
    rig.world.set_faults(left_gain=-1.0, right_gain=-1.0)
    with pytest.raises(WayfarerError, match="opposite to its command"):
        take(rig)
    assert rig.world.most < 0.2


@pytest.mark.parametrize("at", [1, 300, 900, 1200])
def test_motors_that_fail_in_the_middle_are_stopped_and_nothing_is_kept(rig: Rig, at: int) -> None:
    rig.motors.fails_at = at
    with pytest.raises(NotResponding):
        take(rig)
    assert not rig.host.calibration_file.exists()


@pytest.mark.parametrize("after_s", [0.5, 15.0, 40.0, 77.0])
def test_cancelled_calibration_stops_the_motors(rig: Rig, after_s: float) -> None:
    rig.cancel(calibrate(rig.config, rig.rover, rig.host, Script(rig.world, {}), ["turning"]), after_s)
    assert rig.world.most > 0.0


# -- the lines -----------------------------------------------------------------------------------------------------


def drive(rate_deg_s: float, gain_m_s2: float = 1.0, top_m_s: float = 1.0, for_s: float = 3.0) -> list[Sample]:
    """Samples of an even turn, and of an even gain of speed up to a top speed, from the first command on."""
    samples = []
    for tick in range(1, round(for_s * RATE_HZ) + 1):
        t_s = tick / RATE_HZ
        gains_s = min(t_s, top_m_s / gain_m_s2)
        ahead_m = gain_m_s2 * gains_s**2 / 2.0 + top_m_s * (t_s - gains_s)
        samples.append(Sample(100.0 + t_s, rate_deg_s * t_s, ahead_m, seen=True))
    return samples


@given(rate=st.floats(-400.0, 400.0))
def test_rate_is_the_slope_of_the_heading(rate: float) -> None:
    assert rate_deg_s(drive(rate, for_s=0.6)) == pytest.approx(rate, abs=1e-6)


@given(from_duty=st.floats(0.0, 0.8), slope=st.floats(100.0, 1000.0))
def test_line_beyond_the_dead_zone_is_found(from_duty: float, slope: float) -> None:
    points = [(step / 20, max(0.0, slope * (step / 20 - from_duty))) for step in range(1, 21)]
    response = turn_response(points)
    assert response is not None
    assert response.from_duty == pytest.approx(from_duty, abs=1e-6)
    assert response.deg_s_per_duty == pytest.approx(slope)


def test_one_step_that_seemed_to_turn_below_the_dead_zone_is_left_out() -> None:
    points = [(step / 20, max(0.0, 200.0 * (step / 20 - 0.5))) for step in range(1, 21)]
    points[2] = (0.15, 9.0)
    response = turn_response(points)
    assert response is not None
    assert response.from_duty == pytest.approx(0.5)


@given(rates=st.lists(st.floats(-1000.0, 1000.0), min_size=1, max_size=20))
def test_whatever_is_measured_can_be_kept(rates: list[float]) -> None:
    response = turn_response([((step + 1) / len(rates), rate) for step, rate in enumerate(rates)])
    if response is not None:
        assert 0.0 <= response.from_duty < 1.0
        assert response.deg_s_per_duty >= 2.0


@given(gain=st.floats(0.3, 10.0), top=st.floats(0.2, 1.4))
def test_even_gain_of_speed_is_found_even_where_the_top_is_not_reached(gain: float, top: float) -> None:
    found = speed_gain(drive(0.0, gain, top), commanded_m_s=top)
    if top / gain <= 2.0:
        assert found is not None
        assert found.speed_m_s == pytest.approx(top)
        assert found.takes_s == pytest.approx(max(top / gain, 1.0 / RATE_HZ), rel=0.01)
    elif top / gain >= 3.0:
        assert found is not None
        assert found.gain_m_s2 == pytest.approx(gain, rel=0.05)


def test_no_gain_is_found_where_the_ground_was_not_seen_or_did_not_move() -> None:
    seen = drive(0.0)
    assert speed_gain([each._replace(seen=n % 5 > 0) for n, each in enumerate(seen)], 1.0) is None
    assert speed_gain([each._replace(ahead_m=0.01 * each.ahead_m) for each in seen], 1.0) is None
