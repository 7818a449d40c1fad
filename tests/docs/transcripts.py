"""What a page shows of a terminal, beside what the terminal shows: ``console`` blocks, commands with what they print.

A line ``...`` stands for any lines, as many as there are. Nothing else may differ, but what differs from day to day
(``PASSING``), and, in a daemon's real time, numbers and what the rover does at that moment (``MOMENTARY``).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from difflib import unified_diff
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tests.docs.pages import SHELL, Fence, fences, shell_lines

HOME = "/home/you/wayfarer"  # the reader's folder, in pages
PROMPT = "$ "
TERMINAL = {"COLUMNS": "80", "PYTHONUNBUFFERED": "1"}  # unbuffered: errors come where a terminal shows them
PROGRESS = re.compile(r"^\d+ of \d+ trials\n", re.MULTILINE)  # at a terminal, a bar that is gone when it is full
UNSEEN = (re.compile(r" +$", re.MULTILINE), "")
PASSING = [
    (re.compile(r"\d{8}T\d{6}Z|\d{4}-\d\d-\d\d|(?<![:\d])\d\d:\d\d(:\d\d)?\b"), "TIME"),
    (re.compile(r"wayfarer \d\S+"), "wayfarer VERSION"),
    (re.compile(r"took [\d.]+ s, [\d.]+ us of CPU"), "took TIME of CPU"),
]
MOMENTARY = [
    (re.compile(r"(?<=^doing ).*", re.MULTILINE), "THIS"),
    (re.compile(r"[-+]?\d+(\.\d+)?"), "#"),
    (re.compile(r"(?<=\S) +"), " "),
]


class Shown(NamedTuple):
    """A command, and what the page shows below it; without a command, more of what an earlier one prints."""

    command: str
    output: str


def shown(fence: Fence) -> list[Shown]:
    """Return what a block shows, in its order."""
    found = [("", "")]
    for line in fence.body.splitlines(keepends=True):
        command, output = found[-1]
        found[-1:] = [(command, output), (line, "")] if line.startswith(PROMPT) else [(command, output + line)]
    return [Shown(command.removeprefix(PROMPT).strip(), output) for command, output in found if command or output]


def environment(folder: Path) -> dict[str, str]:
    """Return the environment of a reader who works in a folder of his own, with this Python and its ``wayfarer``."""
    own = {name: str(folder) for name in ("RUNTIME_DIRECTORY", "STATE_DIRECTORY", "HOME")}
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return {**os.environ, **own, "PATH": path, **TERMINAL}


def printed(commands: Iterable[str], folder: Path, environment: Mapping[str, str]) -> list[str]:
    """Run commands in one shell, and return what the terminal shows of each."""
    end = "\x1e"
    script = "".join(f"{command}\nprintf '\\x1e'\n" for command in commands)
    said = subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=True,
    )
    return said.stdout.decode().split(end)[:-1]


def difference(page: str, terminal: str, folder: Path, *, in_real_time: bool = False) -> str:
    """Return how what a page shows differs from what the terminal shows in that folder; nothing if it does not."""
    terminal = PROGRESS.sub("", terminal.replace(str(folder), HOME))
    for pattern, instead in (*PASSING, *(MOMENTARY if in_real_time else ()), UNSEEN):
        page, terminal = pattern.sub(instead, page), pattern.sub(instead, terminal)
    pieces = re.split(r"^\.\.\.\n", page, flags=re.MULTILINE)
    if re.fullmatch(r"(?:.*\n)*?".join(map(re.escape, pieces)), terminal):
        return ""
    return "".join(unified_diff(page.splitlines(True), terminal.splitlines(True), "the page", "the terminal", n=1))


def stale(fence: Fence, folder: Path, environment: Mapping[str, str]) -> str:
    """Run the commands of a block, and return the differences."""
    commands, outputs = zip(*shown(fence), strict=True)
    return "".join(map(partial(difference, folder=folder), outputs, printed(commands, folder, environment)))


def play(page: str, compared_by: str, folder: Path) -> str:
    """Run what a page shows, in a folder, and return what is stale in it.

    Those are the blocks that run everywhere, its Python, and what ``compared_by`` is to compare.
    """
    found = ""
    for fence in fences(page):
        if fence.compared_by == compared_by:
            found += stale(fence, folder, os.environ | TERMINAL)
        elif fence.why_not is None and fence.language in {*SHELL, "python"}:
            script = fence.body if fence.language == "python" else "\n".join(shell_lines(fence))
            program = ["python", "-"] if fence.language == "python" else ["bash", "-ex"]
            subprocess.run(program, input=script.encode(), cwd=folder, check=True)
    return found


if __name__ == "__main__":  # for .ci/run
    sys.exit(play(sys.argv[1], ".ci/run", Path(sys.argv[2])) or None)  # an empty text would be exit code 1
