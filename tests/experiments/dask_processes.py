"""A Dask scheduler and its workers as processes of their own; ``STRANGER`` is a worker of another version."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Event

import wayfarer

ROOT = Path(wayfarer.__file__).parent.parent
UP_S = 60.0  # a generous deadline; nothing waits for it unless something is broken
DASK = "from dask.__main__ import main; main()"
STRANGER = "from wayfarer.experiments import dask_cluster; dask_cluster.version = lambda: 'wayfarer 0.0.1'; " + DASK


def eventually(condition: Callable[[], bool]) -> bool:
    pause = Event()
    for _ in range(int(UP_S / 0.05)):
        if condition():
            return True
        pause.wait(0.05)
    return False


class DaskProcesses:
    """A context: whatever it has started is gone when it is left."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self._processes: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> DaskProcesses:
        self.scheduler = self._start(DASK, "scheduler", "--host", "127.0.0.1", "--port", "0")
        assert eventually(self._file.exists), self._said(self.scheduler)
        self.address: str = json.loads(self._file.read_text())["address"]
        return self

    def __exit__(self, *exc_info: object) -> None:
        for process in reversed(self._processes):
            process.kill()
            process.wait()

    def worker(self, code: str = DASK) -> subprocess.Popen[bytes]:
        local = f"--local-directory={self._folder}"
        options = ("--nthreads", "1", "--no-nanny", "--death-timeout", "20", local)
        process = self._start(code, "worker", self.address, *options)
        assert eventually(lambda: "Registered to" in self._said(process)), self._said(process)
        return process

    def _start(self, code: str, kind: str, *options: str) -> subprocess.Popen[bytes]:
        if kind == "scheduler":
            options = (*options, "--scheduler-file", str(self._file))
        with (self._folder / f"{len(self._processes)}.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-W", "ignore", "-c", code, kind, "--no-dashboard", *options],
                cwd=ROOT, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        self._processes.append(process)
        return process

    def _said(self, process: subprocess.Popen[bytes]) -> str:
        return (self._folder / f"{self._processes.index(process)}.log").read_text()


def kill(process: subprocess.Popen[bytes]) -> None:
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
