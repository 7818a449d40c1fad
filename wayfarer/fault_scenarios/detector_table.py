"""``wayfarer faults --detector``: a table of precision, recall and delay per anomaly."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from rich.console import Console
from rich.table import Table

from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.escape.api import Anomaly
from wayfarer.experiments.commands import INTERRUPTED, cores, make_empty_folder
from wayfarer.experiments.executors import Stopped, stream
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.run_campaign import stop_on_signals
from wayfarer.experiments.statistics import wilson_interval
from wayfarer.fault_scenarios.batch_progress import shown, worker_death_explained
from wayfarer.fault_scenarios.detector_score import NOTHING, Score
from wayfarer.fault_scenarios.detector_trials import CELLS, DetectorCase, DetectorRunner, DetectorTask, Scores
from wayfarer.fieldlog.atomic_file import whole_file

TRIALS = 50  # of each cell, where nobody says how many
JSON_FILE = "detector.json"
SLIP = "slip\nm"  # in MuJoCo the friction is in its place
TITLES = (
    "anomaly", SLIP, "\nnoise", "\nepisodes", "\nrecall", "at\nleast", "\nclaims", "preci-\nsion",
    "at\nleast", "delay\ns", "p95\ns",
)  # fmt: skip
LEGEND = (
    "recall: share of episodes that were noticed; precision: share of claims that were true",
    "at least: lower end of the 95 % interval; delay: from an episode's beginning to its claim, median",
)

Measured = Mapping[DetectorCase, Scores]


def run_detector(
    rover: str | None, trials: int | None, jobs: int | None, out: Path | None, cells: Sequence[DetectorCase] = CELLS
) -> int:
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
        measured = _measured(config, cells, trials or TRIALS, jobs or cores(), aside)
    except Stopped:
        say(aside, "interrupted: no table")
        return INTERRUPTED
    console = Console()
    console.print(table(measured))
    for line in LEGEND:
        say(console, line)
    if out is not None:
        with whole_file(out / JSON_FILE) as draft:
            draft.write_text(json.dumps(as_json(measured), indent=1) + "\n", encoding="utf-8")
        say(aside, f"the results are in {out}")
    return 0


def _measured(config: RoverConfig, cells: Sequence[DetectorCase], trials: int, jobs: int, aside: Console) -> Measured:
    tasks = [DetectorTask(cell, trial) for trial in range(trials) for cell in cells]
    done: list[tuple[DetectorCase, Scores]] = []
    with (
        stop_on_signals() as stop,
        worker_death_explained(done, "trials"),
        closing(stream(DetectorRunner(config), tasks, min(jobs, len(tasks)), stop)) as running,
    ):
        done.extend(shown(running, len(tasks), "trials", aside))
    return {cell: together([scores for of, scores in done if of == cell]) for cell in cells}


def together(scores: Sequence[Scores]) -> Scores:
    """Return the scores of several trials as one."""
    return {anomaly: sum((each[anomaly] for each in scores), NOTHING) for anomaly in Anomaly}


def rows(measured: Measured) -> Iterator[tuple[Anomaly, DetectorCase, Score]]:
    """Yield the rows of the table: contact for touches, motion for all else."""
    for anomaly in Anomaly:
        for cell, scores in measured.items():
            if (cell.source == "contact") is (anomaly is Anomaly.TOUCHED):
                yield anomaly, cell, scores[anomaly]


def table(measured: Measured) -> Table:
    """Return the table for a terminal."""
    made = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    in_mujoco = any(cell.friction is not None for cell in measured)
    for title in TITLES:
        shown_title = "fric-\ntion" if in_mujoco and title == SLIP else title
        made.add_column(shown_title, justify="left" if title == TITLES[0] else "right")
    for anomaly, cell, each in rows(measured):
        delay = delay_s(each)
        made.add_row(
            anomaly.value, f"{cell.slip_mean_m if cell.friction is None else cell.friction:g}", f"{cell.noise:g}x",
            str(each.episodes),
            *_share(each.found, each.episodes), str(each.claims), *_share(each.right, each.claims),
            *(("-", "-") if delay is None else (f"{seconds:.2f}" for seconds in delay)),
        )  # fmt: skip
    return made


def as_json(measured: Measured) -> list[dict[str, Any]]:
    """Return the rows with all their numbers; ``delay_s`` is median and 95th percentile."""
    return [
        {"anomaly": anomaly.value, **cell._asdict(), **each._asdict(), "delay_s": delay_s(each)}
        for anomaly, cell, each in rows(measured)
    ]


def delay_s(each: Score) -> tuple[float, float] | None:
    """Return median and 95th percentile, or None of too few."""
    if len(each.delays_s) < 2:
        return None
    return median(each.delays_s), quantiles(each.delays_s, n=20)[-1]


def _share(part: int, whole: int) -> tuple[str, str]:
    """Return a share and the lower end of its interval."""
    if not whole:
        return "-", "-"
    return f"{part / whole:.3f}", f"{wilson_interval(part, whole)[0]:.3f}"
