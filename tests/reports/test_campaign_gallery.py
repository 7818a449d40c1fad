"""Which trials are drawn, and that no drawing shows another run than the table's."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.reports.campaigns import campaign_of, row
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import TrialRow
from wayfarer.reports.worst_trials import RerunTrial, choose, ending, run_again


@pytest.fixture(scope="module")
def worst(finished: Path) -> list[RerunTrial]:
    """The four worst trials, run again."""
    return again(choose(Results.open(finished).by_algorithm, 4), finished)


def again(rows: Sequence[TrialRow], folder: Path) -> list[RerunTrial]:
    return run_again(Results.open(folder).rebuild(), rows, 1, lambda _: None)


@st.composite
def campaigns(draw: st.DrawFn) -> dict[str, list[TrialRow]]:
    outcomes = st.sampled_from(["escaped", "left_bounds", "entrapped", "tipped", "fault"])
    path_m = st.integers(1, 9).map(float) | st.none()
    return {
        name: [row(name, trial, draw(outcomes), draw(path_m)) for trial in range(draw(st.integers(1, 6)))]
        for name in draw(st.lists(st.sampled_from("abcde"), unique=True, min_size=1))
    }


@given(campaigns(), st.integers(0, 20))
def test_every_algorithm_has_its_turn_before_one_has_a_second(by_name: dict[str, list[TrialRow]], count: int) -> None:
    drawable = {name: [row for row in rows if row.path_m] for name, rows in by_name.items()}
    chosen = choose(by_name, count)
    assert len(chosen) == len({row.key for row in chosen}) == min(count, sum(map(len, drawable.values())))
    turns = {name: sum(row.algorithm == name for row in chosen) for name in drawable}
    for name, rows in drawable.items():
        assert turns[name] == len(rows) or turns[name] >= max(turns.values()) - 1


@given(campaigns(), st.integers(0, 20))
def test_of_each_algorithm_failures_come_first_then_the_longest(by_name: dict[str, list[TrialRow]], count: int) -> None:
    def badness(row: TrialRow) -> tuple[bool, float]:
        assert row.path_m is not None
        return row.outcome not in SUCCESSES, row.path_m

    chosen = choose(by_name, count)
    assert [badness(row) for row in chosen] == sorted(map(badness, chosen), reverse=True)
    for name, rows in by_name.items():
        taken = [badness(row) for row in chosen if row.algorithm == name]
        left = [badness(row) for row in rows if row.path_m and row not in chosen]
        assert not taken or not left or min(taken) >= max(left)


def test_fewer_drawings_than_algorithms_show_the_worst() -> None:
    by_name = {
        "pledge": [row("pledge", 0, path_m=60.0)],
        "levy-walk": [row("levy-walk", 0, "entrapped", 1000.0)],
        "cv-react": [row("cv-react", 0, path_m=70.0)],
    }
    assert [row.algorithm for row in choose(by_name, 2)] == ["levy-walk", "cv-react"]


def test_way_is_that_of_the_trial_in_the_table(finished: Path, worst: list[RerunTrial]) -> None:
    assert [each.row for each in worst] == choose(Results.open(finished).by_algorithm, 4)
    for each in worst:
        assert each.trajectory is not None
        start, *_, end = each.trajectory.points
        assert (start.x_m, start.y_m) == campaign_of().make_forest(each.row.trial).start_m
        escaped = each.row.outcome == "escaped"
        assert (end.y_m >= 50.0) is escaped


def test_processes_give_the_same_paths_and_progress_of_each_trial(finished: Path, worst: list[RerunTrial]) -> None:
    done: list[Any] = []
    rows = [each.row for each in worst]
    assert run_again(Results.open(finished).rebuild(), rows, 2, done.append) == worst
    assert {again.row.key for again in done} == {row.key for row in rows}


@pytest.mark.parametrize(
    ("column", "value", "says"),
    [
        ("path_m", 12.5, r"after 12\.5 m in the table, \w+ after [\d.]+ m now"),
        ("outcome", "tipped", r"tipped after [\d.]+ m in the table, \w+ after [\d.]+ m now"),
        ("anomalies", 9999, r"anomalies is 9999 in the table and \d+ now"),
        ("seed", 1, r"seed is 1 in the table and \d+ now"),
    ],
)
def test_trial_that_comes_out_in_another_way_has_no_drawing(finished: Path, column: str, value: Any, says: str) -> None:
    original = choose(Results.open(finished).by_algorithm, 1)[0]
    (ran,) = again([original._replace(**{column: value})], finished)
    assert ran.trajectory is None
    assert re.search(says, ran.why_not)


def test_trial_that_cannot_be_run_again_has_no_drawing_and_says_why(finished: Path) -> None:
    (ran,) = again([row("gone:algorithm", 0)], finished)
    assert ran.trajectory is None
    assert "cannot be run again: algorithm 'gone:algorithm'" in ran.why_not


def test_endings_read_well() -> None:
    assert ending(row("pledge", 0)) == "escaped after 80.0 m"
    assert ending(row("pledge", 0, "left_bounds")) == "left the map after 80.0 m"
    assert ending(row("pledge", 0, "fault", None)) == "fault"
