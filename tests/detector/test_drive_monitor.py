"""Wheels that do not turn the rover as they are told to: a dead, weak or reversed side, and what only looks like it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import degrees, exp, hypot
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import BACK, FULL, PIVOT, SETTINGS, VEHICLE, Rover, started
from wayfarer.angles import wrap360
from wayfarer.escape.api import Anomaly
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition

PERIOD_S = 0.05
DEG_S = degrees(VEHICLE.max_speed_m_s / VEHICLE.track_m)  # of one side at full duty
HEALTHY, DEAD_LEFT, DEAD_RIGHT, REVERSED_LEFT, MIXED_UP = (1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (-1.0, -1.0)
CURVE = WheelCommand(1.0, 0.6)


class Chassis:
    """A rover whose sides turn ``gains`` times as fast as they are told to; its heading follows, ``lag_s`` late."""

    def __init__(self, gains: tuple[float, float], lag_s: float = 0.1, noise_deg: float = 0.0, seed: int = 0) -> None:
        self.rover = started()
        self.gains = gains
        self._keeps = exp(-PERIOD_S / lag_s)
        self._noise_deg, self._chance = noise_deg, Random(seed)
        self.blind = False  # its motion sensor is silent
        self._left = self._right = self.heading_deg = 0.0

    def tick(self, wheels: WheelCommand, *, blocked: bool = False) -> tuple[Condition, ...]:
        """Drive for a period and return the conditions; a blocked rover moves nowhere."""
        self._left = wheels.left * self.gains[0] + (self._left - wheels.left * self.gains[0]) * self._keeps
        self._right = wheels.right * self.gains[1] + (self._right - wheels.right * self.gains[1]) * self._keeps
        moved_m = 0.0
        if not blocked:
            self.heading_deg += (self._left - self._right) * DEG_S * PERIOD_S
            moved_m = (self._left + self._right) / 2 * PERIOD_S
        read_deg = wrap360(self.heading_deg + self._chance.gauss(0.0, self._noise_deg))
        seen_m = None if self.blind else moved_m
        return self.rover.tick(wheels, seen_m, dt_s=PERIOD_S, heading_deg=read_deg).conditions

    def drive(self, for_s: float, wheels: WheelCommand, *, blocked: bool = False) -> list[Condition | None]:
        """Return for each tick what is said of the drive."""
        return [drive_of(self.tick(wheels, blocked=blocked)) for _ in range(round(for_s / PERIOD_S))]


def drive_of(conditions: Iterable[Condition]) -> Condition | None:
    """What is said of the drive, if anything."""
    told = [each for each in conditions if each in (Condition.DRIVE_ASYMMETRY, Condition.DRIVE_FAILED)]
    assert len(told) <= 1
    return told[0] if told else None


def first_s(found: list[Condition | None], condition: Condition) -> float:
    """When a condition first came, in seconds."""
    return (found.index(condition) + 1) * PERIOD_S


@pytest.mark.parametrize("gains", [DEAD_LEFT, DEAD_RIGHT, REVERSED_LEFT])
@pytest.mark.parametrize("wheels", [FULL, BACK, CURVE])
def test_side_that_does_not_turn_is_noticed_within_two_seconds_of_driving(
    gains: tuple[float, float], wheels: WheelCommand
) -> None:
    chassis = Chassis(HEALTHY)
    assert set(chassis.drive(3.0, wheels)) == {None}
    chassis.gains = gains
    assert first_s(chassis.drive(3.0, wheels), Condition.DRIVE_ASYMMETRY) <= 2.0


def test_asymmetry_is_told_for_about_a_second_once_no_anomaly_has_followed() -> None:
    chassis = Chassis(DEAD_LEFT)
    found = chassis.drive(0.5, FULL) + chassis.drive(3.0, STOP)
    told_from = found.index(Condition.DRIVE_ASYMMETRY)
    assert PERIOD_S * told_from == pytest.approx(0.4 + SETTINGS.drive_confirm_s, abs=0.1)
    assert set(found[told_from : told_from + 20]) == {Condition.DRIVE_ASYMMETRY}
    assert set(found[told_from + 22 :]) == {None}


@pytest.mark.parametrize(("wheels", "told"), [(FULL, False), (WheelCommand(1.0, 0.1), True)])
def test_side_that_lags_just_before_an_anomaly_is_a_trunk_and_no_fault(wheels: WheelCommand, told: bool) -> None:
    """A trunk turns the rover that runs into it, and then holds it; or the side that lags is then driven alone."""
    chassis = Chassis(DEAD_LEFT)
    found = chassis.drive(0.4, FULL) + chassis.drive(1.0, wheels, blocked=True) + chassis.drive(3.0, STOP)
    assert set(found) == {None} | ({Condition.DRIVE_ASYMMETRY} if told else set())


def test_drive_that_turns_as_told_is_cleared_of_what_was_found_before() -> None:
    """A trunk now and then, and straight drives in between, in which a dead side would have shown."""
    chassis = Chassis(HEALTHY)
    for _ in range(5):
        assert Condition.DRIVE_FAILED not in jolt(chassis, DEAD_LEFT)
        chassis.gains = HEALTHY
        chassis.drive(1.5, FULL)


@pytest.mark.parametrize(
    ("gains", "slow"), [(DEAD_LEFT, WheelCommand(0.2, 0.12)), (DEAD_RIGHT, WheelCommand(0.12, 0.2))]
)
def test_drive_that_is_too_slow_to_show_a_dead_side_clears_none(gains: tuple[float, float], slow: WheelCommand) -> None:
    chassis, found = Chassis(gains), set()
    for _ in range(SETTINGS.drive_uneven_windows):
        found.update(chassis.drive(1.5, slow) + jolt(chassis, gains))
    assert Condition.DRIVE_FAILED in found


@pytest.mark.parametrize("late", ["turn", "move"])
def test_dead_side_of_a_body_that_the_ground_holds_for_a_moment_is_a_fault(late: str) -> None:
    """Half a second without the turn of a dead side shows nothing yet. One in which it turns but hardly moves does."""
    rover, heading_deg, found = started(), 0.0, set()
    for _ in range(SETTINGS.drive_uneven_windows):
        for tick in range(20):
            if tick >= 10 or late != "turn":
                heading_deg -= DEG_S * PERIOD_S
            moved_m = 0.0125 if tick >= 10 or late != "move" else 0.001 * tick
            said = rover.tick(FULL, 2 * moved_m, dt_s=PERIOD_S, heading_deg=wrap360(heading_deg))
            found.add(drive_of(said.conditions))
        for _ in range(40):
            found.add(drive_of(rover.tick(STOP, dt_s=PERIOD_S, heading_deg=wrap360(heading_deg)).conditions))
    assert Condition.DRIVE_FAILED in found


@pytest.mark.parametrize(("loss_m_s2", "fails"), [(0.0, True), (1.0, False)], ids=["driven", "it coasts"])
def test_body_that_drives_straight_on_in_a_turn_has_a_reversed_side_unless_it_gets_slower(
    loss_m_s2: float, fails: bool
) -> None:
    chassis = Chassis(REVERSED_LEFT)
    jolt(chassis, REVERSED_LEFT)
    found = set()
    for tick in range(20):
        moved_m, heading_deg = (1.0 - loss_m_s2 * tick * PERIOD_S) * PERIOD_S, wrap360(chassis.heading_deg)
        found.add(drive_of(chassis.rover.tick(PIVOT, moved_m, dt_s=PERIOD_S, heading_deg=heading_deg).conditions))
    assert (Condition.DRIVE_FAILED in found) is fails


@pytest.mark.parametrize("turn", [PIVOT, WheelCommand(-1.0, 1.0)])
@pytest.mark.parametrize(
    ("gains", "blind", "fails"), [((1.0, 0.95), False, False), (DEAD_LEFT, False, True), ((1.0, 0.95), True, True)]
)
def test_turn_on_the_spot_about_the_middle_clears_a_side_and_one_about_the_side_itself_does_not(
    turn: WheelCommand, gains: tuple[float, float], blind: bool, fails: bool
) -> None:
    """In a pocket among trunks there is no room for the straight drive that clears a side."""
    chassis = Chassis(HEALTHY)
    chassis.blind = blind
    found: set[Condition | None] = set()
    for _ in range(3):
        found.update(jolt(chassis, DEAD_LEFT))
        chassis.gains = gains
        found.update(chassis.drive(0.5, turn) + chassis.drive(1.0, STOP))
    assert (Condition.DRIVE_FAILED in found) is fails


@pytest.mark.parametrize(("friction", "max_speed_m_s"), [(0.1, 1.0), (0.3, 1.0), (0.8, 1.0), (0.051, 2.0)])
@pytest.mark.parametrize("wheels", [FULL, BACK, WheelCommand(-1.0, 1.0)])
def test_rover_that_turns_on_for_a_while_on_slippery_ground_is_well(
    friction: float, max_speed_m_s: float, wheels: WheelCommand
) -> None:
    """It spun at full duty and is told to drive straight, or to spin the other way: friction stops the turn."""
    rover = Rover(vehicle=replace(VEHICLE, max_speed_m_s=max_speed_m_s))
    heading_deg, rate_deg_s = 0.0, 2 * max_speed_m_s * DEG_S
    loss_deg_s = degrees(0.75 * 12 / 2 * friction * 9.81 / hypot(VEHICLE.length_m, VEHICLE.width_m)) * PERIOD_S
    found: set[Condition | None] = set()
    for tick in range(60):
        if tick > 20:
            rate_deg_s = max(0.0, rate_deg_s - loss_deg_s)
        heading_deg += rate_deg_s * PERIOD_S
        told = wheels if tick > 20 else PIVOT
        moved_m = (told.left + told.right) / 2 * max_speed_m_s * PERIOD_S
        found.add(drive_of(rover.tick(told, moved_m, dt_s=PERIOD_S, heading_deg=wrap360(heading_deg)).conditions))
    assert found == {None}


@pytest.mark.parametrize(
    ("speeds_m_s", "rates_deg_s"),
    [
        ([0.4] * 20, [140.0 * (1.0 - tick / 20) for tick in range(20)]),
        ([tick * PERIOD_S for tick in range(20)], [70.0] * 20),
    ],
    ids=["it slides", "it gains speed, which takes all of the grip"],
)
def test_turn_that_goes_on_longer_because_the_body_also_moves_is_no_dead_side(
    speeds_m_s: list[float], rates_deg_s: list[float]
) -> None:
    rover, heading_deg = started(), 0.0
    legs = [(PIVOT, 0.0, rates_deg_s[0])] * 20
    legs += [(FULL, *each) for each in zip(speeds_m_s, rates_deg_s, strict=True)]
    for told, speed_m_s, rate_deg_s in legs + [(STOP, 0.0, 0.0)] * 40:
        heading_deg += rate_deg_s * PERIOD_S
        said = rover.tick(told, speed_m_s * PERIOD_S, dt_s=PERIOD_S, heading_deg=wrap360(heading_deg))
        assert drive_of(said.conditions) is None


def test_ground_that_holds_a_turn_while_chance_turns_the_body_is_no_dead_side() -> None:
    """Told to turn left at half of full duty, it drives straight at the mean of both sides and drifts to the right."""
    rover, wheels = started(), WheelCommand(0.2, 0.9)
    drift_deg_s = 0.7 * SETTINGS.drive_margin_deg / SETTINGS.drive_window_s
    for tick in range(60):
        moved_m = (wheels.left + wheels.right) / 2 * PERIOD_S
        said = rover.tick(wheels, moved_m, dt_s=PERIOD_S, heading_deg=tick * PERIOD_S * drift_deg_s)
        assert drive_of(said.conditions) is None


@pytest.mark.parametrize("gets_on", [False, True])
def test_body_that_turns_against_its_drive_while_it_hardly_gets_on_is_no_fault(gets_on: bool) -> None:
    """It backs off along a trunk on slippery ground; with a side that is dead it would go half as far as told."""
    rover, wheels, said, heading_deg = started(), WheelCommand(-0.3, -0.6), set(), 0.0
    for _ in range(SETTINGS.drive_uneven_windows + 1):
        for tick in range(13):
            speed_m_s = 0.225 if gets_on else 0.6 * SETTINGS.gain_m_s2 * tick * PERIOD_S
            heading_deg -= 40.0 * PERIOD_S
            detection = rover.tick(wheels, -speed_m_s * PERIOD_S, dt_s=PERIOD_S, heading_deg=wrap360(heading_deg))
            assert not detection.anomalies
        for _ in range(round(2 * SETTINGS.drive_confirm_s / PERIOD_S)):
            said.add(drive_of(rover.tick(STOP, dt_s=PERIOD_S, heading_deg=wrap360(heading_deg)).conditions))
    assert said == {None, Condition.DRIVE_ASYMMETRY} | ({Condition.DRIVE_FAILED} if gets_on else set())


def jolt(chassis: Chassis, gains: tuple[float, float], wheels: WheelCommand = FULL) -> list[Condition | None]:
    """Drive for a moment with those sides, then stand."""
    chassis.gains = gains
    found = chassis.drive(0.4, wheels)
    return found + chassis.drive(2.5, STOP)


@pytest.mark.parametrize("wheels", [(FULL, FULL, FULL), (BACK, BACK, BACK), (FULL, BACK, FULL)])
def test_third_window_to_the_same_side_is_a_fault_whichever_way_the_rover_drives(
    wheels: tuple[WheelCommand, ...],
) -> None:
    chassis = Chassis(DEAD_LEFT)
    found = [set(jolt(chassis, DEAD_LEFT, each)) - {None} for each in wheels]
    assert found == [{Condition.DRIVE_ASYMMETRY}, {Condition.DRIVE_ASYMMETRY}, {Condition.DRIVE_FAILED}]
    assert set(jolt(chassis, DEAD_LEFT)) == {Condition.DRIVE_ASYMMETRY, None}, "it is counted again from 0"


def test_dead_side_is_not_reversed_though_the_turn_before_it_adds_to_its_own() -> None:
    chassis = Chassis(HEALTHY)
    for _ in range(SETTINGS.reversed_turns):
        chassis.gains = HEALTHY
        chassis.drive(1.0, WheelCommand(-0.3, 0.3))
        chassis.gains = DEAD_LEFT
        assert set(chassis.drive(0.6, FULL) + chassis.drive(2.5, STOP)) == {Condition.DRIVE_ASYMMETRY, None}


@pytest.mark.parametrize("then", [BACK, PIVOT])
def test_second_window_may_be_told_at_the_tick_at_which_another_manoeuvre_begins(then: WheelCommand) -> None:
    for ticks in range(20, 60):
        chassis = Chassis(DEAD_LEFT)
        found = chassis.drive(ticks * PERIOD_S, FULL) + chassis.drive(1.0, then)
        assert Condition.DRIVE_ASYMMETRY in found


def test_windows_to_both_sides_are_chance() -> None:
    chassis = Chassis(HEALTHY)
    for gains in (DEAD_LEFT, DEAD_RIGHT, DEAD_LEFT, DEAD_RIGHT):
        assert Condition.DRIVE_FAILED not in jolt(chassis, gains)


def test_windows_that_lie_further_apart_than_memory_are_no_fault() -> None:
    chassis = Chassis(HEALTHY)
    for _ in range(5):
        assert set(jolt(chassis, DEAD_LEFT)) == {Condition.DRIVE_ASYMMETRY, None}
        chassis.drive(SETTINGS.drive_memory_s / 2, STOP)


@pytest.mark.parametrize("gains", [MIXED_UP, REVERSED_LEFT, (1.0, -1.0)])
def test_second_drive_with_wheels_that_go_the_wrong_way_is_a_fault(gains: tuple[float, float]) -> None:
    wheels = PIVOT if gains == MIXED_UP else FULL
    chassis = Chassis(gains)
    assert set(jolt(chassis, gains, wheels)) == {Condition.DRIVE_ASYMMETRY, None}
    assert Condition.DRIVE_FAILED in jolt(chassis, gains, wheels)


@pytest.mark.parametrize("wheels", [PIVOT, WheelCommand(-1.0, 1.0), FULL, CURVE])
def test_turn_that_is_blocked_is_the_forest_and_no_fault(wheels: WheelCommand) -> None:
    chassis = Chassis(HEALTHY)
    assert set(chassis.drive(5.0, wheels, blocked=True)) == {None}


def test_rover_that_slides_along_a_trunk_and_then_turns_away_from_it_is_well() -> None:
    """Half a second of a turn that the trunk takes away, then one the other way: it turned no more than it was told."""
    rover = started()
    found = [rover.tick(WheelCommand(1.0, -0.6), 0.01, dt_s=PERIOD_S).conditions for _ in range(10)]
    for heading_deg in (356.0, 351.0, 344.0, 336.0):
        said = rover.tick(WheelCommand(-0.6, 1.0), 0.01, dt_s=PERIOD_S, heading_deg=heading_deg)
        found.append(said.conditions)
    assert set(found) == {()}


def test_window_in_which_the_rover_met_something_is_dropped() -> None:
    """A trunk turns a rover that pushes on; the tilt says that there is one."""
    rover = started()
    for tick in range(100):
        detection = rover.tick(FULL, 0.05, dt_s=0.05, heading_deg=tick * 5.0 % 360.0, pitch_deg=25.0)
        if tick > 5:
            assert detection.anomalies == (Anomaly.NOSE_UP,)
            assert drive_of(detection.conditions) is None


def test_heading_that_was_rejected_and_then_believed_accuses_nobody() -> None:
    rover = started()
    found = [drive_of(rover.tick(FULL, 0.05, dt_s=0.05, heading_deg=120.0).conditions) for _ in range(60)]
    assert rover.heading_deg == 120.0
    assert set(found) == {None}


def test_rover_that_is_turned_by_hand_while_it_stands_is_well() -> None:
    rover = started()
    assert {drive_of(rover.tick(heading_deg=tick * 5.0 % 360.0).conditions) for tick in range(200)} == {None}


WHEELS = st.builds(WheelCommand, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@given(
    legs=st.lists(st.tuples(WHEELS, st.integers(1, 30), st.booleans()), max_size=12),
    lag_s=st.floats(0.02, 0.2),
    gains=st.tuples(st.floats(0.95, 1.05), st.floats(0.95, 1.05)),
    seed=st.integers(0, 1000),
)
def test_healthy_rover_is_never_accused(
    legs: list[tuple[WheelCommand, int, bool]], lag_s: float, gains: tuple[float, float], seed: int
) -> None:
    """Whatever it is told, with any likely lag of its motors, unequal sides, a noisy compass, and things in its way."""
    chassis = Chassis(gains, lag_s, noise_deg=1.0, seed=seed)
    for wheels, ticks, blocked in legs:
        for _ in range(ticks):
            assert drive_of(chassis.tick(wheels, blocked=blocked)) is None


def test_rover_of_which_one_side_has_half_its_strength_is_accused() -> None:
    """The test above can fail."""
    assert Condition.DRIVE_ASYMMETRY in Chassis((0.5, 1.0), noise_deg=1.0).drive(3.0, FULL)


def test_rover_with_other_dimensions_is_judged_by_them() -> None:
    """A wide rover turns half as fast, and that is all that its wheels were told."""
    chassis = Chassis(HEALTHY)
    chassis.rover = Rover(SETTINGS, VEHICLE.__class__(0.4, 0.4, VEHICLE.track_m / 4, VEHICLE.max_speed_m_s))
    assert Condition.DRIVE_ASYMMETRY not in chassis.drive(2.0, CURVE)
    assert set(chassis.drive(2.0, FULL)) == {None}
