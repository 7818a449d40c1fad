"""What a person sees of a run on the terminal."""

from __future__ import annotations

import pytest

from wayfarer.control.tick_record import TickRecord
from wayfarer.daemon.console_log import ConsoleLog
from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.hal import STOP, PositionFix


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def log(said: list[str]) -> ConsoleLog:
    return ConsoleLog(said.append, "Say go")


def record(phase: Phase, why: str = "", *anomalies: Anomaly, seen: bool = True) -> TickRecord:
    observation = Observation(5.0, 271.6, 0.0, 0.0, anomalies, None, 90.0, 12.34) if seen else None
    return TickRecord(5.0, observation=observation, decision=Decision(STOP, phase, why or phase.value))


def test_each_change_of_phase_is_one_line_that_says_why_and_where(log: ConsoleLog, said: list[str]) -> None:
    for _ in range(20):
        log.tick(record(Phase.FOLLOW))
    log.tick(record(Phase.BACK_OFF, "follow.anomaly", Anomaly.IMMOBILISED, Anomaly.NOSE_UP))
    log.tick(record(Phase.BACK_OFF))
    assert said == [
        "Follows the goal heading: heading 272, 12.3 m",
        "Backs off (stalled, nose up, on its way to the goal): heading 272, 12.3 m",
    ]


def test_rover_that_stands_says_nothing(log: ConsoleLog, said: list[str]) -> None:
    for _ in range(20):
        log.tick(record(Phase.HALT, seen=False))
    assert said == []


def test_phase_that_comes_back_is_told_again(log: ConsoleLog, said: list[str]) -> None:
    for phase in (Phase.FOLLOW, Phase.HALT, Phase.FOLLOW):
        log.tick(record(phase))
    assert [line.split()[0] for line in said] == ["Follows", "Stopped:", "Follows"]


@pytest.mark.parametrize(
    ("name", "details", "line"),
    [
        ("armed", {"goal_heading_deg": 123.456}, "armed: goal heading 123.5 degrees"),
        ("wheels_stopped", {}, "wheels stopped"),
        ("health", {"level": "well", "cause": None}, "health: well"),
        ("sensor_failed", {"sensor": "compass", "retry_in_s": 1.6}, "sensor failed: sensor compass, retry in 1.6 s"),
        ("hold", {}, "hold"),
        (
            "part_troubles",
            {"part": "CMPS14", "counts": {"reads retried": 3}},
            "part troubles: part CMPS14, counts 3 reads retried",
        ),
    ],
)
def test_event_is_a_line(log: ConsoleLog, said: list[str], name: str, details: dict[str, object], line: str) -> None:
    log.event(name, 3.0, **details)
    assert said == [line]


def test_positions_are_not_shown_and_the_end_is(log: ConsoleLog, said: list[str]) -> None:
    log.position(PositionFix(0.0, 52.0, 13.0, 3.0))
    log.position(None)
    log.close("mission_time", "the mission limit of 900 s was reached")
    assert said == ["ended: mission_time: the mission limit of 900 s was reached"]


def test_nothing_that_a_terminal_obeys_gets_through(said: list[str], log: ConsoleLog) -> None:
    log.event("mark", 1.0, text="hit \x1b[31mlog\u202e\nagain")
    assert said == [r"mark: hit \x1b[31mlog\u202e\nagain"]
