"""A sample of the reference forests: wayfarer escapes from them about as the released simulator did."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import fmean, median

import pytest

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import TrialResult, run_trial
from wayfarer.simhal.world.forest_file import ForestFile, read_forest_file

SAMPLE = range(0, 500, 21)  # 24 of the 500, over all layouts and both noises


def trials_of(file: ForestFile, algorithm: str, sample: range = SAMPLE, budget_m: float = 1000.0) -> list[TrialResult]:
    campaign = Campaign((algorithm,), 500, load_rover("sim"), forests=file, budget_m=budget_m)
    return [run_trial(campaign.spec(Task(algorithm, trial), campaign.make_forest(trial))) for trial in sample]


@pytest.fixture(scope="module")
def file() -> ForestFile:
    return read_forest_file("reference")


@pytest.fixture(scope="module")
def ours(file: ForestFile) -> list[TrialResult]:
    return trials_of(file, "forest-pledge")


@pytest.fixture(scope="module")
def theirs(reference_results_path: Path, ours: list[TrialResult]) -> list[dict[str, float | str]]:
    """What the released simulator did in the same forests."""
    text = reference_results_path.read_text(encoding="utf-8")
    by_forest = {(row["forest"], row["noise"]): row for row in map(json.loads, text.splitlines())}
    return [by_forest[result.forest, result.noise] for result in ours]


def test_forest_pledge_gets_out_of_every_forest(ours: list[TrialResult]) -> None:
    assert {result.outcome for result in ours} <= {"escaped", "left_bounds"}


def test_paths_are_about_as_long_as_the_reference(
    ours: list[TrialResult], theirs: list[dict[str, float | str]]
) -> None:
    our_paths_m = [result.path_m for result in ours]
    their_paths_m = [float(row["path_m"]) for row in theirs]
    assert 0.7 < fmean(our_paths_m) / fmean(their_paths_m) < 1.15
    assert 0.7 < median(our_paths_m) / median(their_paths_m) < 1.15


def test_no_path_beats_the_geodesic(ours: list[TrialResult]) -> None:
    """But for the rounding of a geodesic on a grid of 0.1 m."""
    assert all(r.shortest_path_m is not None and r.path_m > 0.99 * r.shortest_path_m for r in ours)
    assert all(r.spl is not None and 0.1 < r.spl <= 1.0 for r in ours)


@pytest.mark.long
def test_levy_walk_takes_far_longer(file: ForestFile, ours: list[TrialResult]) -> None:
    walks = trials_of(file, "levy-walk", SAMPLE[::2], budget_m=150.0)
    assert sum(walk.outcome == "entrapped" for walk in walks) > len(walks) / 4
    assert fmean(walk.path_m for walk in walks) > fmean(result.path_m for result in ours)
