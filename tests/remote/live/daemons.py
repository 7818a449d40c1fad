"""Daemons as processes, for browsers to look at."""

# ruff: noqa: TID251 - processes live in real time
from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

from tests.children import child
from wayfarer.daemon.socket.client import NoDaemon, ask


class Daemon:
    """A ``wayfarer`` that runs, and the address at which it is shown."""

    def __init__(self, folder: Path, process: subprocess.Popen[str], said: IO[str]) -> None:
        self.folder = folder
        self.process = process
        for line in said:
            if found := re.search(r"http://\S+", line):
                self.url = found.group()
                return
        raise AssertionError(f"wayfarer ended with exit code {process.wait()}")

    @property
    def origin(self) -> str:
        """The address without the token."""
        return self.url.partition("/?")[0].rstrip("/")

    @property
    def port(self) -> int:
        port = urlsplit(self.url).port
        assert port is not None
        return port

    def ask(self, do: str, **keys: object) -> dict[str, Any]:
        return ask({"do": do, **keys}, self.folder / "control.sock", timeout_s=10.0)

    def log(self) -> list[dict[str, Any]]:
        (path,) = (self.folder / "logs").glob("*/run.00001.jsonl")
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]

    def arm(self) -> None:
        """Have it drive; its socket and its first heading may take a moment to come."""
        poll(self.sees)
        self.ask("arm", heading_deg=0.0)

    def sees(self) -> bool:
        """Whether it is there and knows its heading."""
        try:
            return self.ask("status").get("heading_deg") is not None
        except NoDaemon:
            return False


@contextmanager
def running(*arguments: str) -> Iterator[Daemon]:
    """Run ``wayfarer`` with a socket and logs of its own; it is killed at the end if it has not ended before."""
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:  # a socket's path must be short
        environment = {**os.environ, "RUNTIME_DIRECTORY": folder, "XDG_STATE_HOME": folder}
        command = [sys.executable, "-m", "wayfarer", *arguments, "--log-dir", f"{folder}/logs"]
        with (
            (Path(folder) / "stderr").open("w+") as errors,
            child(command, env=environment, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
        ):
            assert process.stdout is not None
            yield Daemon(Path(folder), process, process.stdout)


def poll(holds: Callable[[], object], within_s: float = 10.0) -> None:
    """Wait until something holds."""
    import time

    ends_s = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < ends_s, f"not within {within_s} s"
        time.sleep(0.02)
