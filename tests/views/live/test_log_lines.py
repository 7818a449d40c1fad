"""The log on the live page: sentences, without a single name of a key or a value of the log."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

import wayfarer
from tests.views.live.records import run_log, tick
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.log import FieldLog, Record
from wayfarer.safety.conditions import Condition
from wayfarer.views.live.log_lines import _EVENTS, LogLines, page_line
from wayfarer.views.text.wording import Tone

EVENTS: list[tuple[str, dict[str, Any], str]] = [
    ("opened", {"parts": ["sim compass", "sim motors"]}, "Its parts are open: sim compass, sim motors"),
    ("arming", {"start_delay_s": 10.0, "goal_heading_deg": None}, "Arming: in 10 s it drives straight ahead"),
    ("arming", {"start_delay_s": 0.0, "goal_heading_deg": 359.7}, "Arming: it drives towards 0°"),
    ("arming_refused", {"failed": ["battery", "log"]}, "Not armed, because these checks failed: battery, log"),
    ("armed", {"goal_heading_deg": 12.3}, "Armed: drives towards 12°"),
    ("disarmed", {"reason": "requested by a person"}, "Disarmed: requested by a person"),
    ("disarmed", {"reason": "fault: compass_lost"}, "Disarmed: fault: the compass has been silent for seconds"),
    ("hold", {}, "Held by an operator"),
    ("resume", {}, "Resumed by an operator"),
    ("goal", {"goal_heading_deg": 90.0}, "A new goal: drives towards 90°"),
    ("mark", {"text": "hit a log"}, "Mark: hit a log"),
    ("health", {"level": "hold", "cause": "compass_stale"}, "Wheels held until this clears: the compass is silent"),
    ("health", {"level": "well", "cause": None}, "No faults"),
    ("sensor_failed", {"sensor": "compass", "error": "no answer", "retry_in_s": 0.5},
     "The compass failed: no answer; it is tried again in 0.5 s"),
    ("part_failed", {"part": "gpsd", "error": "no daemon"}, "The gpsd did not open: no daemon"),
    ("part_troubles", {"part": "CMPS14", "counts": {"bus_errors": 3}}, "The CMPS14 carried on after 3 bus errors"),
    ("board_silent", {"error": "timeout"}, "The motor board did not answer: timeout"),
    ("motors_failed", {"error": "timeout"}, "The motors did not answer: timeout"),
    ("light_failed", {"error": "no pin"}, "The status light did not answer: no pin"),
    ("power", {"flags": "0x1", "text": "undervoltage"}, "The computer's supply: undervoltage"),
    ("clock_step", {"by_s": -3600.2}, "The computer's clock was set by -3600 s"),
    ("log_gap", {"dropped": 12}, "12 records could not be written into the log"),
    ("loop_stalled", {"stall_s": 0.41, "where": "a.py:1 f"}, "The control loop stood still for 0.4 s"),
    ("stop_not_confirmed", {"part": "board", "error": "silent"}, "The board did not confirm the stop: silent"),
    ("close_hangs", {"part": "camera"}, "The camera did not close in time"),
    ("control_error", {"error": "KeyError()"}, "An error inside wayfarer, in a command: KeyError()"),
    ("viewer_failed", {"error": "KeyError()"}, "An error inside wayfarer, in a viewer: KeyError()"),
    ("wheels_stopped", {"reason": "requested"}, "The wheels are stopped"),
]  # fmt: skip


@pytest.fixture
def told() -> list[list[str]]:
    return []


@pytest.fixture
def log(told: list[list[str]]) -> FieldLog:
    lines = LogLines()

    def take(record: Record) -> None:
        told.extend(page_line(line) for line in lines.take(record))

    return run_log(take)


@pytest.mark.parametrize(("event", "details", "sentence"), EVENTS, ids=lambda value: str(value)[:30])
def test_event_is_a_sentence(
    log: FieldLog, told: list[list[str]], event: str, details: dict[str, Any], sentence: str
) -> None:
    log.event(event, 101.5, **details)
    assert told[-1][:2] == ["0:00:01.5", sentence]
    assert "_" not in told[-1][1]


def test_every_sentence_is_shown_here() -> None:
    assert {event for event, _, _ in EVENTS} == set(_EVENTS)


def test_every_event_that_a_rover_writes_has_a_sentence() -> None:
    """But for the run before, whose end the narrator tells in a sentence already."""
    found: set[str] = set()
    for part in ("control", "daemon", "fieldlog"):
        for path in (Path(wayfarer.__file__).parent / part).rglob("*.py"):
            calls = [
                node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)
            ]
            for call in calls:
                named = call.args[0] if call.args else None
                if getattr(call.func, "attr", "") == "event" and isinstance(named, ast.Constant):
                    found.add(str(named.value))
    assert len(found) > 15
    assert found - set(_EVENTS) == {"unclean_shutdown"}


def test_health_has_words_for_every_condition(log: FieldLog, told: list[list[str]]) -> None:
    for condition in Condition:
        log.event("health", 101.0, level="hold", cause=condition.value)
        assert "_" not in told[-1][1]


def test_change_of_phase_says_what_it_does_and_why(log: FieldLog, told: list[list[str]]) -> None:
    log.tick(tick(100.0, phase=Phase.FOLLOW))
    log.tick(tick(101.0, phase=Phase.BACK_OFF, why="follow.anomaly", anomalies=(Anomaly.IMMOBILISED,)))
    log.tick(tick(102.0, phase=Phase.TURN_AWAY, why="back_off.done"))
    assert [text for _, text, _ in told[1:]] == [
        "Follows the goal heading",
        "Backs off, because stalled, on its way to the goal",
        "Turns away, because the back-off was done",
    ]


def test_state_between_changes_is_no_line(log: FieldLog, told: list[list[str]]) -> None:
    for step in range(400):
        log.tick(tick(100.0 + step * 0.05, phase=Phase.FOLLOW))
    assert len(told) == 2, "the run and its first phase"


def test_missing_records_are_told_before_the_event_that_shows_it(told: list[list[str]]) -> None:
    lines = LogLines()
    lines.take({"record": "event", "n": 1, "t_s": 100.0, "name": "hold"})
    gap, event = lines.take({"record": "event", "n": 5, "t_s": 101.0, "name": "resume"})
    assert (gap.tone, event.text) == (Tone.WARNING, "Resumed by an operator")
    assert "3" in gap.text


def test_event_without_its_details_is_told_and_an_unknown_one_as_it_is(log: FieldLog, told: list[list[str]]) -> None:
    for event in _EVENTS:
        log.event(event, 101.0)
    log.event("moon_rose", 102.0, phase="full")
    assert told[-1][1] == "moon rose: phase full"


def test_end_is_told_without_the_name_of_its_reason(log: FieldLog, told: list[list[str]]) -> None:
    log.close("mission_time", "the mission took 600 s")
    assert told[-1][1:] == ["The run has ended: the mission took 600 s", "end"]
