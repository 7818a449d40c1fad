"""The table of modes: what it does not have is refused and changes nothing, and wheels turn in two modes only."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from tests.control.bench import HOME, TICK_S, Bench
from wayfarer.control.modes import MAY_TURN, MODES, Entered, Event, Mode, Outcome, Refused, refusal
from wayfarer.control.tick import BoardReport, Inbox
from wayfarer.hal import STOP, CompassReading, MotorHealth, WheelCommand
from wayfarer.safety.manual import ManualSample

PAGE = Path(__file__).parents[2] / "docs/explanation/what-stops-the-wheels.md"
Ask = Callable[[Bench], Outcome]
ASKS: dict[Event, Ask] = {
    Event.ARM: lambda it: it.controller.arm(it.t_s, 0.0),
    Event.DISARM: lambda it: it.controller.disarm(it.t_s, "asked to"),
    Event.MANUAL: lambda it: it.controller.begin_manual(it.t_s, 7, "page"),
    Event.END_MANUAL: lambda it: it.controller.end_manual(it.t_s, "asked to"),
    Event.HOLD: lambda it: it.controller.hold(it.t_s),
    Event.RESUME: lambda it: it.controller.resume(it.t_s),
    Event.GOAL: lambda it: it.controller.set_goal(it.t_s, 90.0),
    Event.BOARD_OPENED: lambda it: it.controller.motors_opened(it.t_s),
}
WAYS: dict[Mode, tuple[Event, ...]] = {
    Mode.DISARMED: (),
    Mode.ARMING: (Event.ARM,),
    Mode.ARMED: (Event.ARM,),
    Mode.MANUAL: (Event.MANUAL,),
}


async def in_mode(mode: Mode) -> Bench:
    """A rover in this mode."""
    bench = Bench()
    await bench.tick()
    for event in WAYS[mode]:
        ASKS[event](bench)
    if mode is not Mode.ARMING:
        await bench.tick()
    assert bench.controller.mode is mode
    return bench


@pytest.mark.parametrize(("mode", "event"), list(product(Mode, ASKS)))
async def test_event_does_what_the_table_says_or_is_refused_and_changes_nothing(mode: Mode, event: Event) -> None:
    bench = await in_mode(mode)
    events, held = len(bench.log.events), bench.controller.held
    why_not = bench.controller.why_not(event)
    outcome = ASKS[event](bench)
    row = MODES.get((mode, event))
    if row is None:
        assert outcome == Refused(refusal(mode, event))
        assert why_not == refusal(mode, event) != ""
        assert (bench.controller.mode, bench.controller.held, len(bench.log.events)) == (mode, held, events)
    else:
        assert outcome == Entered(bench.controller.mode)
        assert bench.controller.mode is (row.to or Mode.DISARMED)
        assert not why_not


def test_stop_is_in_the_table_for_each_mode_in_which_wheels_may_turn() -> None:
    for mode in Mode:
        assert (mode, Event.DISARM) in MODES
    for mode in (*MAY_TURN, Mode.ARMING):
        assert (mode, Event.HOLD) in MODES


def test_table_is_in_the_documentation() -> None:
    lines = ["| mode | event | mode after it | what is done |", "|---|---|---|---|"]
    for (mode, event), row in MODES.items():
        lines.append(f"| {mode.value} | {event.value} | {row.to.value if row.to else 'as before'} | {row.does} |")
    text = PAGE.read_text(encoding="utf-8").partition("<!-- modes -->\n")[2].partition("\n<!-- /modes -->")[0]
    assert text == "\n".join(lines)


class Walk(RuleBasedStateMachine):
    """Any requests, ticks and failures in any order.

    The wheels turn only if somebody has asked for it since a stop, and if the board was opened since it failed.
    """

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench()
        self.controller, self.inbox = self.bench.controller, Inbox()
        self.may_turn = False  # whether somebody has asked for it since the latest stop
        # Whether the board was opened since it failed; ``Supervisor`` opens that of a rover at rest.
        self.opened = False
        self.seq = 0
        self.heading_deg = 0.0
        self.applied = STOP

    @rule(event=st.sampled_from(list(ASKS)))
    def asks(self, event: Event) -> None:
        rests = self.controller.mode is Mode.DISARMED
        outcome = ASKS[event](self.bench)
        if isinstance(outcome, Entered) and (rests or event is Event.BOARD_OPENED):
            self.opened = True
        if event in {Event.ARM, Event.MANUAL, Event.RESUME} and isinstance(outcome, Entered):
            self.may_turn = True
        if event in {Event.DISARM, Event.HOLD, Event.END_MANUAL} and isinstance(outcome, Entered):
            self.may_turn = False

    @rule(health=st.sampled_from((MotorHealth(12.0, ()), MotorHealth(12.0, ("motor A: drive fault",)), None)))
    def board_says(self, health: MotorHealth | None) -> None:
        self.inbox.put_board(BoardReport(self.bench.t_s, health, error="" if health else "no answer"))

    @rule(flags=st.sampled_from((0, 0x50005)), fix=st.booleans())
    def others_say(self, flags: int, fix: bool) -> None:
        self.inbox.put_power(self.bench.t_s, flags)
        self.inbox.put_fix(HOME if fix else None)

    @rule(
        count=st.integers(1, 8), compass=st.booleans(), fails=st.booleans(), by_hand=st.sampled_from((None, 0.5, -1.0))
    )
    def ticks(self, count: int, compass: bool, fails: bool, by_hand: float | None) -> None:
        """Tick; a person who drives lets go of the stick first."""
        for n in range(count):
            self.bench.t_s += TICK_S
            if by_hand is not None:
                self.seq += 1
                sample = ManualSample(self.seq, by_hand if n else 0.0, 0.0, self.bench.t_s)
                self.controller.manual.take(self.bench.t_s, sample)
            if compass:
                self.inbox.put_compass(CompassReading(self.bench.t_s, self.heading_deg, 0.0, 0.0, None))
            tick = self.controller.step(self.inbox.take(self.bench.t_s))
            if tick.wheels != STOP:
                assert self.may_turn, "the wheels turn, and nobody has asked for it since a stop"
                assert self.opened, "the wheels turn, and the board was not opened since it failed"
            self.inbox.next.applied = WheelCommand(*tick.wheels)
            if fails and not n:
                self.inbox.next.applied = STOP
                self.controller.motors_lost(self.bench.t_s, "no acknowledgement")
                self.opened = False
            self.may_turn &= self.controller.mode is not Mode.DISARMED

    @invariant()
    def mission_and_mode_agree(self) -> None:
        if self.controller.mode is Mode.ARMED:
            assert self.controller.mission is not None
        if self.controller.mode in {Mode.DISARMED, Mode.ARMING}:
            assert self.controller.mission is None

    @invariant()
    def whoever_is_held_may_resume(self) -> None:
        if self.controller.held:
            assert not self.controller.why_not(Event.RESUME)


Walk.TestCase.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)
TestWalk = Walk.TestCase
