"""No signal is forgotten: each that can be caught and would end or suspend the daemon has its answer."""

from __future__ import annotations

import signal
import subprocess
import sys
from signal import Signals

import pytest

from wayfarer.daemon.signals import ENDING, FAULTS, HARMLESS, IGNORED, SUSPENDING, UNCATCHABLE, name_of

LETS_IT_HAPPEN = """
import os, signal, sys
number = int(sys.argv[1])
signal.signal(number, signal.SIG_DFL)
os.kill(os.getpid(), number)
"""


@pytest.mark.process
@pytest.mark.parametrize("number", sorted(signal.valid_signals() - UNCATCHABLE - {SUSPENDING, *IGNORED}), ids=name_of)
def test_signals_that_end_a_process_are_known_as_such(number: int) -> None:
    """Let each do to a process what it does by default."""
    ended = subprocess.run([sys.executable, "-S", "-E", "-c", LETS_IT_HAPPEN, str(number)], check=False).returncode
    assert ended == (0 if number in HARMLESS else -number)
    assert (number in ENDING) is (ended != 0 and number not in FAULTS)


def test_every_signal_has_a_name() -> None:
    names = [name_of(number) for number in sorted(signal.valid_signals())]
    assert len(set(names)) == len(names)
    assert {"SIGUSR1", "SIGRTMIN", "SIGRTMIN+1", "SIGRTMAX"} <= set(names)
    assert name_of(Signals.SIGRTMIN + 3) == "SIGRTMIN+3"
