"""Bugs in an algorithm of a third party: it blocks, it takes all memory. (One that raises: test_stop_owners.py.)"""

from __future__ import annotations

import resource

from tests.system import buggy_algorithms
from tests.system.hil_setup import MARGIN_S, PATIENCE_S, Site
from tests.system.measures import first_stop
from wayfarer.safety.gate import STALL_LIMIT_S

ALGORITHMS = buggy_algorithms.__name__
MEMORY_BYTES = 1_500_000_000  # of addresses; a daemon that is well has about 600 MB of them


def test_guard_stops_the_wheels_of_an_algorithm_that_blocks(site: Site) -> None:
    site.armed("--algorithm", f"{ALGORITHMS}:BLOCKS")
    stalled = site.told("loop_stalled")
    blocked_s = max(t_s for t_s in site.ticks_beyond(0.0) if t_s < stalled["t_s"] - STALL_LIMIT_S)
    turned_s, stopped_s = first_stop(site.commands(), blocked_s)
    print(f"stopped after {stopped_s - blocked_s:.3f} s")
    assert stopped_s - turned_s < site.deadman_s - MARGIN_S, "the deadman did it"
    assert stopped_s - blocked_s <= 0.22, "from the tick that blocks"
    assert "buggy_algorithms.py" in stalled["where"]
    assert "buggy_algorithms.py" in site.said(), "no stacks on stderr"


def test_algorithm_that_takes_all_memory_ends_with_the_wheels_stopped(site: Site) -> None:
    """Under a limit of its own it ends as by any error; a daemon that the kernel kills: test_sigkill.py."""
    daemon = site.armed("--algorithm", f"{ALGORITHMS}:HOARDS")
    resource.prlimit(daemon.pid, resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    assert daemon.wait(PATIENCE_S) == 1
    assert site.stopped_by_daemon_s() - site.ticks_beyond(0.0)[-1] <= 0.25
    outcome = site.log()[-1]
    assert outcome["reason"] == "failed"
    assert "MemoryError" in outcome["text"]
