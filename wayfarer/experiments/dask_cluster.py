"""Executor on a Dask cluster: one campaign on many machines.

All workers must run the same wayfarer, so each worker is asked first, and again with each chunk, for workers
come and go. The campaign is sent once a worker, as a plugin that the scheduler also gives to those that come later.
Trials are pure: what a lost worker had not finished, the scheduler gives to another one.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from functools import cache, partial
from hashlib import blake2b
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, NoReturn, ParamSpec, TypeVar

import wayfarer
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.executors import MakeExecutor, forget

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from distributed import Client, KilledWorker, Worker, WorkerPlugin, get_worker, rpc
    from distributed.comm.addressing import get_address_host_port, normalize_address

P = ParamSpec("P")
T = TypeVar("T")

ANSWER_S = 3.0  # for the scheduler
WORKERS_S = 5.0  # for the first worker to come
SOURCES = {".py", ".toml"}  # what decides a trial: code and rover files
NOISY = {"asyncio", "distributed", "tornado"}  # loggers


@cache
def version() -> str:
    """Say what this process runs: wayfarer's release, a checksum of its source, and Python's version.

    Which commit was installed does not count, nor ``version.py``, which differs with it: the checksum tells more.
    """
    package = Path(wayfarer.__file__).parent
    source = blake2b(digest_size=6)
    stated = package / "version.py"
    for path in sorted(path for path in package.rglob("*") if path.suffix in SOURCES and path != stated):
        source.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    python = "{}.{}".format(*sys.version_info)
    release, _, _ = wayfarer.__version__.partition("+")
    return f"wayfarer {release} (source {source.hexdigest()}, Python {python})"


class Cluster(NamedTuple):
    """The workers of a scheduler: what makes an executor over them, and how many trials they run at a time."""

    executor: MakeExecutor
    jobs: int


class WorkerSetup(WorkerPlugin):
    """What each worker does before anything else, whenever it comes."""

    def __init__(self, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> None:
        self.name = f"wayfarer-{initargs[0]}"
        self._initializer = initializer
        self._initargs = initargs

    def setup(self, worker: Worker) -> None:  # noqa: ARG002
        """Prepare the worker."""
        self._initializer(*self._initargs)

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002
        """Leave nothing behind."""
        forget(self._initargs[0])


class ClusterExecutor(Executor):
    """Runs what is submitted on workers that have been prepared; leaving it frees them.

    What a lost worker had is run by another one.
    """

    def __init__(self, client: Client, *, initializer: Callable[..., object], initargs: tuple[Any, ...]) -> None:
        self._client = client
        self._plugin = WorkerSetup(initializer, initargs)
        client.register_plugin(self._plugin)
        self._executor = client.get_executor(pure=False)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return a future; it fails where a worker runs another version."""
        future: Future[T] = self._executor.submit(_run_checked, version(), fn, *args, **kwargs)
        return future

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(wait=error is None)
        with suppress(OSError):  # the scheduler is gone, and with it what was there
            self._client.unregister_worker_plugin(self._plugin.name)


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """Connect to the scheduler at ``address``, such as ``tcp://10.0.0.7:8786``.

    Raises:
        BadInput: no scheduler answers there, it has no workers, or one of them runs another version.
        WayfarerError: the scheduler was lost, or a trial ended every worker that it was given to.
    """
    _quieten()
    with _client(address) as client:
        try:
            _check_workers(client, address)
            yield Cluster(partial(ClusterExecutor, client), sum(client.nthreads().values()))
        except KilledWorker as error:
            raise WayfarerError(
                f"a group of trials ended several workers of {address}, most likely for lack of memory; "
                "the results in --out are kept: continue with --resume"
            ) from error
        except (CancelledError, OSError) as error:
            if client.status == "running":
                raise
            raise WayfarerError(
                f"the scheduler at {address} is gone; the results in --out are kept: add --resume when it is back"
            ) from error


@contextmanager
def _client(address: str) -> Iterator[Client]:
    try:
        place = get_address_host_port(normalize_address(address), strict=True)
        socket.create_connection(place, ANSWER_S).close()  # says why at once; Dask would try again and again
        kind = asyncio.run(_kind(address))
    except OSError as error:
        raise _no_scheduler(address, error.strerror or "no answer") from error
    except ValueError as error:
        raise _no_scheduler(address, str(error)) from error
    if kind != "Scheduler":
        raise _no_scheduler(address, f"a {kind} is there")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of differing packages; what matters is checked here
        client = Client(address, timeout=ANSWER_S, set_as_default=False)
    try:
        yield client
    finally:
        client.close()


async def _kind(address: str) -> str:
    """Ask what is there; a ``Client`` waits without end where something else than Dask listens."""
    async with rpc(address, timeout=ANSWER_S) as there:
        identity = await asyncio.wait_for(there.identity(), ANSWER_S)
    return str(identity["type"])


def _no_scheduler(address: str, why: str) -> BadInput:
    return BadInput(f"no Dask scheduler at '{address}': {why}; give the address that `dask scheduler` prints")


def _run_checked(expected: str, fn: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Run in a worker what another process submitted, if that runs the same wayfarer."""
    if version() != expected:
        _refuse(get_worker().address, version(), expected)
    return fn(*args, **kwargs)


def _check_workers(client: Client, address: str) -> None:
    """Make sure that there are workers, and that all of them run the same wayfarer as this process."""
    with suppress(TimeoutError):
        client.wait_for_workers(1, timeout=WORKERS_S)
    said = client.run(version, on_error="return")
    if not said:
        raise BadInput(f"no worker at the scheduler {address}: start some, such as `dask worker {address}`")
    for worker, theirs in said.items():
        if isinstance(theirs, Exception):
            _refuse(worker, f"none or another one ({type(theirs).__name__}: {theirs})", version())
        elif theirs != version():
            _refuse(worker, theirs, version())


def _refuse(worker: str, theirs: str, ours: str) -> NoReturn:
    raise BadInput(
        f"worker {worker} runs {theirs}, and this is {ours}: install the same version there and restart the worker"
    )


def _quieten() -> None:
    """Keep to this terminal what is said in one line; a cluster's own logs are on its machines."""
    for name in [*logging.root.manager.loggerDict, *NOISY]:
        if name.partition(".")[0] in NOISY:
            logger = logging.getLogger(name)
            logger.handlers = [logging.NullHandler()]
            logger.propagate = False
