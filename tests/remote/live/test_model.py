"""What a page is told of a run."""

from __future__ import annotations

import json
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.remote.live.records import board, run_log, tick
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.record import Truth
from wayfarer.hal import PositionFix, WheelCommand
from wayfarer.remote.live.model import COURSE_POINTS, LINES, MARKS, PageModel
from wayfarer.safety.conditions import Condition, Level


@pytest.fixture
def model() -> PageModel:
    return PageModel()


def shown(model: PageModel, **about: Any) -> FieldLog:
    return run_log(model.add, **about)


def sensor(model: PageModel, name: str) -> dict[str, Any]:
    found: dict[str, dict[str, Any]] = dict(model.state()["sensors"])
    return found[name]


def test_new_viewer_is_told_what_runs_and_the_forest_it_runs_in(model: PageModel) -> None:
    shown(model)
    told = model.snapshot()
    assert (told["about"]["rover"], told["about"]["simulated"], told["about"]["length_m"]) == ("sim", True, 0.4)
    assert told["forest"].trunks_m == [(33.3, 5.5, 30.9, 18.4, "left")]
    assert told["outcome"] is None
    assert told["state"]["mode"] == "disarmed"


def test_way_of_a_simulated_rover_is_the_true_one(model: PageModel) -> None:
    log = shown(model)
    log.tick(tick(100.0, phase=Phase.PROBE))
    log.note(Truth, 100.0, {"x_m": 25.0, "y_m": 13.0, "heading_deg": 45.0, "driven_m": 0.0})
    assert model.snapshot()["track"] == [(25.0, 13.0, "probe")]
    assert model.state()["place"] == (25.0, 13.0, 45.0)


def test_way_of_a_real_rover_is_dead_reckoned(model: PageModel) -> None:
    log = shown(model, simulated=False)
    for step in range(5):
        log.tick(tick(100.0 + step * 0.05, heading_deg=90.0, north_m=0.0, east_m=0.1 * (step + 1)))
    east_m, north_m, phase = model.snapshot()["track"][-1]
    assert (east_m, north_m, phase) == (pytest.approx(0.5), pytest.approx(0.0, abs=1e-6), "follow")
    assert model.snapshot()["forest"] is None


def test_news_are_told_once_and_add_up_to_what_a_new_viewer_sees(model: PageModel) -> None:
    log = shown(model, simulated=False)
    model.news()
    before = model.snapshot()
    for step in range(8):
        anomalies = (Anomaly.IMMOBILISED,) if step == 5 else ()
        phase = Phase.BACK_OFF if step >= 5 else Phase.FOLLOW
        log.tick(tick(100.0 + step * 0.05, north_m=0.2 * step, east_m=0.0, phase=phase, anomalies=anomalies))
    log.event("mark", 101.0, text="Mark: hit log")
    news, after = model.news(), model.snapshot()
    for kind in ("track", "marks", "phases", "course", "lines"):
        assert before[kind] + news[kind] == after[kind]
    assert len(news["track"]) == 8
    assert model.news() == {}


def test_phase_is_told_in_words_with_what_began_it(model: PageModel) -> None:
    log = shown(model)
    log.tick(tick(100.0))
    for t_s, why in ((100.05, "follow.anomaly"), (100.10, "back_off")):
        log.tick(tick(t_s, phase=Phase.BACK_OFF, why=why, anomalies=(Anomaly.IMMOBILISED,)))
    state = model.state()
    assert (state["phase_text"], state["why_text"]) == ("Backing off", "stalled while following the goal")
    assert state["anomalies"] == ["stalled"]
    assert state["counts"] == [["stalled", 1]], "an anomaly that lasts is one"


def test_mode_hold_and_goal_are_those_of_the_tick_and_why_that_of_the_event(model: PageModel) -> None:
    log = shown(model)
    for mode, held, goal_deg in (("arming", False, None), ("armed", False, 20.0), ("armed", True, 20.0)):
        log.tick(tick(101.0, mode=mode, held=held, goal_heading_deg=goal_deg))
        state = model.state()
        assert (state["mode"], state["held"], state["goal_heading_deg"]) == (mode, held, goal_deg)
    log.event("disarmed", 101.0, reason="fault: compass_lost")
    assert model.state()["why_disarmed"] == "fault: the compass has been silent for seconds"


