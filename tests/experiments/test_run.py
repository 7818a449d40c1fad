from __future__ import annotations

import os
import re
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.experiments import fake_trials
from tests.experiments.dask_processes import UP_S, eventually
from tests.experiments.fake_trials import campaign_of
from wayfarer.config.rover_file import laid_over
from wayfarer.errors import TrialNotRun
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.results import TRIALS, Results
from wayfarer.experiments.run import Done, RunTrial, TrialRunner, log_name, run
from wayfarer.simhal.world.forest_file import ForestFile
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.shortest_path import shortest_path_m


def run_into(
    path: Path, plan: Campaign, run_trial: RunTrial | None = fake_trials.quick, *, resume: bool = False, **options: Any
) -> bytes:
    """Run a campaign into a folder; return what its ``trials.csv`` holds."""
    with Results.kept(plan, path, resume=resume) as results:
        run(results, run_trial=run_trial, **options)
    return (path / TRIALS).read_bytes()


# --- which trial is what


def test_generated_trials_are_in_a_layout_each() -> None:
    plan = campaign_of(3)
    assert [plan.forest_and_noise(trial) for trial in range(3)] == [(0, 0), (1, 0), (2, 0)]
    forest = plan.make_forest(3)
    assert (forest.forest, forest.noise) == (3, 0)


def test_forests_of_a_file_come_in_its_order_and_again_with_new_noise() -> None:
    one = campaign_of(1).make_forest(0)
    numbers = [(4, 2025), (4, 2026), (9, 2025)]
    file = ForestFile("f", "", tuple(replace(one, forest=forest, noise=noise) for forest, noise in numbers))
    plan = replace(campaign_of(7), forests=file)
    passes = [plan.make_forest(trial) for trial in range(7)]
    assert [(forest.forest, forest.noise) for forest in passes] == [
        *numbers, (4, 2027), (4, 2028), (9, 2027), (4, 2029),
    ]  # fmt: skip
    assert [(forest.forest, forest.noise) for forest in passes] == [plan.forest_and_noise(n) for n in range(7)]
    assert all(forest.trunks == one.trunks and forest.trees_m == one.trees_m for forest in passes)


@given(st.integers(0, 2**70), st.integers(0, 10**6))
def test_trial_seed_is_63_bits_and_the_same_for_every_algorithm(seed: int, trial: int) -> None:
    plan = replace(campaign_of(1, "pledge"), seed=seed)
    assert 0 <= plan.trial_seed(trial) < 2**63
    assert plan.trial_seed(trial) == replace(plan, algorithms=("levy-walk",)).trial_seed(trial)
    others = plan.trial_seed(trial + 1), replace(plan, seed=seed + 1).trial_seed(trial)
    assert len({plan.trial_seed(trial), *others}) == 3


def test_trial_seed_never_changes() -> None:
    assert campaign_of(1).trial_seed(0) == 7519334944260373035


def test_spl_computes_the_shortest_paths_that_are_not_known() -> None:
    pytest.importorskip("skfmm", reason="scikit-fmm is not installed: pip install '.[hardware]'")
    plan = replace(campaign_of(1), spl=True)
    length_m = plan.make_forest(0).shortest_path_m
    assert length_m is not None
    assert 37.5 <= length_m < 80


def test_shortest_path_of_a_file_counts_only_for_a_body_of_its_width() -> None:
    """The reference forests give that of a body 0.4 m wide: a wider one must go round what that one fits through."""
    pytest.importorskip("skfmm", reason="scikit-fmm is not installed: pip install '.[hardware]'")
    forest = replace(generate_forest(0, 0, 0), shortest_path_m=41.5)
    plan = replace(campaign_of(1), forests=ForestFile("f", "", (forest,)))
    wide = replace(plan, rover=laid_over(plan.rover, {"vehicle": {"width_m": 0.8}}))
    assert [each.make_forest(0).shortest_path_m for each in (plan, replace(plan, spl=True), wide)] == [41.5, 41.5, None]
    assert replace(wide, spl=True).make_forest(0).shortest_path_m == shortest_path_m(forest, 0.8) != 41.5


def test_one_forest_serves_all_algorithms() -> None:
    made: list[int] = []

    class CountingCampaign(Campaign):
        def make_forest(self, trial: int):  # type: ignore[no-untyped-def]
            made.append(trial)
            return super().make_forest(trial)

    plan = CountingCampaign(("pledge", "levy-walk", "cv-react"), 3, campaign_of(1).rover)
    runner = TrialRunner(plan, run_trial=fake_trials.quick)
    for task in Results(plan).missing():
        runner(task)
    assert made == [0, 1, 2]


