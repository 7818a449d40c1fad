"""A run told in lines: what a person reads of it."""

from __future__ import annotations

import pytest

from tests.logview.records import HEADER, Json, drive, event, narrated, noted, numbered, outcome, record, tick
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview.narrator import Verbosity


def told(*records: Json, verbosity: Verbosity = Verbosity.STATUS) -> list[str]:
    """The lines that follow the header's."""
    return [str(line) for line in narrated([HEADER, *records], verbosity)][1:]


def tone(each: Json) -> Tone:
    (line,) = narrated([each])
    return line.tone


def test_first_line_says_what_runs_and_whether_the_beginning_is_gone() -> None:
    first, second = narrated([HEADER | {"dry_run": True, "part": 3}])
    assert str(first) == "0:00:00.00  run of minirover, forest-pledge, dry run, wayfarer 9.9"
    assert (second.text, second.tone) == ("the log begins with part 3: earlier parts are missing", Tone.WARNING)


def test_anomaly_that_changes_no_phase_is_a_line_once() -> None:
    felt = [tick(1.0 + count / 20, phase="turn_away", anomalies=["nose_up"] if count > 2 else []) for count in range(9)]
    assert ["Nose up while turning away" in line for line in told(*felt)] == [False, True]


def test_status_comes_every_few_seconds_and_seldom_while_the_rover_stands() -> None:
    battery = record("board", 0.0, battery_v=12.04, faults=[])
    assert told(battery, *drive(0.0, 12.0))[2:] == [
        "0:00:05.00  Following the goal (heading 0, C +0, 2.5 m), goal 0, 12.0 V",
        "0:00:10.00  Following the goal (heading 0, C +0, 5.0 m), goal 0, 12.0 V",
    ]
    assert len(told(*drive(0.0, 121.0, phase="halt"))) == 3


def test_status_is_not_wider_than_a_terminal() -> None:
    widest = {"phase": "turn_away", "counter_deg": -1080.0, "travelled_m": 9999.9, "goal_heading_deg": 359.0}
    battery = record("board", 0.0, battery_v=12.04, faults=[])
    lines = told(battery, tick(35990.0, **widest), tick(35999.9, **widest))
    assert lines[-1].endswith("goal 359, 12.0 V")
    assert len(lines[-1]) <= 80


def test_change_is_a_sentence_with_its_reason_where_only_changes_are_told() -> None:
    stalled = {"anomalies": ["immobilised"], "heading_deg": 271.6}
    lines = told(
        tick(1.0, phase="halt", why="halt", travelled_m=None, heading_deg=None),
        tick(2.0),
        *drive(2.05, 24.6),
        tick(24.6, phase="back_off", why="follow.anomaly", **stalled),
        tick(24.65, phase="back_off", why="back_off", anomalies=["immobilised", "touched"]),
        tick(25.6, phase="turn_away", why="back_off.done", counter_deg=-0.4, heading_deg=359.7),
        tick(26.5, phase="probe", why="turn_away.exhausted", counter_deg=390.0, anomalies=["nose_up"]),
        tick(27.4, phase="spin", why="of joy"),
        verbosity=Verbosity.CHANGES,
    )
    assert [line[12:] for line in lines] == [
        "Standing (C +0)",
        "Following the goal (heading 0, C +0, 1.0 m)",
        "Backing off: stalled while following the goal (heading 272, C +0, 12.3 m)",
        "Stalled and touching something while backing off (heading 0, C +0, 12.3 m)",
        "Turning away: finished backing off (heading 0, C +0, 12.8 m)",
        "Probing in a curve: took too long turning away, nose up (heading 0, C +390, 13.2 m)",
        "spin: of joy (heading 0, C +0, 13.7 m)",
    ]


def test_battery_is_told_when_it_is_lower_than_ever_or_another_one() -> None:
    volts = [12.6, 11.9, 12.5, 11.95, 11.7, None, 12.7]
    lines = told(*(record("board", count, battery_v=each, faults=[]) for count, each in enumerate(volts)))
    assert [line.split("battery ")[1] for line in lines] == ["12.6 V", "11.9 V", "11.7 V", "12.7 V"]


