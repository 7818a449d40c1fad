"""Runs a function over tasks: in this process, in others of this computer, or on any ``concurrent.futures.Executor``.

The processes are plain children that read tasks from a pipe and write results to another one. So they import nothing of
the script that began this one, need neither semaphores nor shared memory, and a worker that dies takes only its own
trial with it. ``ProcessPoolExecutor`` imports the script again in each worker, and fails as a whole.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from fcntl import F_DUPFD_CLOEXEC, fcntl
from functools import lru_cache
from itertools import islice
from math import ceil, inf
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NoReturn, ParamSpec, TypeVar

from wayfarer.errors import BadInput, WayfarerError, kind_and_text, one_line

P = ParamSpec("P")
T = TypeVar("T")
TaskT = TypeVar("TaskT")
DoneT = TypeVar("DoneT")

CHUNKS_AHEAD = 2  # per worker: one that it runs and one that waits for it
LARGEST_CHUNK = 4  # tasks in a chunk for an executor of other machines: sending one may take some ms
LAST_SINGLY = 16  # tasks per worker; one of them may take ten times as long as another
POLL_S = 0.1  # how soon a stop is noticed
ROOT = Path("/")


class TaskFailed(Exception):
    """A task that could not be run: one of ``tasks``, the ``error`` that ended it, and in which line that was."""

    def __init__(self, tasks: Sequence[Any], error: BaseException, line: str = "") -> None:
        super().__init__(tasks, error, line)
        self.tasks, self.error, self.line = tasks, error, line

    @property
    def why(self) -> str:
        """What happened, in one line; if it was not raised on purpose, with its kind and where that was."""
        if isinstance(self.error, WayfarerError | BrokenExecutor):
            return str(self.error)
        return kind_and_text(self.error) + (f" ({self.line})" if self.line else "")


class WorkerDied(BrokenExecutor):
    """A worker process ended while it ran a task."""


def cores(root: Path = ROOT) -> int:
    """Return how many processes can compute at a time: the cores that this process may use, or its cgroup's quota."""
    return max(1, ceil(min(len(os.sched_getaffinity(0)), *_quotas(root))))


