"""The one account of a run: what its records tell, and the state they leave."""

from __future__ import annotations

from math import isnan, nan
from typing import Any

import pytest

from tests.views.text.records import HEADER, drive, event, numbered, outcome, record, tick
from wayfarer.fieldlog.lines import KINDS
from wayfarer.fieldlog.missions import EpisodeBegan
from wayfarer.fieldlog.run_events import AnomalyBegan, Gap, Noted, PhaseChanged, RunBegan, Silence
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Board, Fix, Header, RunEvent, Tick


def folded(*records: Record) -> tuple[list[RunEvent], RunFold]:
    """What the records behind a header tell, ticks themselves left out, and the fold."""
    fold = RunFold()
    told = [each for every in [HEADER, *records] for each in fold.take(every)]
    return [each for each in told if not isinstance(each, Tick | RunBegan)], fold


def test_time_is_told_since_the_first_record() -> None:
    (mark,), _ = folded(event("mark", 2.5, text="hit log"))
    assert isinstance(mark, Noted)
    assert (mark.elapsed_s, mark.t_s, mark.number, mark.text) == (2.5, 102.5, 1, "hit log")


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
    """There was a copy of the default: a rover with another ``quality_min`` had another path in its report."""
    config = HEADER["config"] | {"detector": {"quality_min": quality_min}}
    fold = RunFold()
    for each in [
        HEADER | {"config": config},
        tick(0.0),
        tick(0.05, motion={"t_s": 100.05, "forward_m": 0.0, "right_m": 0.0, "quality": 0.4}),
    ]:
        list(fold.take(each))
    assert fold.state.sensors["motion"].doubtful == doubtful
    assert fold.state.path_m == pytest.approx(0.025 * doubtful), "the wheels count, or the sensor that sees no motion"


def test_missing_records_are_told_once_and_break_what_they_are_between() -> None:
    whole = numbered([*drive(0.0, 2.0)])
    told, fold = folded(*whole[:5], *whole[9:12])
    assert told[1:] == [Gap(pytest.approx(0.45), pytest.approx(100.45), 4, announced=False)]  # type: ignore[arg-type]
    assert (fold.state.stretch, fold.state.missing) == (1, 4)


def test_silence_of_the_loop_is_told_with_its_beginning_before_the_tick_that_ends_it() -> None:
    fold = RunFold()
    late = [tick(0.0), tick(1.0), tick(2.5), tick(2.55)]
    told = [each for every in [HEADER, *late] for each in fold.take(every) if isinstance(each, Silence | Tick)]
    silence = Silence(2.5, 102.5, began_s=1.0)
    assert [each.elapsed_s for each in told] == [0.0, 1.0, 2.5, 2.5, pytest.approx(2.55)]
    assert told[2] == silence
    assert (silence.for_s, fold.state.stretch) == (1.5, 1)


def test_missing_records_are_told_before_the_silence_that_they_leave() -> None:
    told, fold = folded({**tick(0.0), "n": 1}, {**tick(9.0), "n": 181})
    assert [type(each) for each in told if isinstance(each, Gap | Silence)] == [Gap, Silence]
    assert fold.state.stretch > 0


def test_position_and_motor_board_know_how_long_nothing_was_said_before() -> None:
    where = {"latitude_deg": 47.0, "longitude_deg": 8.0}
    boards = [record("board", t_s, battery_v=12.0) for t_s in (0.0, 1.0, 31.0)]
    fixes = [record("position", t_s, **where) for t_s in (0.0, 2.0, 14.5)]
    told, _ = folded(*boards, record("position", 1.0, latitude_deg=None), *fixes)
    assert [each.period_s for each in told if isinstance(each, Board)] == pytest.approx([nan, 1.0, 30.0], nan_ok=True)
    assert [each.period_s for each in told if isinstance(each, Fix)] == [None, 2.0, 12.5]


def test_period_is_unknown_for_the_first_tick_and_behind_missing_records() -> None:
    fold = RunFold()
    whole = numbered([*drive(0.0, 1.0)])
    ticks = [each for every in [*whole[:3], *whole[6:9]] for each in fold.take(every) if isinstance(each, Tick)]
    assert [isnan(each.period_s) for each in ticks] == [True, False, False, True, False, False]
    assert ticks[-1].period_s == pytest.approx(0.05)
    assert [each.before for each in ticks] == [
        None, ticks[0].place, ticks[1].place, None, ticks[3].place, ticks[4].place,
    ]  # fmt: skip


