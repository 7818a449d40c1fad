"""Fixtures shared by the whole suite."""

from __future__ import annotations

import gc
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.children import hear_interrupts
from tests.compiled import pytest_report_header  # before anything imports wayfarer
from tests.loop_guard import pytest_asyncio_loop_factories
from tests.thread_guard import ends_its_threads
from tests.tiers import (
    pytest_collection_modifyitems,
    pytest_ignore_collect,
    pytest_runtest_protocol,
    pytest_xdist_auto_num_workers,
)
from wayfarer import cli

__all__ = [  # hooks, and a fixture of every test
    "ends_its_threads",
    "pytest_asyncio_loop_factories",
    "pytest_collection_modifyitems",
    "pytest_ignore_collect",
    "pytest_report_header",
    "pytest_runtest_protocol",
    "pytest_xdist_auto_num_workers",
]

Run = Callable[..., tuple[int, str, str]]


# The same examples at every run, however busy the machine is. With 100 examples each, Hypothesis's tests had a fifth of
# the unit tier's CPU time; .ci/full takes them all.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=40)
settings.register_profile("thorough", settings.get_profile("repeatable"), max_examples=100)
settings.load_profile("repeatable")

hear_interrupts()

REFERENCE_FOLDER = Path(__file__).resolve().parents[2] / "shared" / "reference"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep the garbage collector away from what collection makes.

    That is a million objects, and they stay to the end: each full collection would walk through them.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def reference_results_path() -> Path:
    """What the released simulator did in the reference forests, beside the checkout; skips if that is absent."""
    path = REFERENCE_FOLDER / "results-forest-pledge.jsonl"
    if not path.is_file():
        pytest.skip(f"the released simulator's results are not at {path}")
    return path


@pytest.fixture
def taken_port() -> Iterator[int]:
    """A port of this machine at which somebody listens, and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command in this process, on a terminal of 160 columns; returns exit code, output and errors."""
    monkeypatch.setenv("COLUMNS", "160")

    def run(*arguments: object) -> tuple[int, str, str]:
        code = cli.run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def refusal(run: Run, *arguments: object, exit_code: int = 2) -> str:
    """Run a command that must refuse, and return the one line that it prints instead of anything else."""
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (exit_code, "", 1)
    return err
