"""The search itself, with Optuna, over trials that need no simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from tests.experiments import fake_trials
from tests.experiments.tuning.settings_matter import WEDGED_BELOW_M, plan_of, trial
from wayfarer.experiments.campaign import Tasks
from wayfarer.experiments.executors import RunTrial, Stopped, TrialRunner
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.experiments.tuning.objective import ANOMALIES, TIME, Quantity, failures
from wayfarer.experiments.tuning.plan import SearchPlan
from wayfarer.experiments.tuning.search import LEAST_POINTS, Point, Search, stages
from wayfarer.experiments.tuning.summary import TuneSummary, paired, summarised


class Runs:
    """Runs the trials of a plan, and is stopped, as by a signal, after so many."""

    def __init__(self, plan: SearchPlan, run_trial: RunTrial = trial, stop_after: int | None = None) -> None:
        self._plan, self._run_trial, self._stop_after = plan, run_trial, stop_after
        self.rows: list[TrialRow] = []

    def __call__(self, todo: Tasks, take: Callable[[TrialRow], None]) -> None:
        runner = TrialRunner(self._plan, self._run_trial)
        for task in todo:
            if len(self.rows) == self._stop_after:
                return
            row = runner.run(task).row
            self.rows.append(row)
            take(row)


def searched(plan: SearchPlan, run_trial: RunTrial = trial, kept: Sequence[TrialRow] = ()) -> tuple[Search, Runs]:
    runs = Runs(plan, run_trial)
    search = Search(plan, kept, runs)
    search.run(lambda _: None)
    return search, runs


def study_of(search: Search) -> list[tuple[object, ...]]:
    return [(each.number, each.params, each.values, each.user_attrs, each.state) for each in search.study.trials]


def test_finds_what_matters_and_gives_up_what_is_hopeless() -> None:
    search, _ = searched(plan_of(proposals=40))
    best = search.best
    assert best.values["escape.turn_angle_deg"] == pytest.approx(45.0, rel=0.15)
    assert best.gained > 0.1
    assert len(best.rows) == 40
    given_up = [point for point in search.points if point.ended == "worse"]
    assert len(given_up) > 10
    assert {len(point.rows) for point in given_up} <= set(stages(40)[:-1]) == {10, 20}
    assert next(iter(search.importance())) == "escape.turn_angle_deg"
    assert len(search.study.trials) == 41 > LEAST_POINTS, "the present settings are one"
    changed = TuneSummary.model_validate_json(summarised(search, [], []).model_dump_json()).changed
    assert changed["escape.turn_angle_deg"] == (30.0, best.values["escape.turn_angle_deg"])
    assert {type(value) for value in changed.get("detector.cannot_turn_tries", (1, 2))} == {int}


def test_all_points_meet_the_same_trials() -> None:
    search, _ = searched(plan_of(proposals=8))
    seeds = [[row.seed for row in point.rows] for point in search.points]
    assert all(each == seeds[0][: len(each)] for each in seeds)
    assert {row.forest % 2 for row in search.present.rows} == {0}


@pytest.fixture(scope="module")
def uninterrupted() -> tuple[Search, Runs]:
    return searched(plan_of())


@pytest.mark.parametrize("stop_after", [7, 100, 260], ids=["present", "first batch", "second batch"])
def test_interrupted_search_goes_on_to_the_same_study(stop_after: int, uninterrupted: tuple[Search, Runs]) -> None:
    whole, all_runs = uninterrupted
    plan = plan_of()
    runs = Runs(plan, stop_after=stop_after)
    with pytest.raises(Stopped):
        Search(plan, (), runs).run(lambda _: None)
    assert len(runs.rows) == stop_after
    again, rest = searched(plan_of(), kept=runs.rows[::-1])
    assert study_of(again) == study_of(whole)
    assert again.points == whole.points
    assert len(rest.rows) == len(all_runs.rows) - stop_after, "what is kept is not run again"


def test_more_failures_than_now_are_never_the_best_however_good_the_rest_is() -> None:
    def short_but_wedged(spec: TrialSpec) -> TrialResult:
        back_off_m = spec.rover.escape.back_off_m
        return trial(spec)._replace(spl=0.1 / (0.1 + back_off_m))

    search, _ = searched(plan_of(), short_but_wedged)
    over = [point for point in search.points if point.ended == "failures"]
    assert over
    assert all(point.values["escape.back_off_m"] < WEDGED_BELOW_M for point in over)
    assert max(point.gained for point in over) > search.best.gained, "only the limit speaks against it"
    assert failures(search.best.rows) == 0
    states = {each.user_attrs["point"]: each.state.name for each in search.study.trials[1:]}
    assert {states[point.number] for point in over} == {"PRUNED"}


@pytest.mark.parametrize("quantity", [TIME, ANOMALIES])
def test_less_time_and_fewer_anomalies_are_gains(quantity: Quantity) -> None:
    search, _ = searched(plan_of(quantity=quantity))
    after, before = quantity.mean(search.best.rows), quantity.mean(search.present.rows)
    assert after is not None
    assert before is not None
    assert search.best.gained == pytest.approx(before - after)
    assert search.best.gained > 0.0


def test_settings_without_influence_have_no_best() -> None:
    search, _ = searched(plan_of(proposals=8), fake_trials.quick)
    assert search.best is search.present
    summary = summarised(search, [], [])
    assert (summary.best, summary.changed, summary.development) == (None, {}, None)


def test_values_that_do_not_go_together_are_a_point_without_trials() -> None:
    space = ("detector.implausible_rejected=1:20", "detector.implausible_of=1:20")
    search, _ = searched(plan_of(proposals=16, space=space), fake_trials.quick)
    refused = [point for point in search.points if point.ended == "refused"]
    assert refused
    for point in refused:
        assert point.values["detector.implausible_rejected"] > point.values["detector.implausible_of"]
        assert point.rows == []


def test_verdict_is_none_where_the_interval_contains_0() -> None:
    def rows(*spl: float) -> list[TrialRow]:
        values = enumerate(spl)
        return [TrialRow(n, "pledge", n, 0, 1, "escaped", 50.0, shortest_path_m=40.0, spl=each) for n, each in values]

    before = rows(*[0.5, 0.6, 0.4, 0.5] * 5)
    better, worse, mixed = (
        rows(*[0.5 + a, 0.6 + b, 0.4 + a, 0.5 + b] * 5) for a, b in [(0.1, 0.2), (-0.1, -0.2), (0.2, -0.15)]
    )
    verdicts = [paired("light", "held out", before, after, "spl").verdict for after in (better, worse, mixed)]
    assert verdicts == ["gain", "loss", "none"]
    assert paired("light", "held out", before, before, "time").verdict == "none", "not known"
    assert paired("light", "held out", before[:9], better[:9], "spl").verdict == "too few"


def test_means_and_their_difference_are_of_the_same_trials() -> None:
    def rows(*paths_m: float) -> list[TrialRow]:
        return [TrialRow(n, "pledge", n, 0, 1, "escaped", path_m) for n, path_m in enumerate(paths_m)]

    before, after = rows(50.0, 60.0, 100.0), rows(40.0, 55.0, 10.0)
    after[2] = after[2]._replace(outcome="entrapped")
    path = paired("light", "held out", before, after, "path").changes["path"]
    assert (path.present, path.tuned, path.difference) == (55.0, 47.5, -7.5)


def test_point_has_no_gain_before_its_trials() -> None:
    assert Point(1, {}).gained == float("-inf")
