"""Events as sentences: no key and no value of the log is told as the program calls it."""

from __future__ import annotations

from typing import Any

import pytest

from tests.views.text.records import event
from wayfarer.fieldlog.typed import Header
from wayfarer.fieldlog.wording import SENTENCES, event_text, run_text

TOTALS: dict[str, Any] = {"mission_s": 61.0, "mission_m": 12.5, "mission_anomalies": 0, "mission_ended": "mission_time"}
EVENTS: list[tuple[str, dict[str, Any], str]] = [
    ("arming", {"start_delay_s": 10.0, "goal_heading_deg": None}, "Arming: in 10 s it drives straight ahead"),
    ("arming", {"start_delay_s": 0.0, "goal_heading_deg": 359.7}, "Arming: it drives towards 0 degrees"),
    ("disarmed", {"reason": "requested by a person"}, "Disarmed: requested by a person"),
    ("disarmed", {"reason": "fault: compass_lost"}, "Disarmed: fault: the compass has been silent for seconds"),
    ("goal", {"goal_heading_deg": 90.0}, "A new goal: drives towards 90 degrees"),
    ("goal", {"goal_heading_deg": -0.04}, "A new goal: drives towards 0 degrees"),
    ("health", {"level": "hold", "cause": "tick_late"},
     "Wheels held until this clears: the control tick came late. This ends when a tick comes in time"),
    ("health", {"level": "fault", "cause": "runaway"},
     "Fault: stopped until re-armed: the rover moves although its wheels are commanded to stop. "
     "This ends when somebody arms the rover again"),
    ("health", {"level": "hold", "cause": "made up"}, "Wheels held until this clears: made up"),
    ("health", {"level": "well", "cause": None}, "No faults"),
    ("manual", {"driver": "page"}, "A person drives on the live page"),
    ("manual", {"driver": ["a"]}, "A person drives with a"),
    ("sensor_failed", {"sensor": "compass", "error": "no answer", "retry_in_s": 0.5},
     "The compass failed: no answer (tried again in 0.5 s)"),
    ("sensor_failed", {"sensor": "motion", "error": "no answer"}, "The motion sensor failed: no answer"),
    ("part_troubles", {"part": "CMPS14", "counts": {"bus_errors": 3, "garbage": 1}},
     "The CMPS14 carried on after 3 bus errors, 1 garbage"),
    ("power", {"flags": "0x1", "text": "undervoltage"}, "The computer's supply: undervoltage, flags 0x1"),
    ("clock_step", {"by_s": -3600.2}, "The computer's clock was set by -3600 s"),
    ("log_gap", {"dropped": 1}, "1 record could not be written into the log"),
    ("log_gap", {"dropped": 12}, "12 records could not be written into the log"),
    ("loop_stalled", {"stall_s": 0.41, "where": "a.py:1 f"}, "The control loop stood still for 0.4 s in a.py:1 f"),
    ("stop_not_confirmed", {"part": "board", "error": "silent"}, "The board did not confirm the stop: silent"),
    ("unclean_shutdown", {"run": "00016-x", "armed_t_wall": None, "mission_ended": None},
     "The last mission (run 00016-x) was cut off: killed, or without power"),
    ("unclean_shutdown", {}, "The last mission (run not known) was cut off: killed, or without power"),
    ("last_mission", {"run": "00016-x", **TOTALS},
     "The last mission (run 00016-x) is over after 61 s, 12 m: time limit"),
    ("mission_ended", TOTALS, "The mission is over after 61 s, 12 m: time limit"),
    ("wheels_stopped", {"reason": "mission_time"}, "The wheels are stopped: time limit"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "details", "sentence"), EVENTS, ids=lambda value: str(value)[:30])
def test_event_is_a_sentence(name: str, details: dict[str, Any], sentence: str) -> None:
    assert event_text(event(name, 1.0, **details)) == sentence
    assert "_" not in sentence


@pytest.mark.parametrize("name", SENTENCES)
def test_event_without_its_details_is_told_and_a_new_detail_comes_after_it(name: str) -> None:
    said = event_text(event(name, 1.0))
    assert said and "_" not in said
    assert event_text(event(name, 1.0, moon_height_deg=12.34)) == f"{said}, moon height 12.3 degrees"


def test_detail_of_another_type_is_told_as_it_is() -> None:
    assert event_text(event("opened", 1.0, parts={"a": [1]})) == "The parts are open: {'a': [1]}"


def test_event_that_is_not_known_is_told_as_it_is() -> None:
    assert event_text(event("moon_rose", 1.0, moon_rose_deg=2.0, phase="full", seen=None, craters=1234.4)) == (
        "moon rose: deg 2, phase full, craters 1234"
    )
    assert event_text(event("moon_rose", 1.0)) == "moon rose"


def test_header_that_does_not_say_what_ran_names_no_rover_and_no_version() -> None:
    assert run_text(Header.of({"record": "run"})) == "run of unknown rover"
