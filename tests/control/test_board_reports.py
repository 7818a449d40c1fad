"""What is said between two ticks counts from the next, and the board's word is checked against what it was told."""

from __future__ import annotations

from itertools import product
from math import nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.bench import Wanting
from tests.kit.workshop import VEHICLE, own_details
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.controller import Controller
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import BoardReport, Inbox
from wayfarer.detector import Detector
from wayfarer.hal import STOP, MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.power import SAME_DUTY

WELL = MotorHealth(12.0, ())
AHEAD, TURN = WheelCommand(0.5, 0.5), WheelCommand(0.5, -0.5)
DISAGREES = (Condition.BOARD_DISAGREES,)
OF_THE_BOARD = {Condition.BOARD_DISAGREES, Condition.BOARD_SILENT, Condition.UNDERVOLTAGE}
COMMANDS = st.builds(WheelCommand, st.floats(-1, 1), st.floats(-1, 1))


class Log(RunLog):
    """Keeps what is written, in its order."""

    def __init__(self) -> None:
        self.written: list[tuple[str, float, Any]] = []

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.written.append((name, t_s, own_details(details)))

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        self.written.append(("board", t_s, duties))


class Hearing:
    """A disarmed controller and its inbox: what it says of board and supply."""

    def __init__(self) -> None:
        self.log, self.inbox = Log(), Inbox()
        config = RoverConfig(name="bench", vehicle=VEHICLE)
        self._controller = Controller(config, Detector(config.detector, VEHICLE), Wanting(), self.log, ladder_seed=1)
        self._t_s = 0.0

    def tick(self, applied: WheelCommand) -> tuple[Condition, ...]:
        """What is wrong at the next tick; the tick before it has applied this."""
        self._t_s += 0.05
        self.inbox.next.applied = applied
        found = self._controller.step(self.inbox.take(self._t_s)).conditions
        return tuple(each for each in found if each in OF_THE_BOARD)


def said(duties: WheelCommand | None, *ticks: WheelCommand, times: int = 2) -> tuple[Condition, ...]:
    """What is wrong once these commands were applied and the board has said the same so often."""
    hearing = Hearing()
    found: tuple[Condition, ...] = ()
    for applied in ticks[:-1]:
        hearing.tick(applied)
    for _ in range(times):
        hearing.inbox.put_board(BoardReport(1.0, WELL, duties))
        found = hearing.tick(ticks[-1])
    return found


def test_report_counts_and_is_logged_when_the_next_tick_begins() -> None:
    hearing = Hearing()
    hearing.inbox.put_board(BoardReport(1.01, WELL, AHEAD))
    hearing.inbox.put_board(BoardReport(1.02, None, error="no answer"))
    hearing.inbox.put_power(1.03, 0x1)
    assert hearing.log.written == []
    assert hearing.tick(STOP) == (Condition.BOARD_SILENT, Condition.UNDERVOLTAGE)
    assert hearing.log.written[:3] == [
        ("board", 1.01, AHEAD),
        ("board_silent", 1.02, {"error": "no answer"}),
        ("power", 1.03, {"flags": "0x1"}),
    ]


@pytest.mark.parametrize(
    ("duties", "ticks"),
    [
        (STOP, [STOP]),
        (None, [AHEAD]),
        (AHEAD, [AHEAD, STOP, STOP]),
        (WheelCommand(0.5, 0.5 + SAME_DUTY / 2), [AHEAD, AHEAD, AHEAD]),
        (WheelCommand(0.5, -0.5), [AHEAD, TURN, TURN]),
        (WheelCommand(0.0, 0.5), [AHEAD, AHEAD, STOP]),  # one side was asked before the stop, the other after it
    ],
)
def test_board_that_says_what_it_was_told_of_late_is_believed(
    duties: WheelCommand | None, ticks: list[WheelCommand]
) -> None:
    assert said(duties, *ticks, times=1) == ()


@pytest.mark.parametrize(
    ("applied", "duties"),
    [
        *product([STOP, AHEAD], [WheelCommand(0.3, 0.3), WheelCommand(-0.5, 0.5), WheelCommand(nan, nan)]),
        (AHEAD, STOP),
    ],
)
def test_board_that_says_something_else_twice_is_a_fault(applied: WheelCommand, duties: WheelCommand) -> None:
    commands = [applied] * 5
    assert said(duties, *commands, times=1) == ()
    assert said(duties, *commands, times=2) == DISAGREES


@given(st.lists(COMMANDS, min_size=3, max_size=30), st.data())
def test_answers_that_interleave_with_commands_are_never_a_fault(
    commands: list[WheelCommand], data: st.DataObject
) -> None:
    """Each side is asked amid any of the last three commands."""
    hearing = Hearing()
    for count, applied in enumerate(commands):
        recent = [STOP, STOP, STOP, *commands[: count + 1]][-3:]
        left, right = (data.draw(st.sampled_from(recent)) for _ in range(2))
        hearing.inbox.put_board(BoardReport(float(count), WELL, WheelCommand(left.left, right.right)))
        assert not hearing.tick(applied)


def test_power_is_told_when_it_changes_only() -> None:
    hearing = Hearing()
    for t_s, flags in enumerate([None, 0, 0, 1, 1, 0x10000, None, 0x10000]):
        hearing.inbox.put_power(float(t_s), flags)
        hearing.tick(STOP)
    told = [(t_s, details["flags"]) for _, t_s, details in hearing.log.written if "flags" in details]
    assert told == [(3.0, "0x1"), (5.0, "0x10000"), (6.0, "0x0"), (7.0, "0x10000")]
