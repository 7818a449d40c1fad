"""Stops of a real daemon get in if no memory or no descriptor is left, and end it though its disk hangs."""

from __future__ import annotations

import resource
import socket
from contextlib import ExitStack
from itertools import count
from pathlib import Path

import pytest

from tests.system import broken_os
from tests.system.hil_setup import Site, wait_for
from tests.system.measures import now_s
from tests.system.subprocesses import MAIN, WAYFARER, python

HUNG_S = 3600.0
ENDS_S = 5.0
CHECK_HANGS = python(
    f"import time; from wayfarer.commissioning.checks import system; system.free_mb = lambda _: time.sleep({HUNG_S});"
    f" {MAIN}"
)
ILL = python(f"from {broken_os.__name__} import patch_os; patch_os(); {MAIN}")


@pytest.mark.parametrize("verb", ["stop", "hold", "disarm"])
def test_stop_gets_in_where_no_memory_is_left(site: Site, verb: str) -> None:
    """Half requests hold all places, and the daemon may have no more memory than it has."""
    daemon = site.armed()
    size = int(Path(f"/proc/{daemon.pid}/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    resource.prlimit(daemon.pid, resource.RLIMIT_AS, (size, size))
    with ExitStack() as stack:
        for _ in range(40):
            half = stack.enter_context(socket.socket(socket.AF_UNIX))
            half.connect(str(site.socket))
            half.sendall(b'{"do": "mark", "text": "' + b"x" * 4_000)
        asked_s = now_s()
        site.ask(verb)
        print(f"no memory, {verb}: stopped {site.stopped_by_daemon_s() - asked_s:.3f} s")


@pytest.mark.parametrize("verb", ["stop", "hold", "disarm"])
def test_stop_gets_in_where_no_descriptor_is_left(site: Site, verb: str) -> None:
    """Nobody is connected whose descriptor it could have, and three come one after the other."""
    daemon = site.armed()
    taken = {int(each.name) for each in Path(f"/proc/{daemon.pid}/fd").iterdir()}
    lowest_free = next(number for number in count() if number not in taken)
    resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE, (lowest_free, lowest_free))
    for _ in range(3):
        site.status()
    asked_s = now_s()
    site.ask(verb)
    print(f"no descriptor, {verb}: stopped {site.stopped_by_daemon_s() - asked_s:.3f} s")
    if verb == "stop":
        assert daemon.wait(ENDS_S) == 0


def test_check_that_hangs_for_ever_keeps_no_stop_from_ending_the_process(site: Site) -> None:
    daemon = site.daemon(program=CHECK_HANGS)
    arming = site.start(*WAYFARER, "arm", "0")
    wait_for("it is being checked", lambda: site.status()["being_checked"])
    site.ask("stop")
    assert daemon.wait(ENDS_S) == 0
    arming.wait(10.0)


def test_log_s_disk_that_hangs_for_ever_keeps_no_stop_from_ending_the_process(site: Site) -> None:
    daemon = site.armed(program=ILL)
    site.folder.joinpath(broken_os.SLOW_DISK).write_text(str(HUNG_S), encoding="ascii")
    wait_for("the log waits", lambda: now_s() - site.ticks_beyond(0.0)[-1] > 1.0)
    asked_s = now_s()
    site.ask("stop")
    print(f"hanging disk: stopped {site.stopped_by_daemon_s() - asked_s:.3f} s")
    assert daemon.wait(ENDS_S) == 0
