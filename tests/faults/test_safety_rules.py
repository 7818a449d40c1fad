"""The checker of the safety rules is itself checked: each rule is broken on purpose, and it must say so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan
from typing import Any

import pytest

from tests.faults.broken_product import breaks_the_product
from wayfarer.control.controller import Controller
from wayfarer.control.modes import Entered, Mode, Outcome
from wayfarer.control.shutdown import Shutdown
from wayfarer.control.tick import Inputs, TickRecord
from wayfarer.detector import Detector
from wayfarer.detector.detector import DetectorTick
from wayfarer.drivers.sabertooth import Sabertooth
from wayfarer.escape.api import Decision, Observation
from wayfarer.escape.handler import PhasedHandler
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import LEVELS, Condition, Level
from wayfarer.safety.gate import Gate, ResumeWarning
from wayfarer.simhal.chips.motor_boards import SabertoothChip
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.process import LoopStall
from wayfarer.simhal.faults.readings import LateAnswer, NotANumber, Silent
from wayfarer.simhal.parts import SimMotors
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.scenario import Command, Expectation, ResponseLevel, Scenario
from wayfarer.testing.scenario_run import run_scenario

AHEAD = WheelCommand(0.3, 0.3)
NO_COMPASS = Fault(3.0, inf, "compass", "silent")
BRIEFLY_NO_COMPASS = Fault(3.0, 1.0, "compass", "silent")
HARMLESS = Fault(100.0, inf, "compass", "silent")
UNTOUCHED = Scenario(
    name="test", expect=Expectation(ResponseLevel.NONE, 0.0), faults=(HARMLESS,),
    rover="sim", depth=Depth.DEVICE, for_s=6.0, clearing=True,
)  # fmt: skip

Patch = pytest.MonkeyPatch
Break = Callable[[Patch], None]


def broken(*faults: Fault, ask: tuple[Command, ...] = (Command(0.0, "arm"),), **changes: Any) -> str:
    """What the checker says of a run with these faults."""
    run_result = run_scenario(replace(UNTOUCHED, faults=faults or (HARMLESS,), commands=ask, **changes))
    return "\n".join(run_result.broken)


# -- rules that are kept -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", list(Depth))
@pytest.mark.parametrize("fault", [HARMLESS, NO_COMPASS, BRIEFLY_NO_COMPASS])
def test_honest_field_code_breaks_no_rule(fault: Fault, depth: Depth) -> None:
    assert broken(fault, depth=depth) == ""


@pytest.mark.parametrize(
    "fault",
    [
        Fault(3.0, inf, "motors", "silent"),  # is left to the board's deadman
        Fault(3.0, 0.5, "motors", "silent"),  # and the board is opened again
        Fault(3.0, inf, "compass", "not_a_number", NotANumber("heading_deg", "nan")),  # reaches no decision
        Fault(3.0, 0.0, "process", "loop_stall", LoopStall(2.0)),
    ],
    ids=lambda fault: fault.kind,
)
def test_fault_that_is_met_breaks_no_rule(fault: Fault) -> None:
    assert broken(fault) == ""


def test_rover_that_is_disarmed_while_its_motor_board_takes_its_time_has_a_reason_to_stop() -> None:
    """The record of the tick that waits for the board comes after the event."""
    late = Fault(3.0, inf, "motors", "late_answer", LateAnswer(by_s=0.14))
    moments = [3.0 + 0.03 * number for number in range(1, 6)]
    said = [broken(late, ask=(Command(0.0, "arm"), Command(at_s, "disarm"))) for at_s in moments]
    assert said == [""] * len(moments)


@breaks_the_product
def test_stop_that_the_algorithm_asked_for_needs_no_reason(monkeypatch: Patch) -> None:
    decide = PhasedHandler.decide

    def hesitant(self: Any, seen: Observation) -> Decision:
        decision = decide(self, seen)
        return decision._replace(wheels=STOP) if 3.0 < seen.t_s < 4.0 else decision

    monkeypatch.setattr(PhasedHandler, "decide", hesitant)
    assert broken() == ""


# -- ways to break them ------------------------------------------------------------------------------------------------


def gate_drives(monkeypatch: Patch, when: Callable[[Gate], bool] = lambda _: True) -> None:
    """A gate that lets the wheels turn, whatever is wrong."""
    judge, limit = Gate.judge, Gate.limit

    def open_judge(self: Gate, *arguments: Any, armed: bool) -> bool:
        return judge(self, *arguments, armed=armed) or when(self)

    monkeypatch.setattr(Gate, "judge", open_judge)
    monkeypatch.setattr(Gate, "limit", lambda self, wanted: AHEAD if when(self) else limit(self, wanted))
    monkeypatch.setattr(Controller, "may_turn", True)  # else the shell halts after each command


def gate_drives_in_a_hold(monkeypatch: Patch) -> None:
    gate_drives(monkeypatch, lambda gate: gate.level is Level.HOLD)


def condition_is_taken_for_another(monkeypatch: Patch) -> None:
    wrong = {**LEVELS, Condition.COMPASS_STALE: Level.NOTE}
    monkeypatch.setattr("wayfarer.safety.gate.levels_for", lambda _: wrong)


def disarming_is_forgotten(monkeypatch: Patch) -> None:
    disarm = Controller._disarm

    def forgetful(self: Controller, reason: str) -> Outcome:
        disarm(self, reason)
        self.mode = Mode.ARMED
        return Entered(self.mode)

    monkeypatch.setattr(Controller, "_disarm", forgetful)


def rover_arms_itself(monkeypatch: Patch) -> None:
    step = Controller.step

    def restless(self: Controller, inputs: Inputs) -> TickRecord:
        if inputs.t_s > 2.0 and self.mode is Mode.DISARMED:
            self._begin_mission(inputs.t_s, 0.0)
            self.mode = Mode.ARMED
        return step(self, inputs)

    monkeypatch.setattr(Controller, "step", restless)


def driver_sends_no_stop(monkeypatch: Patch) -> None:
    drive = SimMotors.drive_without_waiting

    def deaf_to_zero(self: SimMotors, now_s: float, command: WheelCommand) -> WheelCommand:
        if command != STOP:
            return drive(self, now_s, command)
        drive(self, now_s, AHEAD)
        return STOP

    monkeypatch.setattr(SimMotors, "drive_without_waiting", deaf_to_zero)


def deadman_trips_late(monkeypatch: Patch) -> None:
    monkeypatch.setattr("wayfarer.simhal.parts.DEADMAN_S", 5.0)


def end_stops_nothing(monkeypatch: Patch) -> None:
    async def idle(self: Any) -> None:
        pass

    monkeypatch.setattr(Shutdown, "stop_wheels", idle)
    monkeypatch.setattr("wayfarer.simhal.parts.DEADMAN_S", inf)


def sabertooth_forgets_its_deadman(monkeypatch: Patch) -> None:
    take = SabertoothChip._check

    def forgetful(self: SabertoothChip, *packet: int) -> None:
        take(self, *packet)
        self.settings.pop(14, None)

    monkeypatch.setattr(SabertoothChip, "_check", forgetful)


def sabertooth_hears_no_stop_and_has_no_deadman(monkeypatch: Patch) -> None:
    sabertooth_forgets_its_deadman(monkeypatch)
    drive = Sabertooth.drive

    async def deaf_to_zero(self: Sabertooth, command: WheelCommand) -> WheelCommand:
        return await drive(self, command) if command != STOP else STOP

    monkeypatch.setattr(Sabertooth, "drive", deaf_to_zero)


def sabertooths_deadman_does_not_trip(monkeypatch: Patch) -> None:
    monkeypatch.setattr(SabertoothChip, "tick", lambda self: None)


def fault_clears_by_itself(monkeypatch: Patch) -> None:
    judge = Gate._judge

    def forgiving(self: Gate, conditions: Any) -> None:
        self._fault = None
        judge(self, conditions)

    monkeypatch.setattr(Gate, "_judge", forgiving)


def fault_leaves_the_rover_armed(monkeypatch: Patch) -> None:
    monkeypatch.setattr(Controller, "_disarm", lambda *_: None)


def handler_sees(**wrong: float) -> Break:
    """Tamper with what every decision sees."""

    def spoil(monkeypatch: Patch) -> None:
        observe = Controller._observe

        def tampered(self: Controller, *seen: Any) -> Observation | None:
            observation = observe(self, *seen)
            return observation and observation._replace(**wrong)

        monkeypatch.setattr(Controller, "_observe", tampered)

    return spoil


def detector_is_blind_to_age(monkeypatch: Patch) -> None:
    update = Detector.update

    def updated(self: Detector, tick: DetectorTick, *, armed: bool = False) -> None:
        update(self, tick)
        tick.conditions = ()

    monkeypatch.setattr(Detector, "update", updated)


def gate_stops_once_for_nothing(monkeypatch: Patch) -> None:
    honest = Gate.limit

    def moody(self: Gate, wanted: WheelCommand) -> WheelCommand:
        self.calls = getattr(self, "calls", 0) + 1  # type: ignore[attr-defined]
        applied = honest(self, wanted)
        return STOP if self.calls == 60 else applied  # type: ignore[attr-defined]

    monkeypatch.setattr(Gate, "limit", moody)


def hold_is_not_told(monkeypatch: Patch) -> None:
    monkeypatch.setattr(Controller, "_note_health", lambda *_: None)


def board_is_not_opened_again(monkeypatch: Patch) -> None:
    add_conditions = Controller._add_conditions

    def forgetful(self: Controller, tick: TickRecord) -> None:
        self.motors_failed = False
        add_conditions(self, tick)

    monkeypatch.setattr(Controller, "_add_conditions", forgetful)


def rover_does_not_warn(monkeypatch: Patch) -> None:
    monkeypatch.setattr(ResumeWarning, "update", lambda *_: False)


def injection_fails(monkeypatch: Patch) -> None:
    def fails(*_: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(Silent, "effect", fails)


# -- each of them is seen ----------------------------------------------------------------------------------------------

LATE_BOARD = Fault(2.0, inf, "motors", "late_answer", LateAnswer(by_s=0.1))  # hides when the wheels may turn
NO_LINK = Fault(3.0, inf, "motors", "silent")
UNPLUGGED = Fault(3.0, inf, "motors", "nack")
BRIEFLY_NO_LINK = Fault(3.0, 0.5, "motors", "silent")
LONG_NO_COMPASS = Fault(3.0, 6.0, "compass", "silent")
ARMED = Command(0.0, "arm")
# For these rovers a lost compass is a fault.
AMONG_PEOPLE: dict[str, Any] = {"for_s": 12.0, "settings": {"safety": {"on_lost_sense": "hold"}}}
SLOW_START: dict[str, Any] = {"settings": {"safety": {"start_delay_s": 3.0}}}
ON_A_WIRE: dict[str, Any] = {"rover": "forestrover", "depth": Depth.BUS, "settings": {"safety": {"start_delay_s": 0.0}}}
WHEELS_TURN = "rule 2: wheels are commanded to"
DRIVES_IN_A_HOLD = "rule 2: motion commanded at level hold"
UNOPENED = "rule 2: motion commanded for a motor board that failed"
NOBODY_READ = "which no recent compass reading has"

BROKEN: list[tuple[Break, tuple[Fault, ...], dict[str, Any], str]] = [
    (gate_drives, (), {"ask": ()}, "rule 1: motion commanded while disarmed"),
    (gate_drives, (), SLOW_START, "rule 1: motion commanded while arming"),
    (disarming_is_forgotten, (), {"ask": (ARMED, Command(3.0, "disarm"))}, "rule 1: motion commanded"),
    (rover_arms_itself, (), {"ask": ()}, "rule 1: the rover armed itself"),
    (gate_drives, (NO_COMPASS, LATE_BOARD), {}, "rule 2: wheels are commanded to 0.30, 0.30"),
    (gate_drives_in_a_hold, (BRIEFLY_NO_COMPASS,), {}, DRIVES_IN_A_HOLD),
    (condition_is_taken_for_another, (BRIEFLY_NO_COMPASS,), {}, DRIVES_IN_A_HOLD),
    (driver_sends_no_stop, (BRIEFLY_NO_COMPASS,), {"ask": (Command(1.0, "arm"),)}, WHEELS_TURN),
    (deadman_trips_late, (NO_LINK,), {}, WHEELS_TURN),
    (board_is_not_opened_again, (BRIEFLY_NO_LINK,), {}, UNOPENED),
    (rover_does_not_warn, (BRIEFLY_NO_LINK,), {"for_s": 12.0}, UNOPENED),
    (end_stops_nothing, (), {}, WHEELS_TURN),
    (sabertooth_hears_no_stop_and_has_no_deadman, (BRIEFLY_NO_COMPASS,), ON_A_WIRE, WHEELS_TURN),
    (sabertooths_deadman_does_not_trip, (UNPLUGGED,), ON_A_WIRE, WHEELS_TURN),
    (fault_clears_by_itself, (LONG_NO_COMPASS,), AMONG_PEOPLE, "rule 3: a fault cleared by itself"),
    (
        fault_leaves_the_rover_armed,
        (NO_COMPASS,),
        AMONG_PEOPLE,
        "rule 3: a fault left the rover armed",
    ),
    (handler_sees(heading_deg=nan), (), {}, "rule 4: a decision saw Observation"),
    (handler_sees(heading_deg=360.0), (), {}, "rule 4: a decision saw Observation"),
    (handler_sees(roll_deg=inf), (), {}, "rule 4: a decision saw Observation"),
    (handler_sees(heading_deg=123.456), (), {}, NOBODY_READ),
    (detector_is_blind_to_age, (NO_COMPASS,), {}, NOBODY_READ),
    (gate_stops_once_for_nothing, (), {}, "rule 5: the wheels were stopped and the log does not say why"),
    (hold_is_not_told, (BRIEFLY_NO_COMPASS,), {}, "rule 5: the wheels were stopped for compass_stale, and no event"),
    (injection_fails, (NO_COMPASS,), {}, "ZeroDivisionError"),
]


@breaks_the_product
@pytest.mark.parametrize(("spoil", "faults", "run", "says"), BROKEN)
def test_broken_rule_is_seen(
    monkeypatch: Patch, spoil: Break, faults: tuple[Fault, ...], run: dict[str, Any], says: str
) -> None:
    spoil(monkeypatch)
    said = broken(*faults, **run)
    assert says in (said if spoil is gate_drives else said.partition("\n")[0])  # that gate breaks rule 1 from the start


@breaks_the_product
def test_deadman_that_is_off_when_the_link_breaks_excuses_wheels_that_turn_on(monkeypatch: Patch) -> None:
    sabertooth_forgets_its_deadman(monkeypatch)
    run_result = run_scenario(replace(UNTOUCHED, faults=(UNPLUGGED,), **ON_A_WIRE))
    assert run_result.broken == ()
    assert run_result.excused > 10
