"""The wheels as witnesses: rims that stand, currents near that of a stall, who is believed, and what none sees."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import pytest

from tests.detector.rover import BACK, FULL, MAX_SPEED_M_S, PIVOT, SETTINGS, STEP_M, TICK_S, Rover, started
from wayfarer.detector.detector import DetectorTick
from wayfarer.escape.api import Anomaly
from wayfarer.hal import STOP, CompassReading, MotionReading, WheelCommand, WheelReading
from wayfarer.safety.conditions import Condition

STALL_A = 10.0
LONG = replace(SETTINGS, stall_current_a=STALL_A, blind_stride_m=12.0)  # no stride ends in these tests


class Wheeled(Rover):
    """A rover with a sensor of its wheels, and no motion sensor unless it is told of one."""

    def __init__(self, *witnesses: str, motion: bool = False) -> None:
        super().__init__(LONG, watches_motion=motion, has_wheels=True, witnesses=frozenset(witnesses))
        self.heading_now_deg = 0.0
        self.conditions: tuple[Condition, ...] = ()

    def turn_wheels(
        self,
        ticks: int,
        applied: WheelCommand = FULL,
        *,
        ways: tuple[float | None, float | None] | None = None,
        loads: tuple[float, float] | None = None,
        turned_deg: float = 0.0,
        moved_m: float | None = None,
    ) -> list[bool]:
        """Tick; ``ways`` are shares of what is commanded, ``loads`` of the stall current; None: not measured."""
        found = []
        for _ in range(ticks):
            self.t_s += TICK_S
            self.heading_now_deg = (self.heading_now_deg + turned_deg) % 360.0
            tick = DetectorTick(self.t_s, applied)
            tick.compass = CompassReading(self.t_s, self.heading_now_deg, self.t_s % 0.1, 0.0, None)
            if moved_m is not None:
                tick.motion = MotionReading(self.t_s, moved_m, self._noise_m(moved_m), 1.0)
            if ways is not None or loads is not None:
                left, right = ways or (None, None)
                tick.rims = WheelReading(
                    self.t_s,
                    None if left is None else left * applied.left * STEP_M,
                    None if right is None else right * applied.right * STEP_M,
                    *(load * STALL_A for load in loads or ()),
                )
                tick.duties = applied
            self.timer.measure(tick)
            self.detector.update(tick)
            self.conditions = tick.conditions
            found.append(Anomaly.IMMOBILISED in tick.anomalies)
        return found


def duty(share: float) -> WheelCommand:
    return WheelCommand(share, share)


TURNING, STANDING = (1.0, 1.0), (0.0, 0.0)


@pytest.mark.parametrize("applied", [FULL, BACK, duty(0.3)])
def test_rims_that_stand_are_a_stall_and_rims_that_turn_are_none(applied: WheelCommand) -> None:
    rover = Wheeled("wheels")
    assert not any(rover.turn_wheels(40, applied, ways=TURNING))
    stands = rover.turn_wheels(12, applied, ways=STANDING)
    assert stands.index(True) * TICK_S <= SETTINGS.immobilised_s + 2 * TICK_S
    assert stands[-1]


def test_side_that_stands_is_a_stall_however_fast_the_other_spins() -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(20, ways=TURNING)
    assert rover.turn_wheels(12, ways=(0.0, 1.5))[-1]


def test_wheels_that_nobody_asks_about_stall_nothing() -> None:
    assert not any(Wheeled("yaw").turn_wheels(40, ways=STANDING))


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_current_near_that_of_the_stall_at_this_duty_is_one(share: float, way: float) -> None:
    rover = Wheeled("current")
    assert not any(rover.turn_wheels(40, duty(way * share), loads=(0.3 * share,) * 2))
    assert rover.turn_wheels(20, duty(way * share), loads=(0.9 * share,) * 2)[-1]


def test_motors_that_start_or_are_reversed_may_draw_it() -> None:
    rover = Wheeled("current")
    rush = round(0.5 / TICK_S)
    for applied in (FULL, BACK, FULL):
        assert not any(rover.turn_wheels(rush, applied, loads=(1.0, 1.0)))
        assert not any(rover.turn_wheels(20, applied, loads=(0.1, 0.1)))


@pytest.mark.parametrize("applied", [PIVOT, WheelCommand(1.0, 0.2)])
def test_motors_in_a_sharp_turn_may_draw_it(applied: WheelCommand) -> None:
    assert not any(Wheeled("current").turn_wheels(60, applied, loads=(0.95, 0.95), turned_deg=4.0))


def test_rims_that_turn_are_believed_and_not_the_current() -> None:
    rover = Wheeled("wheels", "current")
    assert not any(rover.turn_wheels(40, ways=TURNING, loads=(0.9, 0.9)))
    assert rover.turn_wheels(20, ways=STANDING, loads=(0.9, 0.9))[-1]


def test_small_current_is_believed_and_not_an_encoder_without_its_wire() -> None:
    rover = Wheeled("wheels", "current")
    rover.turn_wheels(20, ways=TURNING, loads=(0.1, 0.1))
    assert not any(rover.turn_wheels(40, ways=STANDING, loads=(0.1, 0.1)))


@pytest.mark.parametrize("loads", [(0.0, 0.0), (0.0, 0.9)])
def test_current_that_is_not_measured_hides_no_stall(loads: tuple[float, float]) -> None:
    assert Wheeled("wheels", "current").turn_wheels(20, ways=STANDING, loads=loads)[-1]


def test_current_counts_while_the_encoders_say_nothing() -> None:
    assert Wheeled("wheels", "current").turn_wheels(40, loads=(0.9, 0.9))[-1]


def test_encoder_whose_side_turned_the_body_without_a_count_is_not_believed_until_it_counts() -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(10, PIVOT, ways=(0.0, 1.0), turned_deg=10.0)
    assert not any(rover.turn_wheels(20, ways=(0.0, 1.0)))
    rover.turn_wheels(1, ways=TURNING)
    assert rover.turn_wheels(20, ways=STANDING)[-1]


@pytest.mark.parametrize("value", [nan, inf, None])
def test_number_that_is_none_decides_as_the_none_that_a_log_has_for_it(value: float | None) -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(10, PIVOT, ways=(0.0, 1.0), turned_deg=10.0)
    rover.turn_wheels(1, ways=(value, value))
    assert not any(rover.turn_wheels(20, ways=STANDING))


def test_single_count_of_the_wrong_way_is_no_stall() -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(20, duty(0.1), ways=TURNING)
    assert not any(
        found
        for _ in range(3)
        for found in [
            *rover.turn_wheels(1, duty(0.1), ways=(-15.0, 1.0)),
            *rover.turn_wheels(20, duty(0.1), ways=TURNING),
        ]
    )


def test_who_sees_the_ground_pass_is_believed_and_not_the_wheels() -> None:
    rover = Wheeled("wheels", "current", motion=True)
    assert not any(rover.turn_wheels(40, ways=STANDING, loads=(0.9, 0.9), moved_m=STEP_M))
    assert rover.turn_wheels(20, ways=TURNING, loads=(0.1, 0.1), moved_m=0.0)[-1], "wheels that spin"


def test_wheels_that_are_not_believed_do_not_keep_it_from_learning_how_it_steers() -> None:
    """Ground that takes up all steering looks like a trunk in the dark, unless it was seen to pass before."""
    rover, steers = Wheeled("wheels", motion=True), WheelCommand(1.0, 0.6)
    rover.turn_wheels(60, steers, ways=STANDING, moved_m=STEP_M)
    assert not any(rover.turn_wheels(60, steers))


def test_wheels_count_while_the_motion_sensor_says_nothing() -> None:
    rover = Wheeled("wheels", motion=True)
    rover.turn_wheels(10, ways=TURNING, moved_m=STEP_M)
    assert rover.turn_wheels(12, ways=STANDING)[-1]


def test_rover_that_sees_no_slip_says_so_and_ends_its_strides() -> None:
    rover = Wheeled("wheels")
    ticks = round(12.0 / STEP_M) + 2
    assert sum(rover.turn_wheels(ticks, ways=TURNING)) == 1
    assert rover.conditions == (Condition.SLIP_UNSEEN,)
    sees = Wheeled("wheels", motion=True)
    assert not any(sees.turn_wheels(2 * ticks, ways=TURNING, moved_m=STEP_M))
    assert sees.conditions == ()


def test_stall_begins_a_stride() -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(round(10.0 / STEP_M), ways=TURNING)
    assert any(rover.turn_wheels(8, ways=STANDING))
    rover.turn_wheels(1, STOP, ways=STANDING)
    assert not any(rover.turn_wheels(round(10.0 / STEP_M), ways=TURNING))


@pytest.mark.parametrize(("turns", "covers"), [(1.0, 1.0), (0.5, 0.5), (3.0, 1.0), (0.0, 0.0)])
def test_rims_measure_the_way_but_never_more_than_was_commanded(turns: float, covers: float) -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(4, STOP, ways=STANDING)
    rover.turn_wheels(16, duty(0.5), ways=(turns, turns))
    assert rover.detector.odometer.covered_m == pytest.approx(16 * 0.5 * STEP_M * covers)


def test_silent_wheels_are_stale_and_hide_no_stall() -> None:
    rover = Wheeled("wheels", motion=True)
    rover.turn_wheels(10, ways=TURNING, moved_m=STEP_M)
    assert any(rover.turn_wheels(12, moved_m=0.0))
    assert Condition.WHEELS_STALE in rover.conditions
    rover.turn_wheels(1, STOP, ways=STANDING, moved_m=0.0)
    assert Condition.WHEELS_STALE not in rover.conditions


def test_silent_wheels_leave_the_way_to_the_commands() -> None:
    rover = Wheeled("wheels")
    rover.turn_wheels(32, duty(0.5))
    assert rover.detector.odometer.covered_m == pytest.approx(32 * 0.5 * STEP_M, rel=0.1)


def test_rover_that_goes_by_other_senses_misses_no_wheels() -> None:
    rover = started(watches_motion=False, has_wheels=True)
    assert [rover.tick(moved_m=None).conditions for _ in range(40)] == [()] * 40


@pytest.mark.parametrize("value", [nan, inf, -inf, 1e300, -5.0])
def test_ways_and_currents_that_cannot_be_are_not_known(value: float) -> None:
    rover = Wheeled("wheels", "current")
    rover.turn_wheels(10, ways=TURNING, loads=(0.1, 0.1))
    assert not any(rover.turn_wheels(40, ways=(value, value), loads=(value, value)))
    assert rover.detector.odometer.covered_m < 60 * MAX_SPEED_M_S * TICK_S
    assert rover.turn_wheels(20, ways=STANDING, loads=(0.9, 0.9))[-1]