# --- running


@pytest.mark.process
def test_results_do_not_depend_on_workers_or_order_of_completion(tmp_path: Path) -> None:
    plan = campaign_of(40, "pledge", "levy-walk")
    alone = run_into(tmp_path / "1", plan)
    assert run_into(tmp_path / "2", plan, fake_trials.early_ones_last, jobs=2) == alone
    seen: list[Done] = []
    with ThreadPoolExecutor(4) as threads:
        options: dict[str, Any] = {"jobs": 4, "executor": threads, "progress": seen.append}
        assert run_into(tmp_path / "4", plan, fake_trials.early_ones_last, **options) == alone
        assert threads.submit(int, "7").result() == 7, "who made it shuts it down"
    assert [done.row.key for done in seen] != list(Results(plan).missing())
    with ProcessPoolExecutor(2, get_context("spawn")) as processes:
        assert run_into(tmp_path / "p", plan, jobs=2, executor=processes) == alone


def test_real_trials_do_not_mind_each_other_in_threads(tmp_path: Path) -> None:
    """A Dask worker may have several."""
    plan = replace(campaign_of(4, "pledge", "levy-walk"), budget_m=10.0)
    alone = run_into(tmp_path / "1", plan, None)
    with ThreadPoolExecutor(3) as threads:
        assert run_into(tmp_path / "3", plan, None, jobs=3, executor=threads) == alone
    assert b"fault" not in alone


def test_resuming_runs_only_what_is_missing_and_ends_in_the_same_bytes(tmp_path: Path) -> None:
    plan = campaign_of(20)
    whole = run_into(tmp_path / "whole", plan)
    with Results.kept(plan, tmp_path / "cut") as results:
        for trial in (4, 17, 2):
            results.add(TrialRunner(plan, run_trial=fake_trials.quick)(Task("forest-pledge", trial)).row)
    seen: list[Done] = []
    assert run_into(tmp_path / "cut", plan, resume=True, progress=seen.append) == whole
    assert {done.row.trial for done in seen} == set(range(20)) - {4, 17, 2}


def test_cost_is_of_this_run_and_not_of_what_was_kept(tmp_path: Path) -> None:
    plan = campaign_of(12, "pledge", "levy-walk")
    for trials, resume in ((24, False), (0, True)):
        with Results.kept(plan, tmp_path, resume=resume) as results:
            cost = run(results, run_trial=fake_trials.quick)
        assert results.finished
        assert (cost.trials, cost.ticks) == (trials, 100 * trials)
        assert (cost.cpu_us_per_tick is None) is resume
    assert list(results.by_algorithm) == ["pledge", "levy-walk"]


# --- what goes wrong


FAILING: list[tuple[RunTrial, str]] = [
    (fake_trials.third_fails, r"KeyError: 'no such\\nphase' \(fake_trials\.py:\d+\)"),
    (fake_trials.third_fails_oddly, r"(TwoArguments|RuntimeError: TwoArguments): out of phase \(fake_trials\.py:\d+\)"),
    (fake_trials.third_exits, r"SystemExit: enough \(fake_trials\.py:\d+\)"),
    (fake_trials.third_kills_its_worker, r"its process ended itself with exit code 9, as by os\._exit"),
    (fake_trials.third_is_killed, r"its process was killed, most likely for lack of memory \(then use fewer jobs\)"),
]


@pytest.mark.process
@pytest.mark.parametrize(
    ("run_trial", "what", "jobs"),
    [(*failing, jobs) for failing in FAILING for jobs in (1, 2) if jobs == 2 or failing in FAILING[:3]],
)
def test_trial_that_could_not_be_run_has_no_row_and_is_run_again(
    tmp_path: Path, run_trial: RunTrial, what: str, jobs: int
) -> None:
    """Whatever it raises says nothing of the rover."""
    plan = campaign_of(12)
    with pytest.raises(TrialNotRun) as raised:
        run_into(tmp_path / "out", plan, run_trial, jobs=jobs)
    kept = lines_in(tmp_path / "out" / TRIALS) - 1
    assert re.fullmatch(
        rf"trial 3 of forest-pledge could not be run: {what}; correct that and continue with --resume: "
        rf"{kept} of 12 trials are kept in {re.escape(str(tmp_path / 'out'))}",
        str(raised.value),
    )
    assert (raised.value.exit_code, kept >= 2) == (1, True)
    assert raised.value.__cause__ is not None
    assert b"fault" not in (tmp_path / "out" / TRIALS).read_bytes()
    assert run_into(tmp_path / "out", plan, resume=True) == run_into(tmp_path / "other", plan)


