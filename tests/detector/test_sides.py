"""A dead, weak or reversed side: what raises a suspicion, and what the self-test makes of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import degrees, exp, inf
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import BACK, FULL, PIVOT, VEHICLE, Rover, started
from wayfarer.angles import wrap360
from wayfarer.detector.sides import AGAIN_MAX_S, AGAIN_S, UNDECIDED_AGAIN_S, SideMonitor
from wayfarer.escape.api import SideGains
from wayfarer.escape.ladder import SELF_TEST, THOROUGH_SELF_TEST, Rung
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import TickInterval

PERIOD_S = 0.05
DEG_S = degrees(VEHICLE.max_speed_m_s / VEHICLE.track_m)  # of one side at full duty
HEALTHY, DEAD_LEFT, DEAD_RIGHT, REVERSED_LEFT, MIXED_UP = (1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (-1.0, -1.0)
CURVE = WheelCommand(1.0, 0.6)
SUSPECTED = (Condition.DRIVE_SUSPECTED,)


class Chassis:
    """A rover whose sides turn ``gains`` times as fast as commanded.

    ``grip`` is the turn duty that the ground takes up. The heading follows the wheels with ``lag_s``, and the compass
    reads it ``late_ticks`` later.
    """

    def __init__(self, gains: tuple[float, float], lag_s: float = 0.1, noise_deg: float = 0.0, seed: int = 0) -> None:
        self.rover = started()
        self.gains = gains
        self.grip = 0.0
        self.late_ticks = 0
        self.blind = False  # its motion sensor is silent
        self.field_deg = 0.0  # by how much full duty of one side bends the heading
        self._keeps = exp(-PERIOD_S / lag_s)
        self._noise_deg, self._chance = noise_deg, Random(seed)
        self._left = self._right = self.heading_deg = 0.0
        self._headings_deg = [0.0]

    @property
    def sides(self) -> SideMonitor:
        return self.rover.detector.sides

    def tick(self, wheels: WheelCommand, *, blocked: bool = False) -> tuple[Condition, ...]:
        """Drive for a period and return the conditions; a blocked rover moves nowhere."""
        self._left = wheels.left * self.gains[0] + (self._left - wheels.left * self.gains[0]) * self._keeps
        self._right = wheels.right * self.gains[1] + (self._right - wheels.right * self.gains[1]) * self._keeps
        moved_m = 0.0
        if not blocked:
            half = (self._left - self._right) / 2
            turn = max(abs(half) - self.grip, 0.0) * (1.0 if half > 0.0 else -1.0)
            self.heading_deg += 2 * turn * DEG_S * PERIOD_S
            moved_m = (self._left + self._right) / 2 * PERIOD_S
        self._headings_deg.append(self.heading_deg + self.field_deg * (wheels.left - wheels.right))
        late_deg = self._headings_deg[max(0, len(self._headings_deg) - 1 - self.late_ticks)]
        read_deg = wrap360(late_deg + self._chance.gauss(0.0, self._noise_deg))
        seen_m = None if self.blind else moved_m
        return self.rover.tick(wheels, seen_m, dt_s=PERIOD_S, heading_deg=read_deg).conditions

    def drive(self, for_s: float, wheels: WheelCommand, *, blocked: bool = False) -> float | None:
        """Drive until a side is suspected; return after how long, None where none was."""
        for tick in range(round(for_s / PERIOD_S)):
            if Condition.DRIVE_SUSPECTED in self.tick(wheels, blocked=blocked):
                return (tick + 1) * PERIOD_S
        return None

    def test(self, rung: Rung = SELF_TEST, *, blocked: bool = False, blocked_pulses: tuple[int, ...] = ()) -> bool:
        """Do the self-test; return whether it decided."""
        self.sides.begin_test()
        for number, step in enumerate(rung.steps):
            holds = blocked or (number - 1) // 2 in blocked_pulses
            for _ in range(round(step.for_s / PERIOD_S)):
                self.tick(WheelCommand(step.ahead + step.turn, step.ahead - step.turn), blocked=holds)
        return self.sides.end_test(self.rover.t_s)


# -- watching ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", [DEAD_LEFT, DEAD_RIGHT, REVERSED_LEFT])
@pytest.mark.parametrize("wheels", [FULL, BACK, CURVE])
def test_side_that_does_not_turn_is_suspected_within_two_and_a_half_seconds_of_driving(
    gains: tuple[float, float], wheels: WheelCommand
) -> None:
    chassis = Chassis(HEALTHY)
    assert chassis.drive(3.0, wheels) is None
    chassis.gains = gains
    assert (chassis.drive(3.0, wheels) or 9.0) <= 2.5


@pytest.mark.parametrize("gains", [REVERSED_LEFT, MIXED_UP, DEAD_LEFT])
def test_side_that_does_not_obey_is_suspected_in_a_turn_on_the_spot(gains: tuple[float, float]) -> None:
    assert (Chassis(gains).drive(2.0, PIVOT) or 9.0) <= 1.2


def test_dead_side_on_ground_that_holds_every_turn_is_suspected_because_the_body_is_slow() -> None:
    chassis = Chassis(DEAD_LEFT)
    chassis.grip = 0.6
    assert chassis.drive(20.0, FULL) is not None


def test_rover_that_was_slow_in_its_last_mission_can_be_armed_again() -> None:
    """A body that stands has no pace: it was slow until the end of the run, and no arming was possible."""
    chassis = Chassis(DEAD_LEFT)
    chassis.grip = 0.6
    chassis.drive(20.0, FULL)
    chassis.drive(5.0, STOP)
    chassis.rover.detector.begin_arming()
    assert chassis.drive(5.0, STOP) is None


def test_side_that_lags_just_before_an_anomaly_is_a_trunk() -> None:
    """A trunk turns the rover that runs into it, and then holds it."""
    chassis = Chassis(DEAD_LEFT)
    assert chassis.drive(0.4, FULL) is None
    assert chassis.drive(1.0, FULL, blocked=True) is None


@pytest.mark.parametrize("wheels", [FULL, BACK])
def test_flow_sensor_that_sees_half_as_much_again_is_at_another_height(wheels: WheelCommand) -> None:
    chassis = Chassis((1.5, 1.5), noise_deg=1.0)
    assert chassis.drive(10.0, wheels) is None


@pytest.mark.parametrize("late_ticks", [4, 8, 10])
@pytest.mark.parametrize("turn_s", [0.2, 0.4, 0.8])
def test_turn_that_a_compass_shows_late_is_no_turn_beyond_the_commands(late_ticks: int, turn_s: float) -> None:
    """A self-test tells how late it is."""
    chassis = Chassis(HEALTHY, noise_deg=1.0)
    chassis.late_ticks = late_ticks
    chassis.test()
    for wheels, for_s in ((FULL, 1.0), (PIVOT, turn_s), (FULL, 1.0), (WheelCommand(-1.0, 1.0), turn_s), (FULL, 1.0)):
        assert chassis.drive(for_s, wheels) is None


@pytest.mark.parametrize("wheels", [PIVOT, WheelCommand(-1.0, 1.0), FULL])
def test_turn_that_something_holds_is_the_forest(wheels: WheelCommand) -> None:
    assert Chassis(HEALTHY).drive(1.0, wheels, blocked=True) is None


def test_three_turns_that_fail_raise_a_suspicion() -> None:
    chassis = Chassis(HEALTHY, noise_deg=0.3)
    for n in range(3):
        assert chassis.drive(0.7, PIVOT if n % 2 else WheelCommand(-1.0, 1.0), blocked=True) is None or n == 2
    assert chassis.tick(PIVOT, blocked=True) == (*SUSPECTED, Condition.CANNOT_TURN)


def test_rover_that_is_turned_or_carried_while_it_stands_is_not_suspected() -> None:
    rover = started()
    for tick in range(200):
        assert Condition.DRIVE_SUSPECTED not in rover.tick(heading_deg=tick * 5.0 % 360.0).conditions


def test_heading_in_doubt_suspects_nobody_and_waits_with_the_test() -> None:
    chassis = Chassis(DEAD_LEFT)
    assert chassis.drive(3.0, FULL) is not None
    assert chassis.sides.wants_test(chassis.rover.t_s)
    for _ in range(20):
        chassis.rover.tick(FULL, compass=False)
    assert not chassis.sides.wants_test(chassis.rover.t_s)


WHEELS = st.builds(WheelCommand, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@given(
    legs=st.lists(st.tuples(WHEELS, st.integers(1, 30), st.booleans()), max_size=12),
    lag_s=st.floats(0.02, 0.2),
    gains=st.tuples(st.floats(0.95, 1.05), st.floats(0.95, 1.05)),
    grip=st.floats(0.0, 0.4),
    seed=st.integers(0, 1000),
)
def test_no_drive_and_no_test_of_a_healthy_rover_ends_in_a_verdict_against_a_side(
    legs: list[tuple[WheelCommand, int, bool]], lag_s: float, gains: tuple[float, float], grip: float, seed: int
) -> None:
    """For all commands, with any likely lag of its motors, unequal sides, a noisy compass, and things in its way."""
    chassis = Chassis(gains, lag_s, noise_deg=1.0, seed=seed)
    chassis.grip = grip
    for wheels, ticks, blocked in legs:
        for _ in range(ticks):
            chassis.tick(wheels, blocked=blocked)
        chassis.test(blocked=blocked)
        assert set(chassis.sides.conditions) <= {Condition.DRIVE_SUSPECTED}


# -- the self-test ----------------------------------------------------------------------------------------------------

VERDICTS = {
    HEALTHY: None,
    (0.8, 1.0): None,
    DEAD_LEFT: SideGains(0.0, 1.0),
    DEAD_RIGHT: SideGains(1.0, 0.0),
    (0.3, 1.0): SideGains(0.3, 1.0),
}


@pytest.mark.parametrize(("gains", "verdict"), VERDICTS.items(), ids=str)
@pytest.mark.parametrize("blind", [False, True], ids=["sees", "blind"])
def test_self_test_finds_a_dead_or_weak_side(
    gains: tuple[float, float], verdict: SideGains | None, blind: bool
) -> None:
    chassis = Chassis(gains, noise_deg=0.3)
    chassis.blind = blind
    assert chassis.test()
    assert (chassis.sides.gains is None) is (verdict is None)
    assert tuple(chassis.sides.gains or HEALTHY) == pytest.approx(tuple(verdict or HEALTHY), abs=0.08)
    assert chassis.sides.conditions == ((Condition.DRIVE_WEAK,) if verdict else ())


@pytest.mark.parametrize("gains", [HEALTHY, (0.8, 1.0), DEAD_LEFT, DEAD_RIGHT], ids=str)
@pytest.mark.parametrize("blind", [False, True], ids=["sees", "blind"])
@pytest.mark.parametrize("late_ticks", [4, 8, 10])
def test_self_test_finds_a_dead_side_with_a_compass_that_lags(
    gains: tuple[float, float], blind: bool, late_ticks: int
) -> None:
    """Some of the turn of a pulse is seen in the next one, and that of the last pulse after a quick test is over."""
    chassis = Chassis(gains, noise_deg=0.3)
    chassis.blind, chassis.late_ticks = blind, late_ticks
    assert chassis.test() or chassis.test(THOROUGH_SELF_TEST)
    assert tuple(chassis.sides.gains or HEALTHY) == pytest.approx((max(gains[0], 0.0), gains[1]), abs=0.3)
    assert (chassis.sides.gains is None) is (0.0 not in gains)


@pytest.mark.parametrize("gains", [HEALTHY, DEAD_LEFT, DEAD_RIGHT], ids=str)
@pytest.mark.parametrize("turn", [PIVOT, WheelCommand(-1.0, 1.0)])
def test_turn_before_the_self_test_that_a_compass_shows_late_is_not_the_turn_of_a_pulse(
    gains: tuple[float, float], turn: WheelCommand
) -> None:
    chassis = Chassis(gains, noise_deg=0.3)
    chassis.blind, chassis.late_ticks = True, 10
    chassis.drive(0.5, turn)
    assert chassis.test() or chassis.test(THOROUGH_SELF_TEST)
    assert tuple(chassis.sides.gains or HEALTHY) == pytest.approx(gains, abs=0.1)
    assert Condition.DRIVE_REVERSED not in chassis.sides.conditions


def test_body_that_something_blocks_on_one_side_is_no_weak_side() -> None:
    """Its other side moves it one way only."""
    chassis = Chassis(HEALTHY, noise_deg=0.3)
    chassis.blind = True
    for rung in (SELF_TEST, THOROUGH_SELF_TEST):
        assert not chassis.test(rung, blocked_pulses=(0, 2, 3))
    assert chassis.sides.conditions == ()


def shown_test(
    sides: SideMonitor, rung: Rung, turn_deg_s: Callable[[WheelCommand], float], doubtful_from_s: float = inf
) -> bool:
    """Do a self-test in which the compass shows this turn rate and nothing else is seen; return whether it decided."""
    sides.begin_test()
    t_s = 0.0
    for step in rung.steps:
        wheels = WheelCommand(step.ahead + step.turn, step.ahead - step.turn)
        for _ in range(round(step.for_s / PERIOD_S)):
            t_s += PERIOD_S
            interval = TickInterval(t_s, wheels, PERIOD_S, PERIOD_S)
            doubtful = t_s > doubtful_from_s
            sides.update(interval, turn_deg_s(wheels) * PERIOD_S, 0.0, trusted=False, doubtful=doubtful)
    return sides.end_test(t_s)


@pytest.mark.parametrize("drift_deg_s", [25.0, -25.0])
def test_heading_that_drifts_shows_no_side_that_does_the_opposite(drift_deg_s: float) -> None:
    sides = SideMonitor(VEHICLE)
    for rung in (SELF_TEST, THOROUGH_SELF_TEST, SELF_TEST, THOROUGH_SELF_TEST):
        shown_test(sides, rung, lambda wheels: drift_deg_s)
        assert Condition.DRIVE_REVERSED not in sides.conditions


@pytest.mark.parametrize("late_ticks", [0, 2, 5])
@pytest.mark.parametrize("field_deg", [15.0, -15.0, 40.0])
def test_motors_that_bend_the_heading_of_a_body_that_is_held_are_no_reversed_side(
    field_deg: float, late_ticks: int
) -> None:
    for rung in (SELF_TEST, THOROUGH_SELF_TEST):
        chassis = Chassis(HEALTHY)
        chassis.field_deg, chassis.late_ticks = field_deg, late_ticks
        chassis.test(rung, blocked=True)
        assert Condition.DRIVE_REVERSED not in chassis.sides.conditions


def test_self_test_with_a_heading_in_doubt_decides_nothing() -> None:
    """A heading that is reckoned from the commands always turns as commanded."""
    sides = SideMonitor(VEHICLE)
    assert not shown_test(sides, SELF_TEST, lambda wheels: (wheels.left - wheels.right) * DEG_S, doubtful_from_s=2.0)
    assert sides.conditions == ()


@pytest.mark.parametrize("late_ticks", [0, 8], ids=["prompt", "late"])
@pytest.mark.parametrize("before", [STOP, PIVOT])
@pytest.mark.parametrize("gains", [REVERSED_LEFT, MIXED_UP, (1.0, -0.5)])
def test_self_test_finds_a_side_that_does_the_opposite(
    gains: tuple[float, float], before: WheelCommand, late_ticks: int
) -> None:
    chassis = Chassis(gains)
    chassis.late_ticks = late_ticks
    chassis.drive(0.5, before)
    assert chassis.test()
    assert chassis.sides.conditions == (Condition.DRIVE_REVERSED,)


@pytest.mark.parametrize("late_ticks", [4, 6, 8, 10])
@pytest.mark.parametrize("gains", [REVERSED_LEFT, (1.0, -1.0)])
def test_reversed_side_is_not_taken_for_a_dead_one_where_the_compass_lags_and_nothing_is_seen(
    gains: tuple[float, float], late_ticks: int
) -> None:
    chassis = Chassis(gains)
    chassis.blind, chassis.late_ticks = True, late_ticks
    if not chassis.test():
        chassis.test(THOROUGH_SELF_TEST)
    assert Condition.DRIVE_REVERSED in chassis.sides.conditions


def test_self_test_on_ground_that_holds_every_turn_is_judged_by_the_distance() -> None:
    chassis = Chassis(DEAD_LEFT)
    chassis.grip = 0.6
    assert chassis.test()
    assert chassis.sides.gains == SideGains(0.0, 1.0)


@pytest.mark.parametrize("gains", [HEALTHY, DEAD_LEFT, REVERSED_LEFT])
def test_self_test_of_a_body_that_is_held_decides_nothing_and_is_due_again_soon(gains: tuple[float, float]) -> None:
    chassis = Chassis(gains, noise_deg=0.3)
    assert not chassis.test(blocked=True)
    assert chassis.sides.conditions == ()
    chassis.sides.suspect(chassis.rover.t_s)
    assert not chassis.sides.wants_test(chassis.rover.t_s)
    chassis.sides.suspect(chassis.rover.t_s + UNDECIDED_AGAIN_S)
    assert chassis.sides.wants_test(chassis.rover.t_s + UNDECIDED_AGAIN_S)


def test_what_moves_at_full_duty_only_is_judged_at_full_duty() -> None:
    chassis = Chassis(HEALTHY, noise_deg=0.2)  # a compass without any noise that shows no turn counts as frozen
    chassis.grip, chassis.blind = 0.26, True
    assert not chassis.test()
    assert chassis.test(THOROUGH_SELF_TEST)
    assert chassis.sides.conditions == ()


def test_healthy_rover_is_tested_again_after_growing_pauses() -> None:
    chassis, pauses_s = Chassis(HEALTHY), []
    for _ in range(6):
        chassis.test()
        t_s, pause_s = chassis.rover.t_s, 0.0
        while not chassis.sides.wants_test(t_s + pause_s):
            pause_s += 10.0
            chassis.sides.suspect(t_s + pause_s)
        pauses_s.append(pause_s)
    assert pauses_s == [min(AGAIN_S * 2**n, AGAIN_MAX_S) for n in range(6)]


def test_weak_side_is_tested_again_and_may_have_come_free() -> None:
    chassis = Chassis(DEAD_LEFT)
    chassis.test()
    assert not chassis.sides.wants_test(chassis.rover.t_s)
    assert chassis.sides.wants_test(chassis.rover.t_s + AGAIN_S)
    chassis.gains = HEALTHY
    chassis.test()
    assert chassis.sides.gains is None


def test_arming_forgets_what_was_found() -> None:
    chassis = Chassis(MIXED_UP)
    chassis.test()
    chassis.rover.detector.begin_arming()
    assert chassis.tick(STOP) == ()


def test_wide_rover_is_judged_by_its_own_dimensions() -> None:
    """It turns half as fast, and that is all that its wheels were told."""
    chassis = Chassis(HEALTHY)
    chassis.rover = Rover(vehicle=replace(VEHICLE, track_m=VEHICLE.track_m / 4))
    assert chassis.drive(2.0, CURVE) is None
    assert chassis.drive(2.0, FULL) is None


def test_pulse_of_no_length_shows_nothing() -> None:
    sides = SideMonitor(VEHICLE)
    sides.begin_test()
    sides.update(TickInterval(1.0, STOP), 0.0, 0.0, trusted=True, doubtful=False)
    assert not sides.end_test(1.0)
