"""Executors of trials: this process, a pool of processes, or any other executor.

Each worker receives the campaign once, as executors of the standard library do it: by an initializer. The workers of
a pool are spawned, so that they inherit neither threads nor locks. They are born with SIGINT blocked: Ctrl-C reaches
the whole process group, and only the parent is to answer it.
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
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, Protocol, TypeVar
from uuid import uuid4

from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.rows import TrialRow, rounded_row, row_of

if TYPE_CHECKING:
    from wayfarer.experiments.trial import TrialResult
    from wayfarer.experiments.trial_setup import TrialSpec
    from wayfarer.simhal.world.forest import Forest

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


class TrialError(NamedTuple):
    """What went wrong in a trial: in one line, and for the programmer."""

    text: str
    traceback: str


class Done(NamedTuple):
    """A finished trial."""

    row: TrialRow
    fault: TrialError | None = None


class Stopped(Exception):  # a request that was heard, not an error
    """The campaign was asked to stop before its last trial."""


def field_trial(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
    """Run the real trial; the simulator is imported only where trials run."""
    from wayfarer.experiments.trial import run_trial

    return run_trial(spec, log_dir)


def logged_trial(logs: Path, spec: TrialSpec, _log_dir: Path | None = None) -> TrialResult:
    """Run the real trial with its field log in a separate folder, such as ``logs/forest-pledge-00017``."""
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
        latest = self._latest  # another thread of this worker may set it meanwhile
        if latest is None or latest[0] != trial:
            latest = self._latest = trial, self._campaign.make_forest(trial)
        return latest[1]

    def _fault_row(self, task: Task) -> TrialRow:
        campaign = self._campaign
        forest, noise = campaign.forest_and_noise(task.trial)
        row = TrialRow(task.trial, task.algorithm, forest, noise, campaign.trial_seed(task.trial), "fault")
        if campaign.terrains is None:
            return row
        from wayfarer.simhal.random_streams import RandomStreams  # wants numpy, as what follows a campaign need not

        return rounded_row(**{**row._asdict(), **campaign.terrains.draw(RandomStreams(row.seed))._asdict()})


class MakeExecutor(Protocol):
    """Makes an executor whose workers call ``initializer(*initargs)`` before they run anything.

    ``functools.partial(ThreadPoolExecutor, 4)`` is one.
    """

    def __call__(self, *, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> Executor:
        """Return the executor; leaving it as a context ends it."""


class InProcess(Executor):
    """Runs what is submitted at once, in this process."""

    def __init__(self, *, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> None:
        initializer(*initargs)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return a future that is done."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class SpawnedProcesses(ProcessPoolExecutor):
    """A pool of that many processes; an error or a stop terminates them, whatever they run."""

    def __init__(self, jobs: int, *, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> None:
        self._others = set(multiprocessing.active_children())
        spawn = multiprocessing.get_context("spawn")
        super().__init__(jobs, mp_context=spawn, initializer=_begin_worker, initargs=(initializer, *initargs))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit; a pool starts its workers when work comes."""
        with _sigint_blocked():
            return super().submit(fn, *args, **kwargs)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if error is not None:
            for worker in set(multiprocessing.active_children()) - self._others:
                worker.terminate()
        return super().__exit__(kind, error, trace)


def stream(
    runner: Runner[TaskT, DoneT],
    tasks: Sequence[TaskT],
    jobs: int,
    stop: threading.Event,
    executor: MakeExecutor | None = None,
) -> Generator[DoneT]:
    """Run ``tasks`` and yield what is done, in the order of completion.

    Without an ``executor``, one job runs in this process and more of them in a pool of that many processes; with one,
    ``jobs`` is how many it runs at a time.

    Raises:
        Stopped: ``stop`` was set; what runs on a pool at that moment is given up.
        BrokenExecutor: a worker died.
    """
    make = executor or (partial(SpawnedProcesses, jobs) if jobs > 1 else InProcess)
    key = uuid4().hex
    try:
        with make(initializer=_install, initargs=(key, runner)) as pool:
            yield from _drive(lambda chunk: pool.submit(_run_installed, key, chunk), tasks, jobs, stop)
    finally:
        forget(key)


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
def _sigint_blocked() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_installed: dict[str, Runner[Any, Any]] = {}  # in a worker: what runs its chunks, by the key of the stream


def _install(key: str, runner: Runner[Any, Any]) -> None:
    _installed[key] = runner


def _run_installed(key: str, tasks: Sequence[Any]) -> Sequence[Any]:
    return _installed[key].run_chunk(tasks)


def forget(key: str) -> None:
    """Let go, in a worker that goes on living, of what a stream installed there."""
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
    text = " ".join(f"{type(cause).__name__}: {cause}".split())
    return TrialError(
        f"{text} ({Path(frame.filename).name}:{frame.lineno})", "".join(traceback.format_exception(error))
    )