def test_time_of_the_tick_is_told_because_other_records_are_later_than_its_mode(model: PageModel) -> None:
    log = shown(model)
    assert model.state()["tick_t_s"] is None
    log.tick(tick(101.00049, mode="disarmed"))
    log.event("manual", 101.02, driver="page")
    state = model.state()
    assert (state["t_s"], state["tick_t_s"], state["mode"]) == (101.02, 101.00049, "disarmed")


def test_change_of_mode_or_hold_is_for_at_once() -> None:
    model, at_once = PageModel(), []
    log = run_log(lambda record: at_once.append(model.add(record)))
    for mode, held in (("disarmed", False), ("armed", False), ("armed", False), ("armed", True), ("disarmed", False)):
        log.tick(tick(101.0, mode=mode, held=held))
    assert at_once == [False, False, True, False, True, True]


def test_mission_counts_time_and_metres_from_arming(model: PageModel) -> None:
    log = shown(model)
    log.tick(tick(130.0, travelled_m=12.5, mode="armed", mission_s=20.0, mission_m=7.5))
    log.tick(tick(140.0, travelled_m=13.0))
    state = model.state()
    assert (state["time_text"], state["time_of"], state["way_m"], state["way_of"]) == (
        "0:00:20", "mission", 7.5, "commanded",
    )  # fmt: skip


def test_trial_counts_time_from_its_start_and_the_true_way(model: PageModel) -> None:
    log = shown(model, trial=3)
    log.tick(tick(130.0, travelled_m=12.5, mode="armed", mission_s=20.0, mission_m=7.5))
    log.note(Truth, 130.0, {"x_m": 25.0, "y_m": 13.0, "driven_m": 9.876})
    state = model.state()
    assert (state["time_text"], state["time_of"], state["way_m"], state["way_of"]) == (
        "0:00:30", "total", 9.876, "driven",
    )  # fmt: skip


def test_course_is_the_heading_off_the_goal_and_c_five_times_a_second_for_two_minutes(model: PageModel) -> None:
    log = shown(model)
    log.tick(tick(100.0, heading_deg=350.0))
    for step in range(1, 20 * 150):
        heading_deg, memory = None if step == 4 else 350.0, {"counter_deg": -20.04}
        log.tick(tick(100.0 + step * 0.05, heading_deg=heading_deg, memory=memory, goal_heading_deg=10.0))
    course = model.snapshot()["course"]
    assert model.news()["course"][:3] == [[100.0, None, 30.0], [100.2, None, -20.0], [100.4, -20.0, -20.0]]
    assert len(course) == COURSE_POINTS
    assert (course[-1][0] - course[0][0], course[-1][1:]) == (pytest.approx(120.0, abs=1.0), [-20.0, -20.0])


def test_health_is_told_in_words(model: PageModel) -> None:
    log = shown(model)
    log.tick(tick(100.0, level=Level.HOLD, cause=Condition.COMPASS_STALE))
    log.board(100.0, board(11.4, "motor A: drive fault"), None)
    state = model.state()
    assert (state["level_text"], state["cause_text"]) == ("Wheels held until this clears", "the compass is silent")
    assert (state["battery_v"], state["faults"]) == (11.4, ["motor A: drive fault"])


def test_page_says_since_when_what_the_rover_does_and_until_when(model: PageModel) -> None:
    log = shown(model)
    for t_s in (100.0, 101.0, 105.0, 112.0):
        level, cause = (Level.DEGRADE, Condition.MOTION_UNKNOWN) if t_s > 100.0 else (Level.WELL, None)
        log.tick(tick(t_s, level=level, cause=cause, mode="armed"))
    state = model.state()
    assert state["cause_for_s"] == 11.0
    assert state["response_text"].startswith("it drives a stride ahead")
    assert state["response_text"].endswith(", until the motion sensor sees the ground again")
    log.tick(tick(112.05, level=level, cause=cause))
    assert model.state()["response_text"] == "", "a rover that is disarmed does nothing"
    log.tick(tick(113.0))
    assert model.state()["cause_for_s"] is None


