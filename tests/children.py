"""Child processes of tests: they hear Ctrl-C as they would at a terminal, and end with their test."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def hear_interrupts() -> None:
    """Have SIGINT and SIGHUP be heard, by what is started from now on too.

    A shell that is no terminal's starts its background jobs with SIGINT ignored, and nohup ignores SIGHUP. What is
    ignored stays so in a child, which would never end by the signal that its test sends; what has a handler is the
    default in a child.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


@contextmanager
def child(command: Sequence[str | Path], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Run a command beside the test, and kill it when the test is over: ``Popen`` itself would wait for its end.

    Args:
        command: program and arguments.
        options: of ``subprocess.Popen``.
    """
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.kill()
