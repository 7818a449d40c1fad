"""The wayfarer command as a process, under this very Python.

What is tested is wayfarer, not how busy the machine is: one transfer that takes more than 0.1 s stops a rover for good.
So its processes come before all others, and those that run before those that start, which need a core for a second.
That takes the rights of root; without them a busy machine can fail the tests.

What starts has no real-time priority, only a better one among the ordinary: Linux lets a process that computes go on
for 0.1 s before it runs another of the same real-time priority.
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
STARTING_NICENESS = -5  # three times the share of an ordinary process: in time, and holds up no test beside it
# Of real-time processes; what stands for hardware comes first, because hardware never waits for a core.
DAEMON_PRIORITY, HARDWARE_PRIORITY = 1, 2
MAIN = "from wayfarer.cli import main; main()"


def python(code: str) -> tuple[str, ...]:
    """Return the command that runs Python code."""
    return (sys.executable, "-c", code)


WAYFARER = python(MAIN)


@contextmanager
def starting() -> Iterator[None]:
    """Have this thread come before ordinary ones, and what it starts too, if the user may do that."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, STARTING_NICENESS)
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)


def put_first(pid: int, priority: int = DAEMON_PRIORITY) -> None:
    """Have a process that runs come before others, with its threads and its children, if the user may do that."""
    with suppress(FileNotFoundError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with suppress(FileNotFoundError):  # one that ends keeps no other back
                put_thread_first(int(thread.name), priority)
                for child in (thread / "children").read_text(encoding="ascii").split():
                    put_first(int(child), priority)


def put_thread_first(thread: int, priority: int = DAEMON_PRIORITY) -> None:
    """Have a thread come before others, if the user may do that; 0 is the one that asks."""
    with suppress(PermissionError, ProcessLookupError):
        os.sched_setscheduler(thread, os.SCHED_RR, os.sched_param(priority))


def command(
    *arguments: str | Path, program: Sequence[str] = WAYFARER, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a wayfarer command to its end.

    Args:
        arguments: of the command.
        program: what stands for ``wayfarer``.
        options: of ``subprocess.run``.
    """
    with starting():
        return subprocess.run(
            [*program, *arguments], capture_output=True, text=True, check=False, timeout=COMMAND_S, **options
        )
