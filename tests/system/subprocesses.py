"""The wayfarer command as a process, under this very Python."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

COMMAND_S = 30.0
MAIN = "from wayfarer.cli import main; main()"


def python(code: str) -> tuple[str, ...]:
    """Return the command that runs Python code."""
    return (sys.executable, "-c", code)


WAYFARER = python(MAIN)


def command(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a wayfarer command to its end; ``options`` are those of ``subprocess.run``."""
    return subprocess.run(
        [*WAYFARER, *arguments], capture_output=True, text=True, check=False, timeout=COMMAND_S, **options
    )