def test_faults_of_the_board_are_told_when_they_come_and_go() -> None:
    faults: list[list[str]] = [[], ["short"], ["short"], []]
    lines = told(*(record("board", count, battery_v=None, faults=each) for count, each in enumerate(faults)))
    assert [line[12:] for line in lines] == ["motor board: short", "motor board: well again"]


def test_computer_is_told_when_its_power_sags() -> None:
    bits = [None, "0", "0x50005", "50005", "0x0"]
    lines = told(*(record("computer", count, throttled=each) for count, each in enumerate(bits)))
    assert [line[12:].partition(" (")[0] for line in lines] == [
        "computer: power and heat bits 50005", "computer: power and heat are normal again",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("each", "meant"),
    [
        (noted(1.0, "hit log"), Tone.PERSON),
        (event("goal", 1.0, "The new goal is 20 degrees", goal_heading_deg=20.0), Tone.PERSON),
        (event("clock_step", 1.0, "The clock was set", "warning", by_s=12.34), Tone.WARNING),
        (event("health", 1.0, "No faults", level="well"), Tone.PLAIN),
        (event("health", 1.0, "Held", "warning", level="hold", cause="compass_stale"), Tone.WARNING),
        (event("health", 1.0, "Stopped", "error", level="fault", cause="overturned"), Tone.FAULT),
        (event("opened", 1.0, "The parts are open", parts=["CMPS14", "PMW3901"]), Tone.PLAIN),
        (event("of a third party", 1.0, "What?", deeply={"a": [1]}), Tone.PLAIN),
        (event("of a third party", 1.0, "What!", "critical"), Tone.PLAIN),
    ],
)
def test_event_is_told_in_its_words_and_tone(each: Json, meant: Tone) -> None:
    assert told(each) == [f"0:00:01.00  {each['text']}"]
    assert tone(each) is meant


def test_end_is_told_with_its_reason() -> None:
    assert told(outcome(1.0)) == ["0:00:01.00  The run has ended: enough"]
    assert tone(outcome(1.0)) is Tone.END


def test_position_is_told_now_and_then() -> None:
    fixes = [record("position", at_s, latitude_deg=50.9, longitude_deg=-1.4, error_m=4.0) for at_s in range(61)]
    assert told(*fixes) == [f"{at}  position 50.900000, -1.400000 (error 4 m)" for at in ("0:00:00.00", "0:01:00.00")]


def test_missing_records_are_told_where_they_are_missing() -> None:
    records = numbered([event("armed", 1.0), *drive(1.0, 2.0), event("hold", 2.0)])
    lines = told(records[0], *records[8:])
    assert lines[1] == "0:00:01.35  7 records are missing"


def test_time_without_ticks_is_told_when_it_is_over() -> None:
    lines = told(tick(1.0), tick(4.5, phase="back_off", why="follow.anomaly"), verbosity=Verbosity.CHANGES)
    assert lines[1:] == [
        "0:00:04.50  no ticks for 3.5 s",
        "0:00:04.50  Backing off: anomaly while following the goal (heading 0, C +0, 2.2 m)",
    ]


def test_header_that_only_a_later_part_has_says_what_runs() -> None:
    lines = [str(line) for line in narrated([event("armed", 1.0) | {"n": 1}, HEADER | {"part": 2, "elapsed_s": 2.0}])]
    assert lines[1:] == ["0:00:02.00  run of minirover, forest-pledge, wayfarer 9.9"]


def test_every_tick_is_told_when_asked_for() -> None:
    held = tick(0.1, cause="compass_stale", level="hold", applied_left=0.0)
    lines = told(*drive(0.0, 0.1), held, verbosity=Verbosity.TICKS)
    assert lines == [
        "0:00:00.00  Following the goal      heading   0  wanted +0.50/+0.50, applied +0.50/+0.50",
        "0:00:00.05  Following the goal      heading   0  wanted +0.50/+0.50, applied +0.50/+0.50",
        "0:00:00.10  Following the goal      heading   0  wanted +0.50/+0.50, applied +0.00/+0.50, hold: the compass "
        "is silent",
    ]
