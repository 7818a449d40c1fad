"""Memory of a campaign, however many trials it has: whole campaigns whose trials cost nothing but their forest."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments import run_campaign
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.results_folder import ResultsFolder
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec

PROGRAM = "import sys; from benchmarks.memory import main; main(*sys.argv[1:])"  # workers import no ``__main__``
FEW = 1_000
JOBS = 2
HEADER = ("trials", "s", "memory of the campaign's process, MB", "bytes a trial more")


class Taken(NamedTuple):
    """What a campaign took: seconds, and the most memory its own process had, bytes."""

    wall_s: float
    memory_bytes: int


def quick(spec: TrialSpec, _log_dir: Path | None = None, /) -> TrialResult:
    """Make up a result; it needs no simulation, and no two are the same."""
    path_m = 40.0 + spec.seed % 100_000 / 7
    return TrialResult(
        spec.trial, spec.algorithm, spec.forest.forest, spec.forest.noise, spec.seed, "escaped",
        path_m=path_m, reverse_m=path_m / 20, time_s=path_m * 1.2, anomalies=spec.seed % 50, episodes=spec.seed % 9,
        shortest_path_m=37.5, spl=37.5 / path_m, ticks=100,
    )  # fmt: skip


def run(trials: int, out: Path) -> Taken:
    """Run a campaign in this process and its workers."""
    plan = Campaign(("forest-pledge",), trials, load_rover("sim"))
    with ResultsFolder(out, plan.settings()) as folder:
        finished = run_campaign.run(plan, folder, jobs=JOBS, run_trial=quick)
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    most_kb = next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM"))
    return Taken(finished.effort.wall_s, int(most_kb) * 1024)


def rows(trials: int) -> list[tuple[str, ...]]:
    """Run a campaign of ``FEW`` trials and one of ``trials``, each in a fresh process; return the table's lines."""
    few, many = _fresh(FEW), _fresh(trials)
    more = (many.memory_bytes - few.memory_bytes) / (trials - FEW) if trials != FEW else 0.0
    return [_row(FEW, few, ""), _row(trials, many, f"{more:.0f}")]


def _row(trials: int, taken: Taken, more: str) -> tuple[str, ...]:
    return str(trials), f"{taken.wall_s:.1f}", f"{taken.memory_bytes / 1e6:.1f}", more


def _fresh(trials: int) -> Taken:
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-c", PROGRAM, str(trials), str(Path(folder) / "out")]
        said = subprocess.run(command, check=True, stdout=subprocess.PIPE)
    return Taken(*json.loads(said.stdout))


def main(trials: str, out: str) -> None:
    """Print what a campaign took, as JSON."""
    print(json.dumps(run(int(trials), Path(out))))
