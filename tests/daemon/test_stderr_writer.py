"""Lines for the terminal never hold up the thread that writes them, and what is lost is told."""

# ruff: noqa: TID251 - a thread that waits for a file waits in real time
from __future__ import annotations

import os
import select
import subprocess
import sys
import threading
import time

import pytest

from wayfarer.daemon.stderr_writer import CLOSE_S, LINES, StderrWriter

PATIENCE_S = 20.0
BYTES = 65_536  # what a pipe holds until somebody reads


class Terminal:
    """A stderr that is read only when a test wants it to be."""

    def __init__(self) -> None:
        self._reading, writing = os.pipe()
        self.file = os.fdopen(writing, "w")

    def stall(self) -> None:
        """Fill it up: a thread that writes from now on waits."""
        os.write(self.file.fileno(), b"." * (BYTES - 1) + b"\n")

    def read_until(self, last: str) -> list[str]:
        """Return the lines up to one that begins like this."""
        text = ""
        while not any(line.startswith(last) for line in text.rpartition("\n")[0].splitlines()):
            readable, _, _ = select.select([self._reading], [], [], PATIENCE_S)
            assert readable, f"no line {last!r} came, only {text!r}"
            text += os.read(self._reading, BYTES).decode()
        return [line for line in text.splitlines() if not line.startswith("..")]

    def __enter__(self) -> Terminal:
        """Be the process's stderr; not a fixture's work, since pytest puts its own back before each test."""
        self._was, sys.stderr = sys.stderr, self.file
        return self

    def __exit__(self, *_: object) -> None:
        sys.stderr = self._was
        os.close(self._reading)  # a thread that still waits is woken by an error
        self.file.close()


def test_lines_arrive_in_order_before_the_writer_is_closed() -> None:
    with Terminal() as terminal:
        lines = StderrWriter()
        for text in ("armed", "ödland \udc80", "ended"):
            lines.write(text)
        lines.close()
        lines.close()
        assert terminal.read_until("ended") == ["armed", "ödland \\udc80", "ended"]


def test_stalled_terminal_holds_up_nobody_and_is_told_what_was_lost() -> None:
    with Terminal() as terminal:
        terminal.stall()
        lines = StderrWriter()
        lines.write("first")
        while lines._queue:  # until the thread has it, and waits
            time.sleep(0.001)
        began_s = time.monotonic()
        for number in range(LINES + 77):
            lines.write(f"line {number}")
        assert time.monotonic() - began_s < 0.5
        told = terminal.read_until("…")
        assert told == ["first", *(f"line {number}" for number in range(LINES)), "… 77 lines lost"]
        lines.write("well again")
        assert terminal.read_until("well") == ["well again"]
        lines.close()


def test_closing_waits_for_a_stalled_terminal_only_so_long() -> None:
    with Terminal() as terminal:
        terminal.stall()
        lines = StderrWriter()
        lines.write("never read")
        began_s = time.monotonic()
        lines.close()
        assert CLOSE_S <= time.monotonic() - began_s < CLOSE_S + 0.5


@pytest.mark.process
def test_process_ends_though_its_terminal_is_stalled() -> None:
    """The thread that waits holds nothing that Python needs to exit."""
    reading, writing = os.pipe()
    os.write(writing, b"." * BYTES)
    code = "from wayfarer.daemon.stderr_writer import StderrWriter; w = StderrWriter(); w.write('x'); w.close()"
    try:
        assert subprocess.run([sys.executable, "-c", code], stderr=writing, timeout=20.0, check=False).returncode == 0
    finally:
        os.close(reading)
        os.close(writing)


@pytest.mark.parametrize("stderr", [None, "closed"])
def test_without_a_stderr_nothing_is_raised(monkeypatch: pytest.MonkeyPatch, stderr: str | None) -> None:
    with open(os.devnull, "w") as closed:  # noqa: PTH123
        pass
    monkeypatch.setattr(sys, "stderr", closed if stderr else None)
    raised: list[object] = []
    monkeypatch.setattr(threading, "excepthook", raised.append)
    lines = StderrWriter()
    lines.write("for nobody")
    lines.close()
    lines.write("for nobody")
    lines.close()
    assert raised == []


def test_thread_that_cannot_be_made_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    lines = StderrWriter()
    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", refuse)
        lines.write("early")
    with Terminal() as terminal:
        lines.write("late")
        assert terminal.read_until("late") == ["early", "late"]
        lines.close()
