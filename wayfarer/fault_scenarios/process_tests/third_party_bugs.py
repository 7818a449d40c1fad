"""Bugs in what a third party wrote: it blocks, it raises, it takes all memory."""

from __future__ import annotations

import resource
from importlib.resources import files
from pathlib import Path
from subprocess import Popen

from wayfarer.fault_scenarios.process_tests import buggy_algorithms
from wayfarer.fault_scenarios.process_tests.hil_setup import PATIENCE_S, HilSetup, site
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.process_tests.wheel_history import first_stop, stop_after
from wayfarer.fault_scenarios.scenario import Reached

MISBEHAVING = buggy_algorithms.__name__
GUARD_S = 0.2  # safety.gate.STALL_LIMIT_S
MARGIN_S = 0.02  # between the two writes of one drive command
CYCLE_S = 0.05
BUSY_S = 0.25  # memory that is given back takes its time
BUGGY = "buggy_algorithms.py"
MEMORY_BYTES = 1_500_000_000  # of addresses; a daemon that is well has about 600 MB of them
UNIT_SOURCE = Path(__file__).resolve().parents[3] / "systemd" / "wayfarer.service"  # of an editable installation
# What keeps a daemon that was killed for its memory from staying down, or from leaving wheels turning.
UNIT_LINES = ("MemoryMax=", "ExecStopPost=-@WAYFARER@ stop-motors", "Restart=on-failure")


@procedure(
    "loop-blocked", 37, "an algorithm blocks the event loop for a second",
    asked="guard thread writes zero; dump stacks; 0.2 s", expected=Reached.HOLD, within_s=GUARD_S + MARGIN_S,
    remark="counted from the tick that blocks",
)  # fmt: skip
def loop_blocked(found: Observed) -> None:
    """Block the loop, and see who stops the wheels, and what is said about the place."""
    with site() as where:
        where.armed("--algorithm", f"{MISBEHAVING}:BLOCKS")
        stalled = where.told("loop_stalled")
        blocked_s = max(t_s for t_s in where.ticks_beyond(0.0) if t_s < stalled["t_s"] - GUARD_S)
        turned_s, stop_s = first_stop(where.commands(), blocked_s)
        found.stopped_s = stop_s - blocked_s
        found.demand(stop_s - turned_s < where.deadman_s - MARGIN_S, "it was the deadman that stopped the wheels")
        found.changed, found.cause = f"no tick for {stalled['stall_s']} s", "loop_stalled"
        found.remark = f"the log says where: {stalled['where'].partition(' <')[0]}"
        found.demand(BUGGY in stalled["where"], "the log does not say where")
        found.demand(BUGGY in where.said(), "no stacks on stderr")
        found.reached = Reached.HOLD


@procedure(
    "algorithm-raises", 38, "an exception in a third party's algorithm",
    asked="supervisor S3, not a zombie; 1 cycle", expected=Reached.FAULT, within_s=2 * CYCLE_S,
    remark="counted from the tick before, which is a cycle older than the exception",
)  # fmt: skip
def algorithm_raises(found: Observed) -> None:
    """Have an algorithm raise while it drives."""
    with site() as where:
        _ends_in_order(where, where.armed("--algorithm", f"{MISBEHAVING}:RAISES"), buggy_algorithms.BUG, found)


@procedure(
    "out-of-memory", 39, "an algorithm takes memory without end",
    asked="MemoryMax, as 35", expected=Reached.FAULT, within_s=BUSY_S,
    remark="under a limit of its own (RLIMIT_AS) it ends as by any error; what the kernel kills is row 35",
)  # fmt: skip
def out_of_memory(found: Observed) -> None:
    """Let memory run out under a limit, and see that the unit file has one, and what must follow."""
    unit = files("wayfarer").joinpath("wayfarer.service")
    text = (unit if unit.is_file() else UNIT_SOURCE).read_text(encoding="utf-8")
    for line in UNIT_LINES:
        found.demand(line in text, f"the unit file has no {line}")
    with site() as where:
        daemon = where.armed("--algorithm", f"{MISBEHAVING}:HOARDS")
        resource.prlimit(daemon.pid, resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        _ends_in_order(where, daemon, "MemoryError", found)


def _ends_in_order(where: HilSetup, daemon: Popen[bytes], why: str, found: Observed) -> None:
    """See that a daemon ends by an error with its wheels stopped, and says why."""
    found.demand(daemon.wait(PATIENCE_S) == 1, f"exit code {daemon.returncode}")
    turned_s, stop_s = stop_after(where.stopped())
    found.demand(stop_s - turned_s < where.deadman_s - MARGIN_S, "it was the deadman that stopped the wheels")
    found.stopped_s = stop_s - where.ticks_beyond(0.0)[-1]
    outcome = where.log()[-1]
    found.cause = outcome.get("reason", "")
    found.changed = outcome.get("text", "")
    found.reached = Reached.FAULT if found.cause == "failed" else Reached.NONE
    found.demand(why in found.changed, "the outcome does not say why")
