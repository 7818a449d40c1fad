"""``wayfarer faults --detector``: a table of precision, recall and delay per anomaly."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.escape.api import Anomaly
from wayfarer.experiments.commands import INTERRUPTED, make_empty_folder
from wayfarer.experiments.executors import Stopped
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.statistics import wilson_interval
from wayfarer.fault_scenarios.batch import run_batch
from wayfarer.fault_scenarios.detector_score import NOTHING, Score
from wayfarer.fault_scenarios.detector_trials import CELLS, DetectorCase, Scores, measure
from wayfarer.files.atomic_file import write_atomically
from wayfarer.views.text.scripting import print_json
from wayfarer.views.text.terminal_table import Column
from wayfarer.views.text.terminal_table import table as terminal_table

TRIALS = 50  # of each cell, where nobody says how many
JSON_FILE = "detector.json"
LEGEND = (
    "recall: share of episodes that were noticed",
    "precision: share of claims that were true",
    "at least: lower end of the 95 % interval",
    "delay: from an episode's beginning to its claim, median",
)

Measured = Mapping[DetectorCase, Scores]
DetectorTask = tuple[DetectorCase, int]  # a case, and the number of the trial


class DetectorRow(NamedTuple):
    """How well one anomaly was noticed in the trials of one cell."""

    anomaly: Anomaly
    cell: DetectorCase
    score: Score


def run_detector(
    rover: str | None, trials: int | None, jobs: int | None, out: Path | None, cells: Sequence[DetectorCase] = CELLS,
    *, as_json: bool = False,
) -> int:  # fmt: skip
    """Measure the detector against what the simulated world knows, print the table, and return 0, or 130 if stopped.

    Raises:
        BadInput: ``out`` is not new or empty, or there is no such rover.
        WayfarerError: a worker died.
    """
    aside = Console(stderr=True)
    config = load_rover(rover or "sim")
    if out is not None:
        make_empty_folder(out, "the detector's table")
    try:
        measured = _measured(config, cells, trials or TRIALS, jobs)
    except Stopped:
        say(aside, "interrupted: no table")
        return INTERRUPTED
    if as_json:
        print_json({"table": objects(measured)})
    else:
        console = Console()
        console.print(table(measured))
        for line in LEGEND:
            say(console, line)
    if out is not None:
        write_atomically(out / JSON_FILE, json.dumps(objects(measured), indent=1) + "\n")
        say(aside, f"the results are in {out}")
    return 0


def _measured(config: RoverConfig, cells: Sequence[DetectorCase], trials: int, jobs: int | None) -> Measured:
    tasks = [(cell, trial) for trial in range(trials) for cell in cells]
    measured = {cell: dict.fromkeys(Anomaly, NOTHING) for cell in cells}
    done = run_batch(partial(_scores_of, config), tasks, jobs, "trials")
    for (cell, _), scores in sorted(done, key=lambda each: each[0][1]):  # the same on any number of workers
        measured[cell] = {anomaly: measured[cell][anomaly] + scores[anomaly] for anomaly in Anomaly}
    return measured


def _scores_of(config: RoverConfig, task: DetectorTask) -> tuple[DetectorTask, Scores]:
    return task, measure(config, *task)


def rows(measured: Measured) -> Iterator[DetectorRow]:
    """Yield the rows of the table: contact for touches, motion for all else."""
    for anomaly in Anomaly:
        for cell, scores in measured.items():
            if (cell.source == "contact") is (anomaly is Anomaly.TOUCHED):
                yield DetectorRow(anomaly, cell, scores[anomaly])


def table(measured: Measured) -> Table:
    """Return the table for a terminal."""
    in_mujoco = any(cell.friction is not None for cell in measured)
    columns: list[Column[DetectorRow]] = [
        Column("anomaly", lambda row: row.anomaly.value, left=True),
        Column("fric-\ntion" if in_mujoco else "slip\nm", lambda row: _ground(row.cell)),
        Column("noise", lambda row: f"{row.cell.noise:g}x"),
        Column("episodes", lambda row: str(row.score.episodes)),
        Column("recall", lambda row: _share(row.score.found, row.score.episodes)),
        Column("at\nleast", lambda row: _share_at_least(row.score.found, row.score.episodes)),
        Column("claims", lambda row: str(row.score.claims)),
        Column("preci-\nsion", lambda row: _share(row.score.right, row.score.claims)),
        Column("at\nleast", lambda row: _share_at_least(row.score.right, row.score.claims)),
        Column("delay\ns", lambda row: _delay(row.score, 0)),
        Column("p95\ns", lambda row: _delay(row.score, 1)),
    ]
    return terminal_table(columns, rows(measured), gap=1)


def objects(measured: Measured) -> list[dict[str, Any]]:
    """Return the rows with all their numbers; ``delay_s`` is median and 95th percentile."""
    return [
        {"anomaly": anomaly.value, **cell._asdict(), **each._asdict(), "delay_s": delay_s(each)}
        for anomaly, cell, each in rows(measured)
    ]


def delay_s(each: Score) -> tuple[float, float] | None:
    """Return median and 95th percentile, or None of too few."""
    if len(each.delays_s) < 2:
        return None
    middle, late = np.quantile(each.delays_s, (0.5, 0.95), method="weibull").tolist()
    return middle, late


def _ground(cell: DetectorCase) -> str:
    return f"{cell.slip_mean_m if cell.friction is None else cell.friction:g}"


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else "-"


def _share_at_least(part: int, whole: int) -> str:
    """Return the lower end of a share's interval."""
    return f"{wilson_interval(part, whole)[0]:.3f}" if whole else "-"


def _delay(each: Score, which: int) -> str:
    delay = delay_s(each)
    return "-" if delay is None else f"{delay[which]:.2f}"
