"""Runs a function over tasks: in this process, in a pool of processes, or on any other executor.

Each worker receives the function once, as executors of the standard library do it: by an initializer. The workers of
a pool are spawned, so that they inherit neither threads nor locks. They start with SIGINT blocked: Ctrl-C reaches the
whole process group, and only the parent is to answer it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from functools import partial
from itertools import islice, takewhile
from pathlib import Path
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, Protocol, TypeVar
from uuid import uuid4

from wayfarer.errors import kind_and_text
from wayfarer.experiments.campaign import Plan, Task
from wayfarer.experiments.rows import TrialRow, rounded_row, row_of

if TYPE_CHECKING:
    from wayfarer.experiments.trial import TrialResult
    from wayfarer.experiments.trial_setup import TrialSpec
    from wayfarer.simhal.world.forest import Forest

P = ParamSpec("P")
T = TypeVar("T")
TaskT = TypeVar("TaskT")
DoneT = TypeVar("DoneT")

LARGEST_CHUNK = 4  # handing over a chunk costs the parent 0.3 ms; what is in flight at Ctrl-C is lost
LAST_SINGLY = 16  # times the jobs; a trial of one algorithm can take ten times as long as one of another
CHUNKS_AHEAD = 2  # a worker: one that it runs and one that waits for it
POLL_S = 0.1  # how soon a stop is noticed

RunTrial = Callable[["TrialSpec"], "TrialResult"]


class TrialError(NamedTuple):
    """What went wrong in a trial: in one line, and for the programmer."""

    text: str
    traceback: str


class Done(NamedTuple):
    """A finished trial, and how many control ticks it took, as far as that is known."""

    row: TrialRow
    fault: TrialError | None = None
    ticks: int = 0


class Stopped(Exception):  # a request that was heard, not an error
    """The campaign was asked to stop before its last trial."""


def field_trial(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
    """Run the real trial, its field log in ``log_dir``; the simulator is imported only where trials run."""
    from wayfarer.experiments.trial import run_trial

    return run_trial(spec, log_dir)


def logged_trial(logs: Path, spec: TrialSpec) -> TrialResult:
    """Run the real trial with its field log in a separate folder, such as ``logs/forest-pledge-00017``."""
    return field_trial(spec, logs / f"{spec.algorithm.replace(':', '-')}-{spec.trial:05d}")


class TrialRunner:
    """Runs trials of a campaign or sweep; what it needs can be sent to another process."""

    def __init__(self, plan: Plan, run_trial: RunTrial = field_trial) -> None:
        self._points = plan.points
        self._run_trial = run_trial
        self._latest: tuple[list[int], Forest] | None = None

    def run(self, task: Task) -> Done:
        """Run one trial; whatever it raises becomes its row's ``fault`` and goes no further."""
        try:
            spec = self._points[task.point].spec(task, self._forest(task))
            result = self._run_trial(spec)
            return Done(row_of(result)._replace(point=task.point), ticks=result.ticks)
        except Exception as error:
            return Done(self._fault_row(task), _fault(error))

    def _forest(self, task: Task) -> Forest:
        """Make a trial's forest, once for all the algorithms that follow each other in it."""
        _, *wanted = task
        latest = self._latest  # another thread of this worker may set it meanwhile
        if latest is None or latest[0] != wanted:
            latest = self._latest = wanted, self._points[task.point].make_forest(task.trial)
        return latest[1]

    def _fault_row(self, task: Task) -> TrialRow:
        name, trial, point = task
        campaign = self._points[point]
        forest, noise = campaign.forest_and_noise(trial)
        row = TrialRow(trial, name, forest, noise, campaign.trial_seed(trial), "fault", point=point)
        drawn = [each for each in (campaign.terrains, campaign.slopes) if each]
        if not drawn:
            return row
        from wayfarer.simhal.random_streams import RandomStreams  # wants numpy, as what follows a campaign need not

        values = row._asdict()
        for each in drawn:
            values |= each.draw(RandomStreams(row.seed))._asdict()
        return rounded_row(**values)


