"""The one account of a run: what its records tell, and the state they leave."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from tests.logview.records import HEADER, Json, drive, event, numbered, outcome, read, record, tick
from wayfarer.fieldlog.record import Event, Tick
from wayfarer.fieldlog.run_fold import (
    AnomalyBegan,
    EpisodeBegan,
    Gap,
    PhaseChanged,
    RunBegan,
    RunFold,
    Silence,
    Told,
)


def folded(*records: Json) -> tuple[list[Told], RunFold]:
    """What the records behind a header tell, ticks themselves left out, and the fold."""
    fold = RunFold()
    told = [each for every in [HEADER, *records] for each in fold.add(read(every))]
    return [each for each in told if not isinstance(each, Tick | RunBegan)], fold


def test_time_is_told_since_the_first_record() -> None:
    (mark,), fold = folded(event("mark", 2.5, text="Mark: hit log"))
    assert isinstance(mark, Event)
    assert (mark.elapsed_s, mark.t_s, mark.text) == (2.5, 102.5, "Mark: hit log")
    assert fold.state.events["mark"] == 1


def test_first_header_says_what_ran_and_further_ones_change_nothing() -> None:
    told, fold = folded(HEADER | {"part": 2, "rover": "another"})
    assert told == []
    assert fold.state.header.rover == "minirover"


def test_changes_of_phase_and_anomalies_are_told_with_their_place() -> None:
    felt = ["immobilised", "nose_up"]
    told, fold = folded(
        *drive(0.0, 1.0),
        tick(1.0, phase="back_off", anomalies=felt),
        tick(1.05, phase="back_off", anomalies=["nose_up"]),
    )
    began = [each for each in told if isinstance(each, AnomalyBegan)]
    assert [(each.kind, each.phase, each.elapsed_s) for each in began] == [
        ("immobilised", "back_off", 1.0), ("nose_up", "back_off", 1.0),
    ]  # fmt: skip
    assert began[0].place is not None
    assert began[0].place.north_m == pytest.approx(0.5)
    assert [each.phase for each in told if isinstance(each, PhaseChanged)] == ["follow", "back_off"]
    assert (fold.state.anomalies, fold.state.recoveries) == ({"immobilised": 1, "nose_up": 1}, 1)


@pytest.mark.parametrize(("quality_min", "doubtful"), [(0.3, 0), (0.5, 1)])
def test_reading_counts_if_its_quality_is_what_the_rover_file_asks_for(quality_min: float, doubtful: int) -> None:
    """There was a copy of the default."""
    config = HEADER["config"] | {"detector": {"quality_min": quality_min}}
    fold = RunFold()
    for each in [
        HEADER | {"config": config},
        tick(0.0),
        tick(0.05, motion={"t_s": 100.05, "forward_m": 0.0, "right_m": 0.0, "quality": 0.4}),
    ]:
        list(fold.add(read(each)))
    assert fold.state.sensors["motion"].doubtful == doubtful


def test_missing_records_are_told_once_and_break_what_they_are_between() -> None:
    whole = numbered([*drive(0.0, 2.0)])
    told, fold = folded(*whole[:5], *whole[9:12])
    assert told[1:] == [Gap(pytest.approx(0.45), pytest.approx(100.45), 4)]  # type: ignore[arg-type]
    assert (fold.state.stretch, fold.state.missing) == (1, 4)


def test_silence_of_the_loop_is_told_with_its_beginning_before_the_tick_that_ends_it() -> None:
    fold = RunFold()
    late = [tick(0.0), tick(1.0), tick(2.5), tick(2.55)]
    told = [each for every in [HEADER, *late] for each in fold.add(read(every)) if isinstance(each, Silence | Tick)]
    silence = Silence(2.5, 102.5, began_s=1.0)
    assert [each.elapsed_s for each in told] == [0.0, 1.0, 2.5, 2.5, pytest.approx(2.55)]
    assert told[2] == silence
    assert (silence.text, fold.state.stretch) == ("no ticks for 1.5 s", 1)


def test_missing_records_are_told_before_the_silence_that_they_leave() -> None:
    told, fold = folded({**tick(0.0), "n": 1}, {**tick(9.0), "n": 181})
    assert [type(each) for each in told if isinstance(each, Gap | Silence)] == [Gap, Silence]
    assert fold.state.stretch > 0


def test_period_is_unknown_for_the_first_tick_and_behind_missing_records() -> None:
    fold, periods_s = RunFold(), []
    whole = numbered([*drive(0.0, 1.0)])
    for each in [*whole[:3], *whole[6:9]]:
        fold.add(read(each))
        periods_s.append(fold.state.period_s)
    assert periods_s == pytest.approx([nan, 0.05, 0.05, nan, 0.05, 0.05], nan_ok=True)


def test_measured_speed_is_that_between_two_readings_and_is_forgotten_after_a_while() -> None:
    fold, speeds_m_s = RunFold(), []
    for at_s, forward_m in ((0.0, 0.1), (0.1, 0.05), (0.2, None), (0.3, -0.02), (0.35, 0.01), (1.4, None)):
        moved = {"t_s": 100.0 + at_s, "forward_m": forward_m, "right_m": 0.0, "quality": 1.0, "signed": True}
        fold.add(read(tick(at_s, motion=moved if at_s < 1.0 else None)))
        speeds_m_s.append(fold.state.measured_m_s)
    assert speeds_m_s == pytest.approx([nan, 0.5, 0.5, -0.2, 0.2, nan], nan_ok=True)
    unsigned = {"t_s": 101.5, "forward_m": 0.1, "right_m": 0.0, "quality": 1.0, "signed": False}
    for at_s in (1.4, 1.5):
        fold.add(read(tick(at_s, motion=unsigned | {"t_s": 100.0 + at_s}, applied_left=-0.5, applied_right=-0.5)))
    assert fold.state.measured_m_s == pytest.approx(-1.0), "a sensor that cannot tell which way: the wheels do"


def test_episode_goes_from_the_first_manoeuvre_until_the_goal_is_followed_again() -> None:
    phases = ["follow", "back_off", "turn_away", "halt", "turn_away", "probe", "follow"]
    told, _ = folded(*(tick(at / 20, phase=phase, why=phase, side=-1) for at, phase in enumerate(phases)))
    (episode,) = [each.episode for each in told if isinstance(each, EpisodeBegan)]
    assert (episode.start_s, episode.end_s) == pytest.approx((0.05, 0.3))
    assert (episode.side, episode.turns, episode.ended_by) == ("left", 2, "follow")


def test_mode_is_what_the_tick_says_until_the_run_has_ended() -> None:
    fold = RunFold()
    for mode, held in (("arming", False), ("armed", True), ("manual", False), ("disarmed", False)):
        fold.add(read(tick(1.0, mode=mode, held=held)))
        assert (fold.state.mode, fold.state.tick.held) == (mode, held)
    fold.add(read(event("disarmed", 1.0, reason="enough")))
    assert fold.state.why_disarmed == "enough"
    fold.add(read(outcome(2.0)))
    assert fold.state.mode == "ended"


def test_totals_of_a_mission_stay_when_it_is_over_and_its_start_is_where_the_first_one_began() -> None:
    before, after = tick(1.0, mission_s=None, mission_m=None), tick(2.5, mission_s=None)
    _, fold = folded(before, tick(1.5, mission_s=0.0), tick(2.0, mission_s=0.5), after)
    assert (fold.state.mission_s, fold.state.mission_m) == (0.5, 1.0)
    assert fold.state.start is not None
    assert (fold.state.start.north_m, fold.state.from_start) == (0.75, True)


@pytest.mark.parametrize("nothing", [None, "three", [1], {"a": 1}, True, 1e300])
def test_what_an_algorithm_remembers_is_a_number_or_not_there(nothing: Any) -> None:
    told = read(tick(0.0, counter_deg=nothing))
    assert isinstance(told, Tick)
    assert told.remembered("counter_deg") is None


def test_state_does_not_grow_with_the_log() -> None:
    _, fold = folded(*drive(0.0, 60.0, motion={"t_s": 1.0, "forward_m": 0.1, "right_m": 0.0, "quality": 1.0}))
    before = len(repr(fold.state))
    for each in drive(60.0, 120.0):
        fold.add(read(each))
    fold.add(read(record("board", 120.0, battery_v=12.0, faults=[])))
    assert len(repr(fold.state)) < before + 200
