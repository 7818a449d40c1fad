"""Signals to a real daemon that drives: the wheels first, then an outcome in the log that names the signal.

Each signal that would end a process has the same handler, so a few stand for all of them; the kernel says which ones
the daemon takes.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from signal import Signals

import pytest

from tests.system.hil_setup import MARGIN_S, PATIENCE_S, Site, hil_site, wait_for
from tests.system.measures import now_s, stop_after, told_to_turn
from wayfarer.daemon.signals import ENDING, IGNORED, SUSPENDING, name_of

BY_PYTHON = {Signals.SIGPIPE, Signals.SIGXFSZ}  # ignored from the start of every Python process
# What a terminal sends, what a program might, and one without a name; SIGTERM: test_stop_owners.py.
TRIED = (Signals.SIGINT, Signals.SIGHUP, Signals.SIGALRM, Signals.SIGRTMIN + 1)


@pytest.fixture(scope="module")
def site(bench: Path) -> Iterator[Site]:
    with hil_site(bench) as made:
        yield made


def test_daemon_takes_every_signal_that_would_end_or_suspend_it(site: Site) -> None:
    daemon = site.daemon()
    status = Path(f"/proc/{daemon.pid}/status").read_text(encoding="ascii")
    assert signals_in(status, "SigCgt") == (ENDING - BY_PYTHON) | {SUSPENDING}
    assert signals_in(status, "SigIgn") == BY_PYTHON | IGNORED
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0


def signals_in(status: str, mask: str) -> set[int]:
    """The signals of a mask in a process's status: those that it catches, or ignores (proc_pid_status(5))."""
    found = re.search(rf"^{mask}:\t([0-9a-f]+)$", status, re.MULTILINE)
    assert found is not None
    return {number for number in signal.valid_signals() if int(found[1], 16) >> (number - 1) & 1}


@pytest.mark.parametrize("number", TRIED, ids=name_of)
def test_signal_stops_the_wheels_first_and_is_named_in_the_outcome(site: Site, number: int) -> None:
    daemon = site.armed()
    began_s = now_s()
    daemon.send_signal(number)
    assert daemon.wait(PATIENCE_S) == 0
    assert site.stopped_by_daemon_s(began_s - 1.0) - began_s < 0.5
    outcome = site.log()[-1]
    assert (outcome["record"], outcome.get("text")) == ("outcome", f"ended by {name_of(number)}")


def test_ctrl_z_stops_the_wheels_first_and_what_wakes_it_finds_it_disarmed(site: Site) -> None:
    daemon = site.armed()
    began_s = now_s()
    for _ in range(2):  # keys are pressed twice
        daemon.send_signal(signal.SIGTSTP)
    stopped_s = site.stopped_by_daemon_s(began_s - 1.0)
    state = Path(f"/proc/{daemon.pid}/stat")
    wait_for("it is suspended", lambda: state.read_text(encoding="ascii").rpartition(")")[2].split()[0] == "T")
    daemon.send_signal(signal.SIGCONT)
    status = wait_for("it answers", lambda: site.status() if site.sees() else None)
    assert (status["mode"], status["why_disarmed"]) == ("disarmed", "suspended by SIGTSTP")
    assert not told_to_turn(site.commands(stopped_s)), "wheels turned"
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0


def test_daemon_in_the_background_goes_on_where_its_terminal_would_suspend_it(site: Site) -> None:
    daemon = site.armed()
    for number in IGNORED:
        daemon.send_signal(number)
    time.sleep(2 * site.deadman_s)
    site.drives_on()
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0


def test_board_stops_the_wheels_of_a_daemon_that_a_fault_ends(site: Site) -> None:
    """As docs/explanation/what-stops-the-wheels.md says: what a fault does to a process is left as it is."""
    daemon = site.armed()
    began_s = now_s()
    daemon.send_signal(Signals.SIGSEGV)
    assert daemon.wait(PATIENCE_S) == -Signals.SIGSEGV
    site.stopped()
    turned_s, stopped_s = stop_after(site.commands(began_s - 1.0))
    assert stopped_s - turned_s == pytest.approx(site.deadman_s, abs=MARGIN_S)
