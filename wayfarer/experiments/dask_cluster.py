"""Executor on a Dask cluster: one campaign on many machines.

All workers must run the same wayfarer, so each worker is asked first, and again with each chunk, for workers
come and go. The campaign goes to the cluster once, and each worker fetches it before its first chunk.
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
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, ParamSpec, TypeVar

import wayfarer
from wayfarer.errors import BadInput, WayfarerError

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from distributed import Client, KilledWorker, get_worker, rpc
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

    Which commit was installed does not count, nor ``version.py``, which differs with it: the checksum says more.
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
    """The workers of a scheduler: an executor over them, and how many trials they run at a time."""

    executor: Executor
    jobs: int


class ClusterExecutor(Executor):
    """Runs chunks of trials on workers that have the same wayfarer."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._payload: bytes | None = None
        self._shared: Any = None

    def submit(self, fn: Callable[P, T], /, *args: P.args, **_: P.kwargs) -> Future[T]:
        """Return a future; it fails if the worker runs another version."""
        payload: Any
        payload, tasks = args
        if payload is not self._payload:  # it goes to the cluster once, where it is made again if its worker is lost
            self._payload, self._shared = payload, self._client.submit(bytes, payload, pure=False)
        future: Future[T] = self._executor.submit(_run_checked, version(), fn, self._shared, tasks)
        return future


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
            yield Cluster(ClusterExecutor(client), sum(client.nthreads().values()))
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
    """Ask what is there; a ``Client`` waits without end if something else than Dask listens."""
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
