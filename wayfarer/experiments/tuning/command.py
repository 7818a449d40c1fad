"""Implementation of ``wayfarer tune`` after its options are parsed: search, confirm, write, show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from rich.console import Console

from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import WayfarerError
from wayfarer.experiments.campaign import Tasks
from wayfarer.experiments.commands import INTERRUPTED, cores
from wayfarer.experiments.executors import Done, MakeExecutor, RunTrial, Stopped, field_trial
from wayfarer.experiments.progress_bar import say, shown_count
from wayfarer.experiments.provenance import read_runs
from wayfarer.experiments.report.tune import write_tune_report
from wayfarer.experiments.results_folder import SUMMARY, ResultsFolder
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.run_campaign import run_tasks, stop_on_signals
from wayfarer.experiments.sim_command import connected
from wayfarer.experiments.tuning.confirm import confirmed
from wayfarer.experiments.tuning.evidence import best_so_far, evidence, print_summary
from wayfarer.experiments.tuning.forests import DEVELOPMENT, content_of
from wayfarer.experiments.tuning.overlay import overlaid
from wayfarer.experiments.tuning.plan import SearchPlan
from wayfarer.experiments.tuning.search import STUDY, Search
from wayfarer.experiments.tuning.summary import PairedResult, TuneSummary, summarised
from wayfarer.files import write_atomically
from wayfarer.views.text.scripting import print_json, say_next

TUNED = "tuned.toml"
JOURNAL = "study.journal"  # the same study for Optuna's own tools


@dataclass(frozen=True)
class HeldOutTrials:
    """How many held-out trials each of the two settings gets in each physics."""

    light: int
    mujoco: int


@dataclass(frozen=True)
class _Running:
    """What trials run on."""

    jobs: int
    executor: MakeExecutor | None
    run_trial: RunTrial


def run_all(
    plan: SearchPlan,
    rover: str,
    held_out: HeldOutTrials,
    out: Path,
    *,
    resume: bool = False,
    jobs: int | None = None,
    cluster: str | None = None,
    as_json: bool = False,
    command: Sequence[str] | None = None,
    run_trial: RunTrial = field_trial,
) -> int:
    """Search, confirm the best point, write what was found into ``out``, show it, and return the exit code.

    ``rover`` is the rover's file or name, of which the tuned file is made; the rest is as of ``sim_command.run_all``.

    Raises:
        BadInput: ``out`` cannot be used, there is no such cluster, or the rover's file cannot be changed.
        WayfarerError: a worker died, the cluster was lost, or ``out`` cannot be written any more; finished trials are
            kept.
    """
    overlaid(rover, {each.key: (each.now, each.now) for each in plan.space})  # refused before hours of trials
    aside = Console(stderr=True)
    with (
        connected(cluster) as workers,
        ResultsFolder(out, plan.settings(), resume=resume, command=command) as folder,
    ):
        here = _Running(jobs or cores(), None, run_trial)
        on = _Running(workers.jobs, workers.executor, run_trial) if workers else here
        try:
            search = _searched(plan, folder, on, aside)
            found = _confirmed(search, held_out, out, on)
        except Stopped:
            say(aside, f"interrupted: {len(folder.kept)} trials of the search are in {out}; continue with --resume")
            return INTERRUPTED
        summary = summarised(
            search,
            [each for each in found if isinstance(each, PairedResult)],
            [each for each in found if isinstance(each, str)],
        )
        _write(summary, search, rover, out)
    if as_json:
        print_json(summary.model_dump(mode="json"))
        return 0
    print_summary(Console(), summary)
    say(aside, f"the results are in {out}")
    say_next("xdg-open", out / "report.html")
    return 0


def _searched(plan: SearchPlan, folder: ResultsFolder, on: _Running, aside: Console) -> Search:
    """Carry out the search.

    Raises:
        Stopped: a signal ended it.
    """
    if content := content_of(plan.base):
        write_atomically(folder.path / DEVELOPMENT, content)
    if kept := len(folder.kept):
        say(aside, f"{kept} trials of the search are in {folder.path} already")
    with stop_on_signals() as stop:

        def told(search: Search) -> None:
            say(aside, best_so_far(search))
            if stop.is_set():
                raise Stopped

        search = Search(plan, list(folder.kept), _SearchTrials(plan, folder, on, aside, stop))
        search.run(told)
    return search


@dataclass
class _SearchTrials:
    """Runs trials of a search until ``stop`` is set, keeps them in its folder, and shows progress and the first fault.

    Further faults are counted in the line with the best so far.
    """

    plan: SearchPlan
    folder: ResultsFolder
    on: _Running
    aside: Console
    stop: Event
    fault_shown: bool = False

    def __call__(self, todo: Tasks, take: Callable[[TrialRow], None]) -> None:
        def keep(row: TrialRow) -> None:
            self.folder.append(row)
            take(row)

        on, on_terminal = self.on, self.aside.is_terminal
        bar = shown_count(self.aside, 0, len(todo), "trials") if on_terminal else nullcontext(lambda: None)
        with bar as advance:

            def progress(done: Done) -> None:
                advance()
                self._show_fault(done)

            run_tasks(
                self.plan, todo, keep, self.folder.kept, self.stop, jobs=on.jobs, progress=progress,
                executor=on.executor, run_trial=on.run_trial,
            )  # fmt: skip

    def _show_fault(self, done: Done) -> None:
        if done.fault and not self.fault_shown:
            self.fault_shown = True
            say(self.aside, f"point {done.row.point}, trial {done.row.trial} ended in a fault: {done.fault.text}")


def _confirmed(search: Search, held_out: HeldOutTrials, out: Path, on: _Running) -> list[PairedResult | str]:
    """Compare the best point with the present settings on held-out forests, where there is a best one."""
    if search.best is search.present:
        return []
    tuned: RoverConfig = search.plan.points[search.best.number].rover
    found = confirmed(
        search.plan, tuned, out, held_out.light, held_out.mujoco, jobs=on.jobs, executor=on.executor,
        run_trial=on.run_trial,
    )  # fmt: skip
    return list(found)


def _write(summary: TuneSummary, search: Search, rover: str, out: Path) -> None:
    """Write the files that a search ends with.

    Raises:
        WayfarerError: the folder cannot be written.
    """
    try:
        write_atomically(out / SUMMARY, summary.model_dump_json(indent=2) + "\n")
        if summary.changed:
            asked = read_runs(out)[0].command
            write_atomically(out / TUNED, overlaid(rover, summary.changed, evidence(summary, asked)))
        _write_journal(search, out / JOURNAL)
        write_tune_report(out)
    except OSError as error:
        raise WayfarerError(f"{out} cannot be written any more: {error.strerror or error}; use --resume") from error


def _write_journal(search: Search, path: Path) -> None:
    """Write the study as Optuna's tools read it."""
    draft = path.with_name(f".{path.name}.new")
    draft.unlink(missing_ok=True)
    storage = JournalStorage(JournalFileBackend(str(draft)))
    optuna.copy_study(from_study_name=STUDY, from_storage=search.storage, to_storage=storage, to_study_name=STUDY)
    draft.replace(path)
