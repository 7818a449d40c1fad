"""What is said between two ticks counts from the next, and the board's word is held against what it was told."""

from __future__ import annotations

from itertools import product
from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.control.power_reports import PowerReports
from wayfarer.control.run_log import PartialLog
from wayfarer.hal import STOP, MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.power import SAME_DUTY
from wayfarer.safety.settings import BoardSettings

WELL = MotorHealth(12.0, ())
AHEAD, TURN = WheelCommand(0.5, 0.5), WheelCommand(0.5, -0.5)
DISAGREES = (Condition.BOARD_DISAGREES,)
COMMANDS = st.builds(WheelCommand, st.floats(-1, 1), st.floats(-1, 1))


class Log(PartialLog):
    """Keeps what is written, in its order."""

    def __init__(self) -> None:
        self.written: list[tuple[object, ...]] = []

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.written.append((name, t_s, details))

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        self.written.append(("board", t_s, duties))


def said(duties: WheelCommand | None, *ticks: WheelCommand, times: int = 2) -> tuple[Condition, ...]:
    """What is wrong once these commands were applied and the board has said the same so often."""
    power_reports = PowerReports(BoardSettings(), Log())
    for applied in ticks[:-1]:
        power_reports.judge(applied)
    for _ in range(times):
        power_reports.board_said(1.0, WELL, duties)
        power_reports.judge(ticks[-1])
    return power_reports.conditions(1.0)


def test_report_counts_and_is_logged_when_the_next_tick_begins() -> None:
    log = Log()
    power_reports = PowerReports(BoardSettings(), log)
    power_reports.board_said(1.01, WELL, AHEAD)
    power_reports.board_silent(1.02, "no answer")
    power_reports.power(1.03, 0x1)
    assert (log.written, power_reports.conditions(1.04)) == ([], ())
    assert power_reports.judge(STOP)
    assert power_reports.conditions(1.05) == (Condition.BOARD_SILENT, Condition.UNDERVOLTAGE)
    assert log.written == [
        ("board", 1.01, AHEAD),
        ("board_silent", 1.02, {"error": "no answer"}),
        ("power", 1.03, {"flags": "0x1", "text": "under-voltage now"}),
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
    power_reports = PowerReports(BoardSettings(), Log())
    for count, applied in enumerate(commands):
        recent = [STOP, STOP, STOP, *commands[: count + 1]][-3:]
        left, right = (data.draw(st.sampled_from(recent)) for _ in range(2))
        power_reports.board_said(float(count), WELL, WheelCommand(left.left, right.right))
        assert not power_reports.judge(applied)


def test_power_is_told_when_it_changes_only() -> None:
    log = Log()
    power_reports = PowerReports(BoardSettings(), log)
    for t_s, flags in enumerate([None, 0, 0, 1, 1, 0x10000, None, 0x10000]):
        power_reports.power(float(t_s), flags)
        power_reports.judge(STOP)
    assert [(t_s, details["flags"]) for _, t_s, details in log.written if isinstance(details, dict)] == [
        (3.0, "0x1"), (5.0, "0x10000"), (6.0, "0x0"), (7.0, "0x10000"),
    ]  # fmt: skip