def test_reading_is_fresh_in_the_first_tick_that_has_it() -> None:
    old, new = {"t_s": 100.0, "heading_deg": 1.0}, {"t_s": 100.08, "heading_deg": 1.0}
    fold = RunFold()
    readings = [None, old, old, new, {"t_s": None}]
    ticks = [fold.state.tick for at, each in enumerate(readings) if fold.take(tick(at / 20, compass=each))]
    assert [each.fresh for each in ticks] == [(), ("compass",), (), ("compass",), ()]


def test_episode_goes_from_the_first_manoeuvre_until_the_goal_is_followed_again() -> None:
    phases = ["follow", "back_off", "turn_away", "halt", "turn_away", "probe", "follow"]
    told, _ = folded(*(tick(at / 20, phase=phase, why=phase, side=-1) for at, phase in enumerate(phases)))
    (episode,) = [each.episode for each in told if isinstance(each, EpisodeBegan)]
    assert (episode.start_s, episode.end_s) == pytest.approx((0.05, 0.3))
    assert (episode.side, episode.turns, episode.ended_by) == ("left", 2, "follow")


def test_mode_follows_the_events_and_a_hold_ends_with_what_it_has_held() -> None:
    fold, modes = RunFold(), []
    for name in ("arming", "armed", "hold", "disarmed", "arming"):
        fold.take(event(name, 1.0, reason="enough", goal_heading_deg=20.0))
        modes.append((fold.state.mode, fold.state.operator_hold))
    assert modes == [("arming", False), ("armed", False), ("armed", True), ("disarmed", False), ("arming", False)]
    assert (fold.state.why_disarmed, fold.state.goal_heading_deg) == ("enough", 20.0)
    fold.take(outcome(2.0))
    assert fold.state.mode == "ended"


def test_new_goal_counts_and_a_mission_ends_with_disarming() -> None:
    armed, goal = event("armed", 1.0, goal_heading_deg=20.0), event("goal", 2.0, goal_heading_deg=90.0)
    _, fold = folded(tick(1.0), armed, tick(1.5), goal, tick(2.0), event("disarmed", 2.0), tick(2.5))
    assert fold.state.goal_heading_deg == 90.0
    assert (fold.state.mission_s, fold.state.mission_m) == (1.0, 0.5)


def test_header_that_comes_late_does_not_take_the_way_back() -> None:
    fold = RunFold()
    moved = {"t_s": 100.0, "forward_m": 0.1, "right_m": 0.0, "quality": 1.0, "signed": True}
    for each in [tick(0.0, motion=moved), HEADER | {"part": 2}, tick(0.05, motion=moved)]:
        fold.take(each)
    assert fold.state.path_m == pytest.approx(0.2)
    assert fold.state.header.part == 2


@pytest.mark.parametrize("nothing", [None, "three", [1], {"a": 1}, True, float("nan"), 1e300])
def test_what_an_algorithm_remembers_is_a_number_or_not_there(nothing: Any) -> None:
    fold = RunFold()
    (told, *_) = fold.take(tick(0.0, counter_deg=nothing, side=nothing, episodes=nothing))
    assert isinstance(told, Tick)
    assert (told.counter_deg, told.side, told.episodes) == (None, None, None)


WORLD: Record = {
    "start_m": [1.0, 2.0], "goal_y_m": 3.0, "trunk_diameter_m": 0.3, "tree_radius_m": 0.2, "trees_m": [[1, 2]],
    "trunks_m": [[1.0, 2.0, 3.0, 4.0, "left"]],
}  # fmt: skip


@pytest.mark.parametrize(
    "changed",
    [{"start_m": [1.0]}, {"goal_y_m": None}, {"trees_m": [[1, "x"]]}, {"trunks_m": [[1, 2, 3]]}, {"trees_m": 5}],
)
def test_forest_that_cannot_be_drawn_is_none(changed: Record) -> None:
    assert Header.of(HEADER | {"world": WORLD}).world == WORLD
    assert Header.of(HEADER | {"world": WORLD | changed}).world is None


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_record_can_be_taken_however_little_it_says(kind: str) -> None:
    fold = RunFold()
    fold.take({"record": kind, "t_s": 1.0})
    assert fold.state.t_s == 1.0


def test_state_does_not_grow_with_the_log() -> None:
    _, fold = folded(*drive(0.0, 60.0, motion={"t_s": 1.0, "forward_m": 0.1, "right_m": 0.0, "quality": 1.0}))
    before = len(repr(fold.state))
    for each in drive(60.0, 120.0):
        fold.take(each)
    fold.take(record("board", 120.0, battery_v=12.0, faults=[]))
    assert len(repr(fold.state)) < before + 200