@pytest.mark.process
def test_error_of_another_process_is_the_cause_with_its_traceback() -> None:
    with pytest.raises(TrialNotRun, match="correct that and run it again") as raised:
        run(Results(campaign_of(12)), jobs=2, run_trial=fake_trials.third_fails)
    assert isinstance(raised.value.__cause__, KeyError)
    (note,) = raised.value.__cause__.__notes__
    assert "third_fails" in note


@pytest.mark.process
def test_executor_that_broke_says_which_trials_it_had() -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as processes, pytest.raises(TrialNotRun) as raised:
        run(Results(campaign_of(40)), executor=processes, run_trial=fake_trials.third_kills_its_worker)
    assert str(raised.value).startswith("trial 0 of forest-pledge, or one of the 3 after it, could not be run: A proc")


def test_forest_that_cannot_be_made_is_no_fault_of_the_rover(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(layout: int, noise: int, seed: int, trees_per_ha: float) -> None:
        raise ValueError(f"layout {layout}")

    monkeypatch.setattr("wayfarer.simhal.world.generate.generate_forest", broken)
    with pytest.raises(TrialNotRun, match="trial 0 of forest-pledge could not be run: ValueError: layout 0"):
        run(Results(campaign_of(1)), run_trial=fake_trials.quick)


def test_logs_of_two_trials_never_share_a_folder() -> None:
    names = {log_name(Task(name, trial)) for name in ("a:b", "a-b", "a.b", "a/b") for trial in (0, 1)}
    assert len(names) == 8
    assert log_name(Task("forest-pledge", 17)) == "forest-pledge-00017"


def test_stop_cancels_what_waits_and_keeps_what_runs_on_an_executor() -> None:
    rows: list[Done] = []

    def progress(done: Done) -> None:
        rows.append(done)
        if len(rows) == 1:
            signal.raise_signal(signal.SIGINT)

    with ThreadPoolExecutor(2) as threads:
        results = Results(campaign_of(400))
        run(results, jobs=2, executor=threads, run_trial=fake_trials.slow, progress=progress)
    assert not results.finished
    assert len(results.rows) == len(rows)
    assert len(rows) in {8, 12, 16}, "two chunks that had ended, and up to two that ran"


def lines_in(path: Path) -> int:
    return path.read_text().count("\n") if path.exists() else 0


def running_in_session(session: int) -> list[str]:
    """The processes of a session that are more than a corpse waiting to be buried."""
    stats = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            stats.append(path.read_text().rsplit(")", 1)[1].split())
        except OSError:
            continue
    return [fields[0] for fields in stats if int(fields[3]) == session and fields[0] not in "ZX"]


@pytest.mark.process
@pytest.mark.parametrize(("number", "jobs"), [(signal.SIGINT, 1), (signal.SIGINT, 2), (signal.SIGTERM, 2)])
def test_signal_keeps_finished_trials_and_resuming_ends_in_the_same_bytes(
    tmp_path: Path, number: signal.Signals, jobs: int
) -> None:
    out = tmp_path / "out"
    with fake_trials.started(out, str(jobs)) as process:
        assert eventually(lambda: lines_in(out / TRIALS) > 4)
        os.killpg(process.pid, number)
        stdout, stderr = process.communicate(timeout=UP_S)
    *_, last = stderr.splitlines()
    count = rf"(\d+) of {fake_trials.MANY} trials"
    said = re.fullmatch(rf"interrupted: {count} are kept in {re.escape(str(out))}; continue with --resume", last)
    assert said, stderr
    assert int(said[1]) == lines_in(out / TRIALS) - 1
    assert (process.returncode, stdout) == (130, "")
    assert "Traceback" not in stderr
    assert eventually(lambda: not running_in_session(process.pid))
    plan = campaign_of(fake_trials.MANY)
    assert run_into(out, plan, resume=True) == run_into(tmp_path / "whole", plan)


@pytest.mark.process
def test_workers_of_a_killed_campaign_end_too(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with fake_trials.started(out, "2") as process:
        assert eventually(lambda: lines_in(out / TRIALS) > 1)
        process.kill()
    assert eventually(lambda: not running_in_session(process.pid))
