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
from wayfarer.experiments.results_folder import TRIALS, ResultsFolder
from wayfarer.experiments.rows import TrialRow, csv_line
from wayfarer.experiments.store import TrialStore
from wayfarer.simhal.world.forest import Forest

ALGORITHMS = ("pledge", "levy-walk", "cv-react")
TRIALS_OF_EACH = 4
TASKS = Tasks(ALGORITHMS, TRIALS_OF_EACH)


def row(task: Task) -> TrialRow:
    return TrialRow(task.trial, task.algorithm, 3, 1, 77, "escaped", 80.5, ticks=9)


def test_tasks_come_forest_by_forest() -> None:
    assert [*Tasks(("a", "b"), 2)] == [Task("a", 0), Task("b", 0), Task("a", 1), Task("b", 1)]
    assert [*Tasks(("a", "b"), 9).only([17, 2])] == [Task("b", 8), Task("a", 1)]


def test_tasks_of_a_sweep_come_forest_by_forest_and_go_into_the_table_point_by_point() -> None:
    tasks = Tasks(("a", "b"), trials=2, points=3)
    assert [*tasks] == [Task(name, trial, point) for trial in range(2) for point in range(3) for name in "ab"]
    assert [tasks.number(task) for task in tasks] == list(range(len(tasks)))
    assert [*tasks.in_table_order()] == [
        Task(name, trial, point) for point in range(3) for name in "ab" for trial in range(2)
    ]
    assert [tasks.number(Task(*odd)) for odd in [("c", 0, 0), ("a", 2, 0), ("a", 0, 3), ("a", 0, -1)]] == [None] * 4


@given(st.lists(st.sampled_from([*TASKS])))
def test_rows_come_back_in_order_and_what_is_missing_is_the_rest(finished: list[Task]) -> None:
    with TemporaryFile() as file:
        kept = TrialStore(file, TASKS, TrialRow._fields, "new")
        for task in finished:
            kept.append(row(task))
            assert len([*kept]) == len(kept)  # reading between two trials disturbs neither
        in_order = [Task(name, trial) for name in ALGORITHMS for trial in range(TRIALS_OF_EACH)]
        assert [*kept] == [row(task) for task in in_order if task in finished]
        assert [*kept.missing()] == [task for task in TASKS if task not in finished]
        assert [*TrialStore(file, TASKS, TrialRow._fields, "again")] == [*kept]


@pytest.mark.parametrize("stranger", [Task("oo-react", 0), Task("pledge", TRIALS_OF_EACH)])
def test_trial_that_the_campaign_does_not_have_is_damage(stranger: Task) -> None:
    with TemporaryFile() as file:
        file.write((csv_line(TrialRow._fields) + csv_line(TrialRow._fields, row(stranger))).encode())
        with pytest.raises(BadInput, match=rf"trials\.csv is damaged: .* no trial {stranger.trial} of '{stranger[0]}'"):
            TrialStore(file, TASKS, TrialRow._fields, "trials.csv")


# --- memory

FEW, MANY = 300, 900
A_ROW_IS_BYTES = 400  # at least, with its numbers
FOREST = Campaign(("pledge",), 1, load_rover("sim")).make_forest(0)


class OneForest(Campaign):
    def make_forest(self, trial: int) -> Forest:
        return FOREST


def peak_bytes(trials: int, folder: Path, progress: Callable[[Done], object] | None) -> int:
    plan = OneForest(("pledge",), trials, load_rover("sim"))
    tracemalloc.start()
    with ResultsFolder(folder, plan.settings()) as out:
        run_campaign.run(plan, out, progress=progress, run_trial=fake_trials.quick)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (folder / TRIALS).read_bytes().count(b"\n") == trials + 1
    return peak


@pytest.mark.parametrize("hoards", [False, True])
def test_campaign_keeps_no_rows_in_memory(tmp_path: Path, hoards: bool) -> None:
    """The second case keeps them, so that the first is known to notice it."""
    peak_bytes(FEW, tmp_path / "warm", None)
    hoard: list[Done] = []
    few, many = (peak_bytes(n, tmp_path / str(n), hoard.append if hoards else None) for n in (FEW, MANY))
    a_trial_bytes = (many - few) / (MANY - FEW)
    assert (a_trial_bytes > A_ROW_IS_BYTES) == hoards
    assert hoards or a_trial_bytes < 60
