"""Trials that need no simulator; at module level, so that spawned workers can import them.

``MAIN`` is a program: a campaign of slow trials, for tests with real processes and signals: ``FOLDER JOBS``, or
``FOLDER ADDRESS`` for a cluster; what ``wayfarer sim`` would say and return, it says and returns.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path
from threading import Event
from typing import cast

from tests.children import child
from wayfarer.cli import run_trials
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import WayfarerError
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.outcome import OUTCOMES, Outcome
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec

MAIN = "import sys; from tests.experiments.fake_trials import main; sys.exit(main(*sys.argv[1:]))"
SLOW_S = 0.05
MANY = 100


def campaign_of(trials: int, *algorithms: str) -> Campaign:
    return Campaign(algorithms or ("forest-pledge",), trials, load_rover("sim"))


def quick(spec: TrialSpec, log_dir: Path | None = None, /) -> TrialResult:
    """All that a result says follows from the seed and the algorithm."""
    path_m = 40.0 + spec.seed % 100_000 / 7 + len(spec.algorithm)
    outcome = cast(Outcome, OUTCOMES[spec.seed % 4])
    return TrialResult(
        spec.trial, spec.algorithm, spec.forest.forest, spec.forest.noise, spec.seed, outcome,
        path_m=path_m, reverse_m=path_m / 20, time_s=path_m * 1.2, anomalies=spec.seed % 50, episodes=spec.seed % 9,
        shortest_path_m=37.5, spl=37.5 / path_m, ticks=100, drawn=spec.drawn,
    )  # fmt: skip


def slow(spec: TrialSpec) -> TrialResult:
    Event().wait(SLOW_S)
    return quick(spec)


def early_ones_last(spec: TrialSpec) -> TrialResult:
    Event().wait(0.02 if spec.trial % 8 == 0 else 0)
    return quick(spec)


class TwoArguments(Exception):  # it can be sent to another process, and not be unpacked there
    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} {two}")


def third_fails(spec: TrialSpec, log_dir: Path | None = None, /) -> TrialResult:
    if spec.trial == 3:
        raise KeyError("no such\nphase")
    return quick(spec)


def third_fails_oddly(spec: TrialSpec) -> TrialResult:
    if spec.trial == 3:
        raise ExceptionGroup("of a task", [TwoArguments("out of", "phase")])
    return quick(spec)


def third_exits(spec: TrialSpec) -> TrialResult:
    if spec.trial == 3:
        sys.exit("enough")
    return quick(spec)


def third_kills_its_worker(spec: TrialSpec) -> TrialResult:
    if spec.trial == 3:
        os._exit(9)
    return quick(spec)


def third_is_killed(spec: TrialSpec) -> TrialResult:
    if spec.trial == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(spec)


def started(out: Path, where: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """Start a campaign of slow trials in a process group; ``where`` says how many jobs, or on which cluster."""
    command = [sys.executable, "-c", MAIN, str(out), where]
    return child(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def main(out: str, jobs: str) -> int:
    count, address = (int(jobs), None) if jobs.isdigit() else (None, jobs)
    resume = Path(out).exists()
    try:
        return run_trials.run_all(
            campaign_of(MANY), Path(out), resume=resume, jobs=count, cluster=address, run_trial=slow
        )
    except WayfarerError as error:
        print(f"wayfarer: {error}", file=sys.stderr)
        return error.exit_code
