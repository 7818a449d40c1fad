"""Who runs the trials: this process, a pool of processes, or any executor.

A pool's workers are spawned, so that they inherit neither threads nor locks, and each receives the campaign
once. They are born with SIGINT blocked: Ctrl-C reaches the whole process group, and only the parent is to
answer it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, Protocol, TypeVar

from wayfarer.simhal.plan import Campaign, Task
from wayfarer.simhal.rows import Row, row_of

if TYPE_CHECKING:
    from wayfarer.simhal.forest import Forest
    from wayfarer.simhal.stage import TrialSpec
    from wayfarer.simhal.trial import TrialResult

P = ParamSpec("P")
T = TypeVar("T")
TaskT = TypeVar("TaskT")
DoneT = TypeVar("DoneT")
TaskT_contra = TypeVar("TaskT_contra", contravariant=True)
DoneT_co = TypeVar("DoneT_co", covariant=True)

LARGEST_CHUNK = 4  # handing over a chunk costs the parent 0.3 ms; what is in flight at Ctrl-C is lost
CHUNKS_AHEAD = 2  # a worker: one that it runs and one that waits for it
POLL_S = 0.1  # how soon a stop is noticed


class RunTrial(Protocol):
    """How a trial is run; the second argument is where its field log goes."""

    def __call__(self, spec: TrialSpec, log_dir: Path | None = None, /) -> TrialResult:
        """Run one trial."""


class Fault(NamedTuple):
    """What went wrong in a trial: in one line, and for the programmer."""

    text: str
    traceback: str


class Done(NamedTuple):
    """A finished trial."""

    row: Row
    fault: Fault | None = None


class Stopped(Exception):  # a request that was heard, not an error
    """The campaign was asked to stop before its last trial."""


def field_trial(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
    """Run the real trial; the simulator is imported only where trials run."""
    from wayfarer.simhal.trial import run_trial

    return run_trial(spec, log_dir)


def logged_trial(logs: Path, spec: TrialSpec, _log_dir: Path | None = None) -> TrialResult:
    """Run the real trial with its field log in a folder of its own, such as ``logs/forest-pledge-00017``."""
    return field_trial(spec, logs / f"{spec.algorithm.replace(':', '-')}-{spec.trial:05d}")


class Runner(Protocol[TaskT_contra, DoneT_co]):
    """Runs whatever tasks there are; what it needs can be sent to another process."""

    def run_chunk(self, tasks: Sequence[TaskT_contra], /) -> Sequence[DoneT_co]:
        """Run several tasks."""


class TrialRunner:
    """Runs the trials of a campaign one after the other; what it needs can be sent to another process."""

    def __init__(self, campaign: Campaign, run_trial: RunTrial = field_trial) -> None:
        self._campaign = campaign
        self._run_trial = run_trial
        self._latest: tuple[int, Forest] | None = None

    def run_chunk(self, tasks: Sequence[Task]) -> list[Done]:
        """Run several trials."""
        return [self.run(task) for task in tasks]

    def run(self, task: Task, log_dir: Path | None = None) -> Done:
        """Run one trial; whatever it raises becomes its row's ``fault`` and goes no further."""
        try:
            spec = self._campaign.spec(task, self._forest(task.trial))
            return Done(row_of(self._run_trial(spec, log_dir)))
        except Exception as error:
            return Done(self._fault_row(task), _fault(error))

    def _forest(self, trial: int) -> Forest:
        """Make a trial's forest, once for all the algorithms that follow each other in it."""
        if self._latest is None or self._latest[0] != trial:
            self._latest = trial, self._campaign.make_forest(trial)
        return self._latest[1]

    def _fault_row(self, task: Task) -> Row:
        forest, noise = self._campaign.forest_and_noise(task.trial)
        return Row(task.trial, task.algorithm, forest, noise, self._campaign.trial_seed(task.trial), "fault")


class InProcess(Executor):
    """Runs what is submitted at once, in this process."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return a future that is done."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def stream(
    runner: Runner[TaskT, DoneT],
    tasks: Sequence[TaskT],
    jobs: int,
    stop: threading.Event,
    executor: Executor | None = None,
) -> Generator[DoneT]:
    """Run ``tasks`` and yield what is done, in the order of completion.

    Without an ``executor``, one job runs in this process and more of them in a pool of that many processes.

    Raises:
        Stopped: ``stop`` was set; what runs on a pool at that moment is given up.
        BrokenExecutor: a worker died.
    """
    if executor is None and jobs > 1:
        with _process_pool(runner, jobs) as submit:
            yield from _drive(submit, tasks, jobs, stop)
    else:
        here = executor or InProcess()
        yield from _drive(lambda chunk: here.submit(runner.run_chunk, chunk), tasks, jobs, stop)


Submit = Callable[[Sequence[TaskT]], "Future[Sequence[DoneT]]"]


def _drive(submit: Submit[TaskT, DoneT], tasks: Sequence[TaskT], jobs: int, stop: threading.Event) -> Iterator[DoneT]:
    chunks = _chunks(tasks, jobs)
    running: set[Future[Sequence[DoneT]]] = set()
    while True:
        while not stop.is_set() and len(running) < CHUNKS_AHEAD * jobs and (chunk := next(chunks, None)):
            running.add(submit(chunk))
        if not running and not stop.is_set():
            return
        finished, running = wait(running, POLL_S, FIRST_COMPLETED)
        if stop.is_set():
            finished |= {future for future in running if future.done()}
        for future in finished:
            yield from future.result()
        if stop.is_set():
            raise Stopped


def _chunks(tasks: Sequence[TaskT], jobs: int) -> Iterator[Sequence[TaskT]]:
    """Cut ``tasks`` into chunks that get smaller towards the end, so that all workers finish together."""
    start = 0
    while start < len(tasks):
        size = min(LARGEST_CHUNK, max(1, (len(tasks) - start) // (8 * jobs)))
        yield tasks[start : start + size]
        start += size


@contextmanager
def _process_pool(runner: Runner[TaskT, DoneT], jobs: int) -> Iterator[Submit[TaskT, DoneT]]:
    others = set(multiprocessing.active_children())
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_install, initargs=(runner,))

    def submit(chunk: Sequence[TaskT]) -> Future[Sequence[DoneT]]:
        with _sigint_blocked():  # a pool starts its workers when work is submitted
            return pool.submit(_run_installed, chunk)

    try:
        yield submit
    except BaseException:
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    finally:
        pool.shutdown()


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_installed: list[Runner[Any, Any]] = []  # in a worker: its runner


def _install(runner: Runner[Any, Any]) -> None:
    _installed.append(runner)
    threading.Thread(target=_end_with_parent, name="end-with-parent", daemon=True).start()


def _run_installed(tasks: Sequence[Any]) -> Sequence[Any]:
    return _installed[0].run_chunk(tasks)


def _end_with_parent() -> None:
    """End this worker when its parent was killed: it would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _fault(error: Exception) -> Fault:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return Fault(f"{text} ({Path(frame.filename).name}:{frame.lineno})", "".join(traceback.format_exception(error)))
