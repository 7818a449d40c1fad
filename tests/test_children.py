"""Children of tests hear Ctrl-C, and end with their test."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.children import child, hear_interrupts

HOW = (sys.executable, "-c", "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)")


@pytest.fixture
def in_the_background() -> Iterator[None]:
    """As a script's background job."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.process
@pytest.mark.usefixtures("in_the_background")
def test_child_hears_ctrl_c_also_where_the_tests_run_in_the_background() -> None:
    assert subprocess.check_output(HOW, text=True) == "False\n"
    hear_interrupts()
    assert subprocess.check_output(HOW, text=True) == "True\n"


@pytest.mark.process
def test_child_ends_with_a_test_that_fails() -> None:
    with pytest.raises(ZeroDivisionError), child([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        raise ZeroDivisionError
    assert process.returncode == -signal.SIGKILL
