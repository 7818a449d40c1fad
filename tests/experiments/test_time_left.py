"""The time that a campaign still takes, and the order that keeps it short; workers and their clock are virtual."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from math import sqrt
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.progress import Progress

from tests.experiments.fake_trials import campaign_of
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.campaign import Task, Tasks
from wayfarer.experiments.executors import LARGEST_CHUNK, in_chunks
from wayfarer.experiments.progress_bar import TimeLeftColumn
from wayfarer.experiments.time_left import RELATIVE_COST, TimeLeft, relative_cost

PAPER = tuple(CATALOGUE)


class Finished(NamedTuple):
    at_s: float
    task: Task
    took_s: float


def virtual_workers(tasks: Tasks, jobs: int, took_s: Callable[[Task], float]) -> Iterator[Finished]:
    """Workers that take one chunk after the other, and hand over its trials when the last of them is done."""
    free = [(0.0, worker) for worker in range(jobs)]
    done: list[Finished] = []
    for chunk in in_chunks(tasks, jobs, lambda task: relative_cost(task.algorithm)):
        began_s, worker = heappop(free)
        costs_s = [took_s(task) for task in chunk]
        heappush(free, (began_s + sum(costs_s), worker))
        done += [Finished(began_s + sum(costs_s), *pair) for pair in zip(chunk, costs_s, strict=True)]
    yield from sorted(done, key=lambda finished: finished.at_s)


@given(st.integers(0, 300), st.integers(1, 8))
def test_every_trial_is_in_one_chunk_and_the_last_ones_come_longest_first(trials: int, jobs: int) -> None:
    tasks = Tasks(("pledge", "levy-walk"), trials)
    chunks = list(in_chunks(tasks, jobs, lambda task: relative_cost(task.algorithm)))
    assert Counter(task for chunk in chunks for task in chunk) == Counter(tasks)
    singles = [chunk[0].algorithm for chunk in chunks if len(chunk) == 1]
    assert singles == sorted(singles, key=relative_cost, reverse=True)
    assert {len(chunk) for chunk in chunks} <= {1, LARGEST_CHUNK}


@pytest.mark.parametrize("jobs", [2, 4, 8])
def test_workers_finish_within_one_short_trial_of_each_other(jobs: int) -> None:
    ends_s = dict.fromkeys(range(jobs), 0.0)
    for chunk in in_chunks(Tasks(PAPER, 20), jobs, lambda task: relative_cost(task.algorithm)):
        worker = min(ends_s, key=ends_s.__getitem__)
        ends_s[worker] += sum(relative_cost(task.algorithm) for task in chunk)
    assert max(RELATIVE_COST.values()) > 5
    assert max(ends_s.values()) - min(ends_s.values()) <= 1.2


@given(st.integers(0, 2**32), st.floats(0.01, 10.0), st.integers(1, 4))
def test_estimate_is_near_the_truth_though_the_table_is_wrong_and_trials_scatter(
    seed: int, unit_s: float, jobs: int
) -> None:
    """The table is wrong by up to two either way; each trial takes 0.2 to 1.8 of the mean of its algorithm.

    The error of a mean goes down with the root of the number of forests done; of 500 seeds the worst had 0.8 over it,
    and a change of 1.6 over the number, the median seed 0.35 and 0.9.
    """
    random = Random(seed)
    wrong_by = {name: random.uniform(0.5, 2.0) for name in PAPER}
    tasks = Tasks(PAPER, 60)

    def took_s(task: Task) -> float:
        return unit_s * relative_cost(task.algorithm) * wrong_by[task.algorithm] * random.uniform(0.2, 1.8)

    done = list(virtual_workers(tasks, jobs, took_s))
    whole_s = done[-1].at_s
    estimate, end_s = TimeLeft(tasks.by_algorithm(), jobs), whole_s
    for number, finished in enumerate(done, 1):
        estimate.take(finished.task.algorithm, finished.took_s)
        left_s, before_s = estimate.left_s, end_s
        assert left_s is not None
        assert left_s >= 0
        forests, end_s = number / len(PAPER), finished.at_s + left_s
        if forests > 3:
            assert abs(end_s - whole_s) < 1.2 * whole_s / sqrt(forests)
            assert abs(end_s - before_s) < 2.5 * whole_s / forests
    assert end_s == pytest.approx(whole_s)


def test_trials_of_an_algorithm_that_has_not_been_run_cost_what_the_table_says() -> None:
    estimate = TimeLeft({"forest-pledge": 100, "levy-walk": 100}, jobs=2)
    assert estimate.left_s is None
    for _ in range(100):
        estimate.take("forest-pledge", 0.5)
    assert estimate.left_s == pytest.approx(100 * 0.5 * RELATIVE_COST["levy-walk"] / 2)


def test_last_trial_is_not_shared_out_among_all_workers() -> None:
    estimate = TimeLeft({"pledge": 8}, jobs=4)
    for _ in range(7):
        estimate.take("pledge", 3.0)
    assert estimate.left_s == pytest.approx(3.0)


def test_trials_left_are_counted_by_algorithm_also_where_some_are_kept() -> None:
    tasks = campaign_of(3, "pledge", "levy-walk").tasks_by_forest()
    assert tasks.by_algorithm() == {"pledge": 3, "levy-walk": 3}
    assert tasks.only([1, 2, 3, 5]).by_algorithm() == {"pledge": 1, "levy-walk": 3}


def test_time_left_counts_down_between_trials_and_stops_at_zero() -> None:
    now_s = 100.0
    bar = Progress(get_time=lambda: now_s, disable=True)
    bar.add_task("trials", total=10)
    (task,) = bar.tasks
    bar.update(task.id, advance=1, ends_at_s=100.0 + 3725)
    column = TimeLeftColumn()
    assert column.render(task).plain == "1:02:05"
    now_s += 60
    assert column.render(task).plain == "1:01:05"
    now_s += 10_000
    assert column.render(task).plain == "0:00:00"


def test_time_left_of_a_batch_without_an_estimate_follows_its_rate() -> None:
    now_s = 0.0
    bar = Progress(get_time=lambda: now_s)
    bar.add_task("runs", total=10)
    (task,) = bar.tasks
    for _ in range(3):
        now_s += 1.0
        bar.update(task.id, advance=1)
    assert TimeLeftColumn().render(task).plain == "0:00:07"
