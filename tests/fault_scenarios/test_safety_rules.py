"""The checker of the safety rules is itself checked: each rule is broken on purpose, and it must say so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan
from typing import Any

import pytest

from tests.fault_scenarios.broken_product import breaks_the_product
from wayfarer.control.controller import Controller, Mode
from wayfarer.control.shutdown import Shutdown
from wayfarer.detector import Detector
from wayfarer.detector.tick import Tick
from wayfarer.drivers.sabertooth import Sabertooth
from wayfarer.escape.api import Decision, Observation
from wayfarer.escape.handler import PhasedHandler
from wayfarer.fault_scenarios.runner import run_scenario
from wayfarer.fault_scenarios.scenario import Command, Expectation, Reached, Scenario
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import LEVELS, Condition, Level
from wayfarer.safety.gate import Gate
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.chips.sabertooth import SabertoothChip
from wayfarer.simhal.faults.injector import EFFECTS
from wayfarer.simhal.faults.kinds import Fault, LateAnswer, LoopStall, Lost, NotANumber
from wayfarer.simhal.parts import SimMotors

AHEAD = WheelCommand(0.3, 0.3)
NO_COMPASS = Fault(3.0, inf, "compass", "silent")
BRIEFLY_NO_COMPASS = Fault(3.0, 1.0, "compass", "silent")
HARMLESS = Fault(100.0, inf, "compass", "silent")
UNTOUCHED = Scenario(
    "test", "", Expectation(Reached.NONE, 0.0), (HARMLESS,), rover="sim", depth=Depth.DEVICE, for_s=6.0, clearing=True
)  # fmt: skip

Patch = pytest.MonkeyPatch


def broken(*faults: Fault, ask: tuple[Command, ...] = (Command(0.0, "arm"),), **changes: Any) -> str:
    """What the checker says of a run with these faults."""
    run_result = run_scenario(replace(UNTOUCHED, faults=faults or (HARMLESS,), commands=ask, **changes))
    return "\n".join(run_result.broken)


def drives_always(monkeypatch: Patch, when: Callable[[Gate], bool] = lambda _: True) -> None:
    """A gate that lets the wheels turn, whatever is wrong."""
    honest = Gate.limit

    def limit(self: Gate, wanted: WheelCommand, *, armed: bool) -> WheelCommand:
        return AHEAD if when(self) else honest(self, wanted, armed=armed)

    monkeypatch.setattr(Gate, "limit", limit)


@breaks_the_product
def test_wheels_that_turn_before_a_late_tick_that_holds_are_seen_all_the_same(monkeypatch: Patch) -> None:
    """A board that answers late hides when the wheels may turn, not that they may not."""
    drives_always(monkeypatch)
    late = Fault(2.0, inf, "motors", "late_answer", LateAnswer(by_s=0.1))
    assert "rule 2: wheels are told 0.30, 0.30" in broken(NO_COMPASS, late)


@pytest.mark.parametrize("depth", list(Depth))
@pytest.mark.parametrize("fault", [HARMLESS, NO_COMPASS, BRIEFLY_NO_COMPASS])
def test_honest_field_code_breaks_no_rule(fault: Fault, depth: Depth) -> None:
    assert broken(fault, depth=depth) == ""


# -- rule 1 ------------------------------------------------------------------------------------------------------------


@breaks_the_product
def test_motion_while_never_armed_is_seen(monkeypatch: Patch) -> None:
    drives_always(monkeypatch)
    assert "rule 1: motion commanded while disarmed" in broken(ask=())


@breaks_the_product
def test_motion_during_the_start_delay_is_seen(monkeypatch: Patch) -> None:
    drives_always(monkeypatch)
    assert "motion commanded while arming" in broken(settings={"safety": {"start_delay_s": 3.0}})


@breaks_the_product
def test_motion_after_disarming_is_seen(monkeypatch: Patch) -> None:
    disarm = Controller.disarm

    def forgetful(self: Controller, t_s: float, reason: str) -> None:
        disarm(self, t_s, reason)
        self.mode = Mode.ARMED

    monkeypatch.setattr(Controller, "disarm", forgetful)
    assert "rule 1: motion commanded" in broken(ask=(Command(0.0, "arm"), Command(3.0, "disarm")))


@breaks_the_product
def test_rover_that_arms_itself_is_seen(monkeypatch: Patch) -> None:
    tick = Controller.tick

    async def restless(self: Controller, t_s: float) -> None:
        if t_s > 2.0 and self.mode is Mode.DISARMED:
            self._begin_mission(t_s, 0.0)
        await tick(self, t_s)

    monkeypatch.setattr(Controller, "tick", restless)
    assert "rule 1: the rover armed itself" in broken(ask=())


# -- rule 2 ------------------------------------------------------------------------------------------------------------


@breaks_the_product
def test_gate_that_drives_on_in_a_hold_is_seen(monkeypatch: Patch) -> None:
    drives_always(monkeypatch, lambda gate: gate.level is Level.HOLD)
    assert "rule 2: motion commanded at level hold" in broken(BRIEFLY_NO_COMPASS)


@breaks_the_product
def test_gate_that_does_not_take_a_condition_for_what_it_is_is_seen(monkeypatch: Patch) -> None:
    monkeypatch.setattr("wayfarer.safety.gate.LEVELS", {**LEVELS, Condition.COMPASS_STALE: Level.NOTE})
    assert "rule 2: motion commanded at level hold" in broken(BRIEFLY_NO_COMPASS)


@breaks_the_product
def test_driver_that_does_not_send_a_stop_is_seen_within_a_period(monkeypatch: Patch) -> None:
    drive = SimMotors.drive

    async def deaf_to_zero(self: SimMotors, command: WheelCommand) -> WheelCommand:
        if command != STOP:
            return await drive(self, command)
        await drive(self, AHEAD)
        return STOP

    monkeypatch.setattr(SimMotors, "drive", deaf_to_zero)
    first = broken(BRIEFLY_NO_COMPASS, ask=(Command(1.0, "arm"),)).splitlines()[0]
    assert "rule 2: wheels are told" in first


@breaks_the_product
def test_board_whose_deadman_does_not_trip_is_seen_when_the_link_breaks(monkeypatch: Patch) -> None:
    monkeypatch.setattr("wayfarer.simhal.parts.DEADMAN_S", 5.0)
    assert "rule 2: wheels are told" in broken(Fault(3.0, inf, "motors", "silent"))


def test_link_that_breaks_is_left_to_the_deadman_and_no_rule_is_broken() -> None:
    assert broken(Fault(3.0, inf, "motors", "silent")) == ""


@breaks_the_product
def test_stop_path_that_stops_nothing_is_seen_after_the_end(monkeypatch: Patch) -> None:
    async def idle(self: Any) -> None:
        pass

    monkeypatch.setattr(Shutdown, "stop_wheels", idle)
    monkeypatch.setattr("wayfarer.simhal.parts.DEADMAN_S", inf)
    assert "rule 2: wheels are told" in broken()


# -- what is excused ---------------------------------------------------------------------------------------------------

UNPLUGGED = Fault(3.0, inf, "motors", "nack", Lost())
ON_A_WIRE: dict[str, Any] = {"rover": "forestrover", "depth": Depth.BUS, "settings": {"safety": {"start_delay_s": 0.0}}}


@breaks_the_product
def test_deadman_that_is_off_when_the_link_breaks_excuses_wheels_that_turn_on(monkeypatch: Patch) -> None:
    forget_the_deadman(monkeypatch)
    run_result = run_scenario(replace(UNTOUCHED, faults=(UNPLUGGED,), **ON_A_WIRE))
    assert run_result.broken == ()
    assert run_result.excused > 10


@breaks_the_product
def test_deadman_that_is_off_excuses_nothing_while_commands_arrive(monkeypatch: Patch) -> None:
    forget_the_deadman(monkeypatch)
    drive = Sabertooth.drive

    async def deaf_to_zero(self: Sabertooth, command: WheelCommand) -> WheelCommand:
        return await drive(self, command) if command != STOP else STOP

    monkeypatch.setattr(Sabertooth, "drive", deaf_to_zero)
    assert "rule 2: wheels are told" in broken(BRIEFLY_NO_COMPASS, **ON_A_WIRE)


@breaks_the_product
def test_deadman_that_is_on_and_does_not_trip_is_not_excused(monkeypatch: Patch) -> None:
    monkeypatch.setattr(SabertoothChip, "tick", lambda self: None)
    assert "rule 2: wheels are told" in broken(UNPLUGGED, **ON_A_WIRE)


def forget_the_deadman(monkeypatch: Patch) -> None:
    """A board that does not keep its serial timeout."""
    take = SabertoothChip._check

    def forgetful(self: SabertoothChip, *packet: int) -> None:
        take(self, *packet)
        self.settings.pop(14, None)

    monkeypatch.setattr(SabertoothChip, "_check", forgetful)


# -- rule 3 ------------------------------------------------------------------------------------------------------------


@breaks_the_product
def test_fault_that_clears_by_itself_is_seen(monkeypatch: Patch) -> None:
    judge = Gate._judge

    def forgiving(self: Gate, conditions: Any) -> None:
        self._fault = None
        judge(self, conditions)

    monkeypatch.setattr(Gate, "_judge", forgiving)
    assert "rule 3: a fault cleared by itself" in broken(Fault(3.0, 6.0, "compass", "silent"), for_s=12.0)


@breaks_the_product
def test_fault_that_leaves_the_rover_armed_is_seen(monkeypatch: Patch) -> None:
    monkeypatch.setattr(Controller, "disarm", lambda *_: None)
    assert "rule 3: a fault left the rover armed" in broken(NO_COMPASS, for_s=12.0)


# -- rule 4 ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", [{"heading_deg": nan}, {"heading_deg": 360.0}, {"roll_deg": inf}])
@breaks_the_product
def test_decision_on_what_cannot_be_is_seen(monkeypatch: Patch, wrong: dict[str, float]) -> None:
    tamper_with_what_is_seen(monkeypatch, wrong)
    assert "rule 4: a decision saw Observation" in broken()


@breaks_the_product
def test_decision_on_a_heading_that_nobody_read_is_seen(monkeypatch: Patch) -> None:
    tamper_with_what_is_seen(monkeypatch, {"heading_deg": 123.456})
    assert "which no compass said of late" in broken()


@breaks_the_product
def test_decision_on_a_heading_of_long_ago_is_seen(monkeypatch: Patch) -> None:
    monkeypatch.setattr(Detector, "update", blind_to_age(Detector.update))
    assert "which no compass said of late" in broken(NO_COMPASS)


def test_readings_that_are_no_numbers_reach_no_decision() -> None:
    assert broken(Fault(3.0, inf, "compass", "not_a_number", NotANumber("heading_deg", "nan"))) == ""


def tamper_with_what_is_seen(monkeypatch: Patch, wrong: dict[str, float]) -> None:
    observe = Controller._observe

    def tampered(self: Controller, *seen: Any) -> Observation | None:
        observation = observe(self, *seen)
        return observation and observation._replace(**wrong)  # type: ignore[arg-type]

    monkeypatch.setattr(Controller, "_observe", tampered)


def blind_to_age(update: Any) -> Any:
    """A detector that finds nothing wrong with itself."""

    def updated(self: Detector, tick: Tick) -> None:
        update(self, tick)
        tick.conditions = ()

    return updated


# -- rule 5 ------------------------------------------------------------------------------------------------------------


@breaks_the_product
def test_stop_without_a_reason_is_seen(monkeypatch: Patch) -> None:
    limit = Gate.limit

    def moody(self: Gate, wanted: WheelCommand, *, armed: bool) -> WheelCommand:
        self.calls = getattr(self, "calls", 0) + 1  # type: ignore[attr-defined]
        return STOP if self.calls == 60 else limit(self, wanted, armed=armed)  # type: ignore[attr-defined]

    monkeypatch.setattr(Gate, "limit", moody)
    assert "rule 5: the wheels were stopped and the log does not say why" in broken()


@breaks_the_product
def test_hold_that_no_event_tells_of_is_seen(monkeypatch: Patch) -> None:
    monkeypatch.setattr(Controller, "_note_health", lambda *_: None)
    assert "rule 5: the wheels were stopped for compass_stale, and no event said so" in broken(BRIEFLY_NO_COMPASS)


@breaks_the_product
def test_stop_that_the_algorithm_asked_for_needs_no_reason(monkeypatch: Patch) -> None:
    decide = PhasedHandler.decide

    def hesitant(self: Any, seen: Observation) -> Decision:
        decision = decide(self, seen)
        return decision._replace(wheels=STOP) if 3.0 < seen.t_s < 4.0 else decision

    monkeypatch.setattr(PhasedHandler, "decide", hesitant)
    assert broken() == ""


# -- the run itself ----------------------------------------------------------------------------------------------------


def test_loop_that_stands_still_breaks_no_rule() -> None:
    assert broken(Fault(3.0, 0.0, "process", "loop_stall", LoopStall(2.0))) == ""


@breaks_the_product
def test_error_that_nobody_awaits_counts_as_a_broken_rule(monkeypatch: Patch) -> None:
    def fails(*_: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setitem(EFFECTS, "silent", fails)
    assert "ZeroDivisionError" in broken(NO_COMPASS)
