"""The gate before the wheels: never motion without leave, limits, and faults that stay."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import DUTY_SHARES, LEVELS, Condition, Level, worst
from wayfarer.safety.gate import Gate
from wayfarer.safety.settings import SafetySettings

HZ = 20.0
AHEAD = WheelCommand(1.0, 1.0)
LOW_VOLTAGE_SHARE = 0.7  # fault catalogue, fault 32
BY_LEVEL = {level: [condition for condition in Condition if LEVELS[condition] is level] for level in Level}
STOPPING = BY_LEVEL[Level.HOLD] + BY_LEVEL[Level.FAULT]
SUPPLY = {Condition.UNDERVOLTAGE: LOW_VOLTAGE_SHARE, Condition.POWER_UNSTABLE: 0.5}
HARMLESS = [each for each in (*BY_LEVEL[Level.NOTE], *BY_LEVEL[Level.DEGRADE]) if each not in SUPPLY]
DUTIES = st.floats(-1.5, 1.5) | st.sampled_from([0.0, nan, inf, -inf])
COMMANDS = st.builds(WheelCommand, DUTIES, DUTIES)
CONDITIONS = st.lists(st.sampled_from(Condition), max_size=2).map(tuple)


def gate(**settings: Any) -> Gate:
    return Gate(SafetySettings(**settings), HZ)


def update(gate_: Gate, wanted: WheelCommand, conditions: tuple[Condition, ...], *, armed: bool) -> WheelCommand:
    """One tick of the gate, by an algorithm that always wants the same."""
    may_turn = gate_.judge(conditions, armed=armed)
    limited = gate_.limit(wanted)
    assert may_turn or limited == STOP, "also if somebody asks who must not"
    return limited


def at_full_duty() -> Gate:
    running = gate(slew_per_s=1000.0)
    assert update(running, AHEAD, (), armed=True) == AHEAD
    return running


def test_every_condition_has_a_level() -> None:
    assert set(LEVELS) == set(Condition)


def test_rover_among_people_holds_for_a_sense_that_another_goes_on_without() -> None:
    among_people, alone = gate(on_lost_sense="hold"), gate()
    lost = [each for each in Condition if among_people.levels[each] > alone.levels[each]]
    assert set(lost) == {
        Condition.MOTION_UNKNOWN, Condition.MOTION_STALE, Condition.CONTACT_STALE, Condition.WHEELS_STALE,
        Condition.POWER_UNSTABLE, Condition.MOTORS_FAILED,
    }  # fmt: skip
    for each in lost:
        for gate_ in (among_people, alone):
            update(gate_, AHEAD, (each,), armed=True)
        assert among_people.holds
        assert alone.holds is (each is Condition.MOTORS_FAILED)
    assert not [each for each in Condition if among_people.levels[each] < alone.levels[each]]


def test_most_severe_condition_wins_and_the_first_of_equals() -> None:
    assert worst([]) is None
    assert worst([Condition.MOTION_UNKNOWN, Condition.COMPASS_STALE, Condition.TICK_LATE]) is Condition.COMPASS_STALE
    assert worst([Condition.TICK_LATE, Condition.OVERTURNED]) is Condition.OVERTURNED


@given(st.lists(st.tuples(COMMANDS, CONDITIONS, st.booleans(), st.booleans()), max_size=60))
def test_wheels_never_turn_while_disarmed_held_or_faulted(
    ticks: list[tuple[WheelCommand, tuple[Condition, ...], bool, bool]],
) -> None:
    gate_ = gate()
    faulted = False
    for wanted, conditions, armed, cleared in ticks:
        if cleared:
            gate_.clear_fault()
            faulted = False
        may_turn = gate_.judge(conditions, armed=armed)
        applied = gate_.limit(wanted)
        holds = faulted or any(condition in STOPPING for condition in conditions)
        assert may_turn == (armed and not holds), "a manoeuvre waits while the wheels are held"
        faulted |= any(LEVELS[condition] is Level.FAULT for condition in conditions)
        if not armed or holds or faulted:
            assert applied == STOP
        assert all(-1.0 <= duty <= 1.0 for duty in applied)
        faulted |= gate_.level is Level.FAULT
        assert applied == STOP or not faulted


@given(st.lists(st.builds(WheelCommand, st.floats(-1, 1), st.floats(-1, 1)), max_size=40), st.floats(0.1, 30.0))
def test_duty_grows_no_faster_than_the_slew_and_is_never_more_than_wanted(
    wanted: list[WheelCommand], slew_per_s: float
) -> None:
    gate_ = gate(slew_per_s=slew_per_s)
    last = STOP
    for command in wanted:
        applied = update(gate_, command, (), armed=True)
        for now, before, want in zip(applied, last, command, strict=True):
            assert now * want >= 0.0
            assert abs(now) <= abs(want)
            same_way = before if before * now > 0.0 else 0.0
            assert abs(now) <= abs(same_way) + slew_per_s / HZ + 1e-9
        last = applied


def test_start_is_a_ramp() -> None:
    gate_ = gate(slew_per_s=8.0)
    assert [update(gate_, AHEAD, (), armed=True).left for _ in range(4)] == pytest.approx([0.4, 0.8, 1.0, 1.0])


@pytest.mark.parametrize("wanted", [STOP, WheelCommand(0.2, 0.0)])
def test_less_duty_is_given_at_once(wanted: WheelCommand) -> None:
    gate_ = gate(slew_per_s=0.2)
    for _ in range(200):
        full = update(gate_, AHEAD, (), armed=True)
    assert full == AHEAD
    assert update(gate_, wanted, (), armed=True) == wanted


@pytest.mark.parametrize(
    ("reversed_", "given_"),
    [((-1.0, -1.0), (-0.4, -0.4)), ((-1.0, 1.0), (-0.4, 1.0)), ((1.0, -1.0), (1.0, -0.4))],
    ids=["both", "left", "right"],
)
@pytest.mark.parametrize("way", [1.0, -1.0], ids=["from ahead", "from reverse"])
def test_side_that_reverses_stops_first_and_grows_from_zero(
    way: float, reversed_: tuple[float, float], given_: tuple[float, float]
) -> None:
    gate_ = gate(slew_per_s=8.0)
    for _ in range(3):
        update(gate_, WheelCommand(way, way), (), armed=True)
    wanted = WheelCommand(way * reversed_[0], way * reversed_[1])
    assert update(gate_, wanted, (), armed=True) == pytest.approx((way * given_[0], way * given_[1]))


@pytest.mark.parametrize("condition", STOPPING)
def test_stop_is_immediate_and_the_start_after_it_a_ramp(condition: Condition) -> None:
    gate_ = gate(slew_per_s=8.0)
    for _ in range(3):
        update(gate_, AHEAD, (), armed=True)
    for way in (1.0, -1.0):
        assert update(gate_, AHEAD, (condition,), armed=True) == STOP
        gate_.clear_fault()
        assert update(gate_, WheelCommand(way, way), (), armed=True) == pytest.approx((0.4 * way, 0.4 * way))


@pytest.mark.parametrize("condition", BY_LEVEL[Level.HOLD])
def test_hold_ends_with_its_condition(condition: Condition) -> None:
    gate_ = at_full_duty()
    assert update(gate_, AHEAD, (condition,), armed=True) == STOP
    assert (gate_.level, gate_.cause) == (Level.HOLD, condition)
    assert update(gate_, AHEAD, (), armed=True) == AHEAD
    assert (gate_.level, gate_.cause) == (Level.WELL, None)


@pytest.mark.parametrize("condition", BY_LEVEL[Level.FAULT])
def test_first_fault_stays_and_is_told_until_it_is_cleared(condition: Condition) -> None:
    gate_ = at_full_duty()
    update(gate_, AHEAD, (condition,), armed=True)
    for conditions in ((), (Condition.MOTION_UNKNOWN,), (Condition.COMPASS_STALE,), (Condition.MOTORS_FAILED,), ()):
        assert update(gate_, AHEAD, conditions, armed=True) == STOP
        assert (gate_.level, gate_.cause) == (Level.FAULT, condition)
    gate_.clear_fault()
    assert (gate_.level, gate_.cause) == (Level.WELL, None), "at once, not with the next tick"
    assert update(gate_, AHEAD, (), armed=True) == AHEAD
    assert gate_.level is Level.WELL


def test_fault_while_disarmed_is_latched_too() -> None:
    gate_ = gate()
    update(gate_, AHEAD, (Condition.OVERTURNED,), armed=False)
    assert update(gate_, AHEAD, (), armed=True) == STOP


@pytest.mark.parametrize("condition", HARMLESS)
def test_note_and_degrade_neither_stop_nor_lift_a_limit(condition: Condition) -> None:
    gate_ = gate(duty_max=0.6, slew_per_s=1000.0)
    assert update(gate_, AHEAD, (condition,), armed=True) == (0.6, 0.6)
    assert gate_.cause is condition


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize("other", [0.0, 0.5, nan])
def test_wheels_that_are_no_number_stop_and_latch(bad: float, other: float) -> None:
    for wanted in (WheelCommand(bad, other), WheelCommand(other, bad)):
        gate_ = at_full_duty()
        assert update(gate_, wanted, (), armed=True) == STOP
        assert update(gate_, AHEAD, (), armed=True) == STOP
        assert (gate_.level, gate_.cause) == (Level.FAULT, Condition.DECISION_INVALID)


@pytest.mark.parametrize("left", [1.0, -3.0, 0.3, -0.5, 0.0])
@pytest.mark.parametrize("right", [0.9, -1.0, 0.3])
def test_duty_is_limited_on_each_side_and_both_ways(left: float, right: float) -> None:
    gate_ = gate(duty_max=0.6, slew_per_s=1000.0)
    for _ in range(2):
        limited = [min(max(duty, -0.6), 0.6) for duty in (left, right)]
        assert list(update(gate_, WheelCommand(left, right), (), armed=True)) == limited


def test_no_other_condition_takes_a_share_of_the_duty() -> None:
    assert {condition: share for condition, share in DUTY_SHARES.items() if share < 1.0} == SUPPLY


@pytest.mark.parametrize("condition", SUPPLY)
def test_low_supply_takes_duty_away_at_once_and_gives_it_back_within_the_slew(condition: Condition) -> None:
    gate_ = gate(duty_max=0.8, slew_per_s=2.0)
    for _ in range(20):
        update(gate_, AHEAD, (), armed=True)
    capped = 0.8 * SUPPLY[condition]
    assert update(gate_, AHEAD, (condition,), armed=True) == pytest.approx((capped, capped))
    assert update(gate_, AHEAD, (), armed=True) == pytest.approx((capped + 0.1, capped + 0.1))


@given(wanted=st.lists(COMMANDS, min_size=1, max_size=20), low=st.lists(st.booleans(), min_size=20, max_size=20))
def test_low_supply_never_gives_more_and_never_holds_up_a_stop(wanted: list[WheelCommand], low: list[bool]) -> None:
    gate_ = gate(duty_max=0.9)
    for command, is_low in zip(wanted, low, strict=False):
        given_ = update(gate_, command, (Condition.UNDERVOLTAGE,) if is_low else (), armed=True)
        most = 0.9 * (LOW_VOLTAGE_SHARE if is_low else 1.0)
        assert max(map(abs, given_)) <= most
    assert update(gate_, STOP, (Condition.UNDERVOLTAGE,), armed=True) == STOP