class MakeExecutor(Protocol):
    """Makes an executor whose workers call ``initializer(*initargs)`` before they run anything.

    ``functools.partial(ThreadPoolExecutor, 4)`` is one.
    """

    def __call__(self, *, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> Executor:
        """Return the executor; leaving it as a context ends it."""


class SpawnedProcesses(ProcessPoolExecutor):
    """A pool of that many processes; an error or a stop terminates them, even while they run."""

    def __init__(self, jobs: int, *, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> None:
        self._others = set(multiprocessing.active_children())
        spawn = multiprocessing.get_context("spawn")
        super().__init__(jobs, mp_context=spawn, initializer=_begin_worker, initargs=(initializer, *initargs))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit; a pool starts its workers when work comes."""
        with _sigint_blocked(), _main_hidden():
            return super().submit(fn, *args, **kwargs)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if error is not None:
            for worker in set(multiprocessing.active_children()) - self._others:
                worker.terminate()
        return super().__exit__(kind, error, trace)


def stream(
    run: Callable[[TaskT], DoneT],
    tasks: Sequence[TaskT],
    jobs: int,
    stop: threading.Event,
    executor: MakeExecutor | None = None,
) -> Generator[DoneT]:
    """Run ``tasks``, each by ``run``, and yield what is done, in the order of completion.

    Without an ``executor``, one job runs in this process and more of them in a pool of that many processes; with one,
    ``jobs`` is how many it runs at a time. There are never more jobs than tasks. What ``run`` needs is sent to each
    worker once.

    Raises:
        Stopped: ``stop`` was set; what runs on a pool at that moment is given up.
        BrokenExecutor: a worker died.
    """
    jobs = max(1, min(jobs, len(tasks)))
    if executor is None and jobs == 1:
        yield from map(run, takewhile(lambda _: not stop.is_set(), tasks))
        if stop.is_set():
            raise Stopped
        return
    key = uuid4().hex
    make = executor or partial(SpawnedProcesses, jobs)
    try:
        with make(initializer=_install, initargs=(key, run)) as pool:
            yield from _run_on(pool, key, in_chunks(tasks, jobs), jobs, stop)
    finally:
        forget(key)


def _run_on(pool: Executor, key: str, chunks: Iterator[list[Any]], jobs: int, stop: threading.Event) -> Iterator[Any]:
    running: set[Future[list[Any]]] = set()
    while True:
        while not stop.is_set() and len(running) < CHUNKS_AHEAD * jobs and (chunk := next(chunks, None)):
            running.add(pool.submit(_run_installed, key, chunk))
        if not running and not stop.is_set():
            return
        finished, running = wait(running, POLL_S, FIRST_COMPLETED)
        if stop.is_set():
            finished |= {future for future in running if future.done()}
        for future in finished:
            yield from future.result()
        if stop.is_set():
            raise Stopped


def in_chunks(tasks: Sequence[TaskT], jobs: int) -> Iterator[list[TaskT]]:
    """Cut ``tasks`` into chunks; the last ones come singly, so that all workers finish at about the same time."""
    rest = iter(tasks)
    for _ in range((len(tasks) - LAST_SINGLY * jobs) // LARGEST_CHUNK):
        yield list(islice(rest, LARGEST_CHUNK))
    yield from ([task] for task in rest)


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _main_hidden() -> Iterator[None]:
    """Keep new workers from importing the script that began this process, of which they need nothing.

    A script that does not ask whether it is ``__main__`` would begin its campaign again in each of them.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


_installed: dict[str, Callable[[Any], Any]] = {}  # in a worker: what runs its tasks, by the key of the stream


def _install(key: str, run: Callable[[Any], Any]) -> None:
    _installed[key] = run


def _run_installed(key: str, tasks: list[Any]) -> list[Any]:
    return [_installed[key](task) for task in tasks]


def forget(key: str) -> None:
    """Remove a stream's function from a worker that stays alive."""
    _installed.pop(key, None)


def _begin_worker(initializer: Callable[..., object], *initargs: Any) -> None:
    threading.Thread(target=_end_with_parent, name="end-with-parent", daemon=True).start()
    initializer(*initargs)


def _end_with_parent() -> None:
    """End this worker when its parent was killed: it would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _fault(error: Exception) -> TrialError:
    from wayfarer.control.supervisor import first_cause  # the simulator is imported only where trials run

    cause = first_cause(error)
    frame = traceback.extract_tb(cause.__traceback__)[-1]
    text = f"{kind_and_text(cause)} ({Path(frame.filename).name}:{frame.lineno})"
    return TrialError(text, "".join(traceback.format_exception(error)))