def _quotas(root: Path) -> Iterator[float]:
    """Yield how many cores each group allows that this process is in: a container's, or one of systemd."""
    yield inf
    with suppress(OSError, ValueError):
        for line in (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers and "cpu" not in controllers.split(","):
                continue
            top = root / "sys/fs/cgroup" / ("cpu" if controllers else "")  # version 1 has names, version 2 none
            files = ("cpu.cfs_quota_us", "cpu.cfs_period_us") if controllers else ("cpu.max",)
            group = top / path.lstrip("/")
            for folder in (group, *group.parents[: len(group.parts) - len(top.parts)]):
                with suppress(OSError, ValueError):  # in a container only the top is there; "max" is not a limit
                    quota, period = " ".join((folder / name).read_text(encoding="ascii") for name in files).split()
                    if float(quota) > 0:
                        yield float(quota) / float(period)


def run_tasks(
    run: Callable[[TaskT], DoneT],
    tasks: Sequence[TaskT],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    stop: threading.Event,
    notice: Callable[[str], object] = warnings.warn,
) -> Generator[DoneT]:
    """Run ``tasks``, each by ``run``, and yield what is done, in the order of completion.

    Without an ``executor``, one job runs in this process and more of them in as many processes. With one, ``jobs`` is
    how many tasks it runs at a time; it is not shut down. After ``stop`` and after an error no further task begins;
    those that run come to their end and are yielded. ``notice`` gets a sentence if the system starts fewer
    processes, or none, so that the tasks run in this one.

    Raises:
        TaskFailed: a task raised an error, or ended its worker.
        BadInput: what ``run`` needs cannot be sent to another process.
    """
    jobs = max(1, min(jobs, len(tasks)))
    if executor is None and jobs == 1:
        yield from _run_here(run, tasks, stop)
        return
    payload = _pickled(run)
    if executor is not None:
        yield from _run_on(executor, payload, in_chunks(tasks, jobs, LARGEST_CHUNK), jobs, stop)
        return
    with Processes(jobs) as processes:
        have = len(processes.workers)
        if have < jobs:
            where = f"in {have} processes" if have else "in this process"
            notice(f"the system starts no more processes ({processes.refusal}): the trials run {where}")
        if have:
            yield from _run_on(processes, payload, in_chunks(tasks, have, 1), have, stop)
    if not have:
        yield from _run_here(run, tasks, stop)


def _run_here(run: Callable[[TaskT], DoneT], tasks: Sequence[TaskT], stop: threading.Event) -> Iterator[DoneT]:
    for task in tasks:
        if stop.is_set():
            return
        try:
            done = run(task)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an algorithm of a third party may raise anything
            raise task_failed(task, error) from error
        yield done


def _run_on(
    executor: Executor, payload: bytes, chunks: Iterator[list[Any]], jobs: int, stop: threading.Event
) -> Iterator[Any]:
    running: dict[Future[tuple[list[Any], TaskFailed | None]], list[Any]] = {}  # in the order of submission
    failed: TaskFailed | None = None
    try:
        while True:
            while not (stop.is_set() or failed) and len(running) < CHUNKS_AHEAD * jobs and (chunk := next(chunks, [])):
                try:
                    running[executor.submit(run_chunk, payload, chunk)] = chunk
                except Exception as refused:
                    failed = TaskFailed(chunk, refused)
            if stop.is_set() or failed:
                for future in list(running)[jobs:]:  # the oldest run: not every executor knows what it has begun
                    if future.cancel():
                        del running[future]
            if not running:
                break
            wait(running, POLL_S, FIRST_COMPLETED)
            for future in [each for each in running if each.done()]:  # wait itself overlooks one that was cancelled
                chunk = running.pop(future)
                try:
                    done, error = future.result()
                except Exception as broken:
                    done, error = [], TaskFailed(chunk, broken)
                yield from done
                failed = failed or error
    finally:
        for future in running:
            future.cancel()
    if failed:
        raise failed from failed.error


def in_chunks(tasks: Sequence[TaskT], jobs: int, largest: int) -> Iterator[list[TaskT]]:
    """Cut ``tasks`` into chunks; the last ones come singly, so that all workers finish at about the same time."""
    rest = iter(tasks)
    for _ in range((len(tasks) - LAST_SINGLY * jobs) // largest):
        yield list(islice(rest, largest))
    yield from ([task] for task in rest)


# -- what is sent to a worker ------------------------------------------------------------------------------------------


def _pickled(run: Callable[..., object]) -> bytes:
    """Return what a worker needs, in bytes: each worker unpacks it once, however many chunks it gets."""
    try:
        payload = pickle.dumps(run, pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise BadInput(f"a trial cannot be sent to another process: {one_line(error)}; use jobs=1") from error
    if b"__main__" in payload:  # a class of the script, or a name such as "__main__:mine"
        raise BadInput(
            "other processes do not have what this script defines: put it in a separate file and name it, as "
            "my_rules:spiral, or use jobs=1"
        )
    return payload


@lru_cache(maxsize=2)  # a worker of a cluster may serve two campaigns in turns
def _unpickled(payload: bytes) -> Callable[[Any], Any]:
    run: Callable[[Any], Any] = pickle.loads(payload)
    return run


def run_chunk(payload: bytes, tasks: Sequence[Any]) -> tuple[list[Any], TaskFailed | None]:
    """Run tasks in a worker up to the first one that cannot be run; return what is done, and what stopped it."""
    done: list[Any] = []
    for task in tasks:
        try:
            done.append(_unpickled(payload)(task))
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            failed = task_failed(task, error)
            return done, TaskFailed(failed.tasks, _sendable(failed.error), failed.line)
    return done, None


def task_failed(task: object, error: BaseException) -> TaskFailed:
    """Say where a task failed: the last line of the user's own file, if there is one, else the last of all."""
    frames = list(traceback.walk_tb(error.__traceback__))
    while isinstance(error, BaseExceptionGroup):  # of the tasks of a trial
        error = error.exceptions[0]
        frames += traceback.walk_tb(error.__traceback__)
    lines = [
        (frame.f_globals.get("__name__", "").partition(".")[0], Path(frame.f_code.co_filename), number)
        for frame, number in frames
    ]
    foreign = [line for line in lines if line[0] not in {"wayfarer", *sys.stdlib_module_names}]
    own = [line for line in foreign if {"site-packages", "dist-packages"}.isdisjoint(line[1].parts)]
    _, path, number = (own or foreign or lines)[-1]
    return TaskFailed([task], error, f"{path.name}:{number}")


def _sendable(error: BaseException) -> BaseException:
    """Return an error that another process can unpack, with its traceback as a note."""
    text = "".join(traceback.format_exception(error))
    try:
        error = pickle.loads(pickle.dumps(error))
    except Exception:  # an error of a third party may raise anything here
        error = RuntimeError(kind_and_text(error))
    error.add_note(text)
    return error


# -- processes of this computer ----------------------------------------------------------------------------------------


class Processes(Executor):
    """Up to ``jobs`` worker processes, each fed by its own thread; fewer, or none, if the system gives no more.

    ``run_chunk`` is all that they run.
    """

    def __init__(self, jobs: int) -> None:
        self.workers: list[_Worker] = []
        self.refusal: object = None
        try:
            while len(self.workers) < jobs:
                self.workers.append(_Worker())
        except OSError as error:
            self.refusal = error.strerror or error
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        for worker in self.workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(max(1, len(self.workers)), "feeds-a-worker")

    def submit(self, _fn: Callable[P, T], /, *args: P.args, **_: P.kwargs) -> Future[T]:
        """Return the future of ``run_chunk`` with these arguments."""
        feed: Any = self._run
        future: Future[T] = self._threads.submit(feed, *args)
        return future

    def _run(self, payload: bytes, tasks: Sequence[Any]) -> Any:
        worker = self._idle.get()
        try:
            return worker.run(payload, tasks)
        finally:
            self._idle.put(worker)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers at once, also in the middle of a trial."""
        for worker in self.workers:
            worker.kill()
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for worker in self.workers:
            worker.close()


class _Worker:
    """A process that runs chunks of tasks, one at a time."""

    def __init__(self) -> None:
        tasks, self._tasks = _pipe()
        self._results, results = _pipe()
        code = (
            f"import sys; sys.path[:] = {sys.path!r}\n"
            f"from wayfarer.experiments.pool import work; work({tasks}, {results})"
        )
        try:  # its own process group: Ctrl-C reaches the whole group of this process, and only this one is to answer it
            self._process = subprocess.Popen(
                [sys.executable, "-c", code], stdin=subprocess.DEVNULL, pass_fds=(tasks, results), process_group=0
            )
        except OSError:
            os.close(self._tasks)
            os.close(self._results)
            raise
        finally:
            os.close(tasks)
            os.close(results)
        self._to, self._from = os.fdopen(self._tasks, "wb"), os.fdopen(self._results, "rb")
        self._has: bytes | None = None

    def run(self, payload: bytes, tasks: Sequence[Any]) -> Any:
        """Return what ``run_chunk`` returns there.

        Raises:
            WorkerDied: the process ended; the text says how.
        """
        try:
            pickle.dump((None if payload is self._has else payload, tasks), self._to, pickle.HIGHEST_PROTOCOL)
            self._to.flush()
            self._has = payload
            return pickle.load(self._from)
        except (OSError, ValueError, EOFError, pickle.UnpicklingError) as error:
            raise WorkerDied(_ended(self._process.wait())) from error

    def kill(self) -> None:
        """End the process, if it is still there."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Close the pipes to a process that has ended."""
        self._from.close()
        with suppress(OSError):  # what could not be written to it any more
            self._to.close()


def _pipe() -> tuple[int, int]:
    """Return the ends of a new pipe, none of them where a standard stream was closed: a worker has its own there."""
    low = os.pipe()
    try:
        read, write = (fcntl(end, F_DUPFD_CLOEXEC, 3) for end in low)
    finally:
        for end in low:
            os.close(end)
    return read, write


def _ended(code: int) -> str:
    if code == -signal.SIGKILL:
        return "its process was killed, most likely for lack of memory (then use fewer jobs)"
    if code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended itself with exit code {code}, as by os._exit"


def work(tasks: int, results: int) -> NoReturn:
    """Run in a worker what comes through one pipe, and write what it gives into another, until the first is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that began it says when to stop, and closes the pipe
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed, and what a trial imports may write to it
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123
    chunks: SimpleQueue[tuple[bytes, Sequence[Any]]] = SimpleQueue()

    def read() -> None:
        payload = b""
        with suppress(EOFError, OSError, pickle.UnpicklingError), os.fdopen(tasks, "rb") as file:
            while True:
                new, chunk = pickle.load(file)
                payload = payload if new is None else new
                chunks.put((payload, chunk))
        os._exit(1)  # at once, also in the middle of a trial: nobody waits for it

    threading.Thread(target=read, name="reads-tasks", daemon=True).start()
    with os.fdopen(results, "wb") as file:
        while True:
            pickle.dump(run_chunk(*chunks.get()), file, pickle.HIGHEST_PROTOCOL)
            file.flush()
