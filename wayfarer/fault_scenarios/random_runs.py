"""Runs many random scenarios, and reports those that break a safety rule.

A trial is its seed: the first has the seed that was asked for, each further one the next, so that any of them can be
run again alone. Its row is the same on any number of workers.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from wayfarer.experiments.commands import INTERRUPTED, make_empty_folder
from wayfarer.experiments.executors import Stopped
from wayfarer.experiments.progress_bar import say
from wayfarer.fault_scenarios.batch import run_batch
from wayfarer.fault_scenarios.random_scenarios import draw_scenario, refuse_missing_package
from wayfarer.fault_scenarios.runner import RunResult, run_scenario
from wayfarer.fault_scenarios.scenario import RESPONSE_LEVELS, Expectation, ResponseLevel, Scenario
from wayfarer.fault_scenarios.scenario_writer import as_toml
from wayfarer.fault_scenarios.shrink import shrink
from wayfarer.files.atomic_file import write_atomically
from wayfarer.safety.conditions import Level
from wayfarer.simhal.build_rover import Depth
from wayfarer.views.text.scripting import print_json
from wayfarer.views.text.summary_text import counted

ROWS_FILE = "trials.jsonl"
SHOWN = 10  # trials with a broken rule, one after the other; further ones are counted
BUG = "Bug"  # what ``task_crash`` raises
# How a run may end by an error: a part that does not answer when it is opened, and a bug that was injected.
REFUSALS = frozenset({"NotResponding", "WrongPart", "BadReading", BUG})


class RandomTrial(NamedTuple):
    """What came of one scenario: ``ended`` is the run's reason or its error, ``excused`` see ``Invariants``."""

    seed: int
    rover: str
    depth: str
    algorithm: str
    for_s: float
    faults: tuple[str, ...]
    kinds: tuple[str, ...]
    ended: str = ""
    level: str = ResponseLevel.NONE.value
    cause: str = ""
    ticks: int = 0
    excused: int = 0
    broken: tuple[str, ...] = ()


def run_seed(rover: str | None, depth: Depth | None, seed: int) -> RandomTrial:
    """Run the scenario of a seed; an error becomes its row's broken rule."""
    scenario = draw_scenario(seed, rover, depth)
    try:
        return _trial(scenario, run_scenario(scenario))
    except Exception as error:
        row = _row(scenario)
        return row._replace(ended="failed", broken=(f"the trial failed: {type(error).__name__}: {error}",))


def run_random(
    trials: int, rover: str | None, depth: Depth | None, seed: int, jobs: int | None, out: Path | None, *,
    as_json: bool = False,
) -> int:  # fmt: skip
    """Run ``trials`` scenarios and say what came of them; with ``out`` store rows, and the smallest that broke a rule.

    Returns 0, 1 where a rule was broken, or 130 where a signal asked to stop.

    Raises:
        BadInput: ``out`` is not new or empty, or there is no such rover.
        MissingPackage: some of the trials would need a package that is not installed.
        WayfarerError: a worker died.
    """
    draw_scenario(seed, rover, depth)  # what is wrong with the rover is told before the first trial
    refuse_missing_package(rover, depth)
    if out is not None:
        make_empty_folder(out, "what comes of the trials")
    rows: list[RandomTrial] = []
    with suppress(Stopped):
        rows.extend(run_batch(partial(run_seed, rover, depth), range(seed, seed + trials), jobs, "trials"))
    rows.sort()
    broken = [trial for trial in rows if trial.broken]
    if as_json:
        print_json({"trials": rows})
    console = Console(stderr=as_json)
    for line in _summary(rows, broken):
        say(console, line)
    for trial in broken[:SHOWN]:
        for line in _violation_lines(trial, draw_scenario(trial.seed, rover, depth), out):
            say(console, line)
    if out is not None:
        write_atomically(out / ROWS_FILE, "".join(json.dumps(trial._asdict()) + "\n" for trial in rows))
    return 1 if broken else 0 if len(rows) == trials else INTERRUPTED


def broken_rules(run_result: RunResult) -> tuple[str, ...]:
    """Return what a run broke: safety rules, or that an error ended it which no fault explains."""
    if run_result.error is None or run_result.error.partition(":")[0] in REFUSALS:
        return run_result.broken
    return (*run_result.broken, f"the run was ended by {run_result.error}")


def _trial(scenario: Scenario, run_result: RunResult) -> RandomTrial:
    ticks = run_result.recorder.ticks
    worst = max(ticks, key=lambda tick: tick.level, default=None)
    return _row(scenario)._replace(
        ended=run_result.end.reason if run_result.end is not None else (run_result.error or "").partition(":")[0],
        level=RESPONSE_LEVELS[worst.level if worst else Level.WELL],
        cause=worst.cause.value if worst and worst.cause else "",
        ticks=len(ticks),
        excused=run_result.excused,
        broken=broken_rules(run_result),
    )


def _row(scenario: Scenario) -> RandomTrial:
    """Return the row of a scenario that has not been run."""
    faults, kinds = tuple(map(str, scenario.faults)), tuple(fault.kind for fault in scenario.faults)
    return RandomTrial(
        scenario.seed, scenario.rover, scenario.depth.value, scenario.algorithm, scenario.for_s, faults, kinds
    )


def _summary(rows: Sequence[RandomTrial], broken: Sequence[RandomTrial]) -> Iterator[str]:
    hours = sum(row.for_s for row in rows) / 3600.0
    yield f"{len(rows)} trials, {sum(len(row.kinds) for row in rows)} faults, {hours:.1f} hours"
    yield f"rovers: {counted(Counter(f'{row.rover} at {row.depth} depth' for row in rows))}"
    yield f"faults: {counted(Counter(kind for row in rows for kind in row.kinds))}"
    yield f"ended: {counted(Counter(row.ended for row in rows))}"
    yield f"worst level: {counted(Counter(row.level for row in rows))}"
    yield f"worst cause: {counted(Counter(row.cause or 'none' for row in rows))}"
    yield f"wheels that neither a command nor a deadman could stop: in {sum(row.excused > 0 for row in rows)} trials"
    yield f"broken rules: in {len(broken)} trials"


def _violation_lines(trial: RandomTrial, scenario: Scenario, out: Path | None) -> Iterator[str]:
    """Say what a trial broke and how to run it again: as the smallest scenario that still does."""
    yield f"seed {trial.seed}, {trial.rover} at {trial.depth} depth: {trial.broken[0]}"
    least = shrink(scenario, lambda tried: bool(broken_rules(run_scenario(tried))))
    yield f"  with {'; '.join(map(str, least.faults))}"
    again = f"wayfarer faults --trials 1 --seed {trial.seed} --rover {trial.rover} --depth {trial.depth}"
    if out is not None:
        path = out / f"{least.name}.toml"
        within = Expectation(ResponseLevel(trial.level), least.for_s)
        write_atomically(path, as_toml(replace(least, expect=within)))
        again = f"wayfarer faults --scenario {path}"
    yield f"  again: {again}"
