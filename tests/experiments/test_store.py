from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryFile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.experiments import fake_trials
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput
from wayfarer.experiments import run_campaign
from wayfarer.experiments.campaign import Campaign, Task, Tasks
from wayfarer.experiments.executors import Done
from wayfarer.experiments.progress_bar import ProgressDisplay
from wayfarer.experiments.results_folder import TRIALS, ResultsFolder
from wayfarer.experiments.rows import TrialRow, csv_line
from wayfarer.experiments.store import TrialStore
from wayfarer.simhal.world.forest import Forest

ALGORITHMS = ("pledge", "levy-walk", "cv-react")
TRIALS_OF_EACH = 4
TASKS = Tasks(ALGORITHMS, TRIALS_OF_EACH)


def row(task: Task, path_m: float = 80.5) -> TrialRow:
    return TrialRow(task.trial, task.algorithm, 3, 1, 77, "escaped", path_m, ticks=9)


def test_tasks_come_forest_by_forest() -> None:
    assert [*Tasks(("a", "b"), 2)] == [("a", 0), ("b", 0), ("a", 1), ("b", 1)]
    assert Tasks(("a", "b"), 2)[1:3] == [Task("b", 0), Task("a", 1)]
    assert [*Tasks(("a", "b"), 9, [17, 2])] == [("b", 8), ("a", 1)]


@given(st.lists(st.sampled_from([*TASKS])))
def test_rows_come_back_in_order_and_what_is_missing_is_the_rest(finished: list[Task]) -> None:
    with TemporaryFile() as file:
        kept = TrialStore.begun(file, TASKS)
        for number, task in enumerate(finished):
            kept.append(row(task, number))
            assert len([*kept]) == len(kept)  # reading between two trials disturbs neither
        latest = {task: row(task, number) for number, task in enumerate(finished)}
        in_order = [Task(name, trial) for name in ALGORITHMS for trial in range(TRIALS_OF_EACH)]
        assert [*kept] == [latest[task] for task in in_order if task in latest]
        assert [*kept.missing()] == [task for task in TASKS if task not in latest]
        assert [*TrialStore(file, TASKS, "again", TrialRow._fields)] == [*kept]


@pytest.mark.parametrize("stranger", [Task("oo-react", 0), Task("pledge", TRIALS_OF_EACH), Task("pledge", -1)])
def test_trial_that_the_campaign_does_not_have_is_damage(stranger: Task) -> None:
    with TemporaryFile() as file:
        file.write((csv_line(TrialRow._fields) + csv_line(TrialRow._fields, row(stranger))).encode())
        with pytest.raises(BadInput, match=rf"trials\.csv is damaged: .* no trial {stranger.trial} of '{stranger[0]}'"):
            TrialStore(file, TASKS, "trials.csv", TrialRow._fields)


# --- memory

FEW, MANY = 600, 1800
A_ROW_IS_BYTES = 400  # at least, with its numbers
FOREST = Campaign(("pledge",), 1, load_rover("sim")).make_forest(0)


class OneForest(Campaign):
    def make_forest(self, trial: int) -> Forest:
        return FOREST


class Hoarding(ProgressDisplay):
    def __init__(self) -> None:
        self.done: list[Done] = []

    def advance(self, done: Done) -> None:
        self.done.append(done)


def peak_bytes(trials: int, folder: Path, progress: ProgressDisplay) -> int:
    plan = OneForest(("pledge",), trials, load_rover("sim"))
    tracemalloc.start()
    with ResultsFolder(folder, plan.settings()) as out:
        run_campaign.run(plan, out, progress=progress, run_trial=fake_trials.quick)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (folder / TRIALS).read_bytes().count(b"\n") == trials + 1
    return peak


@pytest.mark.parametrize(("progress", "hoards"), [(ProgressDisplay, False), (Hoarding, True)])
def test_campaign_keeps_no_rows_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, progress: Callable[[], ProgressDisplay], hoards: bool
) -> None:
    """The second case keeps them, so that the first is known to notice it."""
    monkeypatch.setattr("wayfarer.experiments.parquet.ROW_GROUP", 100)
    peak_bytes(FEW, tmp_path / "warm", ProgressDisplay())
    few, many = (peak_bytes(trials, tmp_path / str(trials), progress()) for trials in (FEW, MANY))
    a_trial_bytes = (many - few) / (MANY - FEW)
    assert (a_trial_bytes > A_ROW_IS_BYTES) == hoards
    assert hoards or a_trial_bytes < 60
