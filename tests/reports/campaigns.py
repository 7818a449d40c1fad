"""Campaigns to report on: a real one, small and quick, and rows that say what a test wants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tests.simhal.forest_lines import lines_of
from wayfarer.cli import run_trials
from wayfarer.config.rover_file import load_rover
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.run import RunTrial
from wayfarer.simhal.world.forest_file import read_forest_file
from wayfarer.simhal.world.generate import generate_forest

ALGORITHMS = ("forest-pledge", "levy-walk", "cv-react")
TRIALS = 3
BUDGET_M = 90.0  # some of these trials end entrapped

STRANGERS = ("my_package.my_rules:a_spiral_that_grows", "someone:zig_zag")


def some_forests(path: Path) -> Path:
    """Write a file of two forests, and return its path."""
    forests = [replace(generate_forest(number, 0, 0), shortest_path_m=38.5 + number) for number in range(2)]
    path.write_bytes(lines_of(forests))
    return path


def campaign_of(forests: Path | None = None, algorithms: Sequence[str] = ALGORITHMS) -> Campaign:
    file = read_forest_file(forests) if forests else None
    return Campaign(tuple(algorithms), TRIALS, load_rover("sim"), budget_m=BUDGET_M, forests=file)


def run_campaign(
    out: Path,
    *,
    forests: Path | None = None,
    algorithms: Sequence[str] = ALGORITHMS,
    run_trial: RunTrial | None = None,
) -> None:
    campaign, command = campaign_of(forests, algorithms), ["wayfarer", "sim", "--out", f"{Path.home()}/results"]
    assert run_trials.run_all(campaign, out, jobs=1, forests=forests, run_trial=run_trial, command=command) == 0


def row(algorithm: str, trial: int, outcome: str = "escaped", path_m: float | None = 80.0) -> TrialRow:
    spl = 0.5 if outcome in SUCCESSES else 0.0
    return TrialRow(trial, algorithm, trial // 2, trial % 2, 7, outcome, path_m, 2.0, 90.0, 12, 5, 39.0, spl)


def rows_of(algorithms: Sequence[str], trials: int = 40) -> dict[str, list[TrialRow]]:
    """Trials of many lengths, some of them failures: one more for each algorithm."""
    return {
        name: [
            *(row(name, n, "entrapped", 1000.0) for n in range(failures)),
            *(row(name, n, path_m=40.0 + 3.0 ** (n % 7)) for n in range(failures, trials)),
        ]
        for failures, name in enumerate(algorithms)
    }


def names(count: int) -> list[str]:
    """Return that many algorithms: the catalogue's, then strangers'."""
    return [*CATALOGUE, *STRANGERS][:count]
