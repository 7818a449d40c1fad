"""The wayfarer command as a process, under this very Python.

What is tested is wayfarer, not how busy the machine is: one transfer that takes more than 0.1 s stops a rover for good.
So its processes come before all others, and a daemon that runs comes before a process that starts, which needs a core
for a second. That takes the rights of root; without them a busy machine can fail the tests.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

COMMAND_S = 60.0
# Of real-time processes; what stands for hardware comes first, because hardware never waits for a core.
WAYFARER_PRIORITY, DAEMON_PRIORITY, HARDWARE_PRIORITY = 1, 2, 3
MAIN = "from wayfarer.cli import main; main()"


def python(code: str) -> tuple[str, ...]:
    """Return the command that runs Python code."""
    return (sys.executable, "-c", code)


WAYFARER = python(MAIN)


@contextmanager
def never_late(priority: int = WAYFARER_PRIORITY) -> Iterator[None]:
    """Have this thread come before all others, and the processes that it starts too, where the user may do that."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(priority))
    except PermissionError:
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def put_first(pid: int, priority: int = DAEMON_PRIORITY) -> None:
    """Have a process that runs come before others, with its threads and its children, where the user may do that."""
    with suppress(FileNotFoundError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with suppress(PermissionError, ProcessLookupError, FileNotFoundError):  # one that ends keeps no other back
                os.sched_setscheduler(int(thread.name), os.SCHED_RR, os.sched_param(priority))
                for child in (thread / "children").read_text(encoding="ascii").split():
                    put_first(int(child), priority)


def command(
    *arguments: str | Path, program: Sequence[str] = WAYFARER, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a wayfarer command to its end.

    Args:
        arguments: of the command.
        program: what stands for ``wayfarer``.
        options: of ``subprocess.run``.
    """
    with never_late():
        return subprocess.run(
            [*program, *arguments], capture_output=True, text=True, check=False, timeout=COMMAND_S, **options
        )
