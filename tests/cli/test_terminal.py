"""The person at the terminal may go away at any moment, by Ctrl-D, Ctrl-C or a cut connection; then the wheels stop."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Coroutine
from typing import Any

import pytest

from tests.children import child
from wayfarer.cli.terminal import Terminal, run_interactive
from wayfarer.errors import BadInput

TURNS_WHEELS = """
import asyncio
from wayfarer.cli.terminal import Terminal, run_interactive

async def run():
    try:
        print("turning", flush=True)
        await {waits}
    finally:
        await asyncio.sleep(0.05)
        print("stopped", flush=True)

run_interactive(run)
print("went on", flush=True)
"""


@pytest.mark.process
@pytest.mark.parametrize("waits", ["asyncio.sleep(30.0)", "Terminal().ask('Do they turn?')"], ids=["drive", "question"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_stops_the_wheels_and_ends_the_process(number: signal.Signals, waits: str) -> None:
    with child(
        [sys.executable, "-c", TURNS_WHEELS.format(waits=waits)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == b"turning\n"
        process.send_signal(number)
        assert process.wait(10.0) == 128 + number
        assert process.stdout.read().endswith(b"stopped\n")
        assert process.stderr.read() == b"\nwayfarer: interrupted; a stop was sent\n"


@pytest.mark.process
def test_signal_that_was_to_be_ignored_is() -> None:
    code = "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    code += TURNS_WHEELS.format(waits="asyncio.sleep(0.5)")
    with child([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"turning\n"
        process.send_signal(signal.SIGHUP)
        assert process.stdout.read() == b"stopped\nwent on\n"


def test_what_is_run_returns_and_raises_as_it_does() -> None:
    async def answer() -> int:
        return 42

    async def fail() -> int:
        raise BadInput("no")

    assert run_interactive(answer) == 42
    with pytest.raises(BadInput, match="no"):
        run_interactive(fail)


@pytest.fixture
async def terminal() -> AsyncIterator[Terminal]:
    """A terminal whose thread ends with the test; that of a command ends with its process."""
    made = Terminal()
    yield made
    await made._questions.close()


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch, terminal: Terminal) -> Terminal:
    """Someone who has pressed Ctrl-D."""
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    return terminal


async def test_end_of_the_input_is_a_no(person: Terminal) -> None:
    assert await person.ask("Does the rover stand on blocks?") is False


async def test_end_of_the_input_is_no_number_and_no_deed(person: Terminal) -> None:
    questions: list[Coroutine[Any, Any, object]] = [
        person.number("How far?", 2.0),
        person.wait("Push it"),
    ]
    for question in questions:
        with pytest.raises(BadInput, match="the input has ended"):
            await question


async def test_person_who_went_away_is_not_a_bus_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    back = threading.Event()
    monkeypatch.setattr("wayfarer.cli.terminal.PATIENCE_S", 0.02)
    monkeypatch.setattr("wayfarer.cli.terminal.typer.prompt", lambda *_, **__: back.wait())
    terminal = Terminal()
    try:
        with pytest.raises(BadInput, match="within an hour"):
            await terminal.wait("Push it")
    finally:
        back.set()
        await terminal._questions.close()