def test_sensors_have_age_rate_and_what_they_say_of_themselves(model: PageModel) -> None:
    log = shown(model)
    for step in range(41):
        log.tick(tick(100.0 + step * 0.05, moved_m=0.05 if step % 2 == 0 else None))
    compass, motion = sensor(model, "compass"), sensor(model, "motion")
    assert (compass["rate_hz"], compass["wanted_hz"], compass["note"]) == (20.0, 20.0, "calibration 3 of 3")
    assert (motion["rate_hz"], motion["note"], motion["late"]) == (10.0, "quality 80%", False)
    log.tick(tick(103.0, heading_deg=None, moved_m=None))
    assert (sensor(model, "motion")["age_s"], sensor(model, "motion")["late"]) == (1.0, True)


def test_sensor_that_has_never_spoken_is_late_and_one_that_nobody_reads_is_not_shown(model: PageModel) -> None:
    shown(model, parts=("compass", "contact", "motors"))
    assert [name for name, _ in model.state()["sensors"]] == ["compass"]
    assert (sensor(model, "compass")["age_s"], sensor(model, "compass")["late"]) == (None, True)


def test_failures_of_a_sensor_and_fixes_of_a_receiver_are_counted(model: PageModel) -> None:
    log = shown(model, parts=("compass", "position", "motors"))
    log.event("sensor_failed", 100.0, sensor="compass", error="no answer", retry_in_s=0.05)
    log.position(PositionFix(100.5, 50.9, -1.4, 3.0))
    assert sensor(model, "compass")["failures"] == 1
    assert sensor(model, "position")["note"] == "error 3 m"


def test_events_are_for_at_once_and_ticks_are_not() -> None:
    model, at_once = PageModel(), []
    log = run_log(lambda record: at_once.append(model.add(record)))
    log.tick(tick(100.0))
    log.event("hold", 100.0)
    log.close("escaped", "out")
    assert at_once == [False, False, True, True]


def test_end_is_news_and_stays(model: PageModel) -> None:
    log = shown(model)
    model.news()
    log.close("escaped", "the rover is out")
    ended = {"reason": "escaped", "text": "the rover is out"}
    assert model.news()["outcome"] == ended == model.snapshot()["outcome"]
    assert model.state()["mode"] == "ended"


def test_days_of_driving_stay_bounded(model: PageModel) -> None:
    log = shown(model, simulated=False)
    for step in range(10_000):
        anomalies = (Anomaly.TOUCHED,) if step % 2 else ()
        phase = Phase.PROBE if step % 2 else Phase.FOLLOW
        log.tick(
            tick(
                100.0 + step,
                north_m=0.0,
                east_m=0.3 * (step + 1),
                anomalies=anomalies,
                phase=phase,
                why=f"{phase.value}.done",
            )
        )
        if step % 50 == 0:
            model.news()
    told = model.snapshot()
    assert (len(told["marks"]), len(told["lines"])) == (MARKS, LINES)
    assert len(told["track"]) <= 3000
    assert told["track"][-1][0] == pytest.approx(3000.0), "the newest place is always there"
    assert len(msgspec.json.encode(told)) < 250_000


def test_viewers_get_the_whole_way_again_when_it_is_thinned(model: PageModel) -> None:
    log = shown(model, simulated=False)
    track: list[Any] = []
    for step in range(4000):
        log.tick(tick(100.0 + step * 0.05, north_m=0.0, east_m=0.3 * step))
        if step % 10 == 9:
            news = model.news()
            track = news["whole_track"] if "whole_track" in news else track + news.get("track", [])
    assert track == model.snapshot()["track"]
    assert len(track) < 3000


VALUES = st.none() | st.floats(allow_nan=True) | st.text(max_size=5) | st.lists(st.integers(), max_size=2)


@given(memory=st.dictionaries(st.sampled_from(["counter_deg", "episodes", "side", "mine"]), VALUES, max_size=4))
def test_whatever_an_algorithm_remembers_breaks_nothing(memory: dict[str, Any]) -> None:
    model = PageModel()
    shown(model).tick(tick(100.0, memory=memory, why="made.up", wheels=WheelCommand(0.5, 0.5)))
    assert json.loads(msgspec.json.encode(model.snapshot())), "and it can be sent"
