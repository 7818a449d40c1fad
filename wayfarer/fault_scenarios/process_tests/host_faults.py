"""A computer whose disk is slow, and one whose wall clock is set."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import time
from collections.abc import Iterator

from wayfarer.fault_scenarios.process_tests import broken_os
from wayfarer.fault_scenarios.process_tests.hil_setup import HilSetup, site
from wayfarer.fault_scenarios.process_tests.jitter import jitter
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.process_tests.subprocesses import MAIN, python
from wayfarer.fault_scenarios.scenario import Reached

ILL = python(f"from {broken_os.__name__} import fall_ill; fall_ill(); {MAIN}")
QUIET_S = ILL_S = 2.5
LOOKS_S = 0.1
SYNC_TAKES_S = 0.5
JITTER_S = 0.01
HOURS_S = 3 * 3600.0
STEP_LASTS_S = 1.0


@procedure(
    "slow-disk", 42, "each sync of the log takes half a second",
    asked="writer thread only; control jitter < 10 ms", expected=Reached.NONE,
    remark="nothing is lost: the queue holds minutes; what it cannot hold is counted by log_gap",
)  # fmt: skip
def slow_disk(found: Observed) -> None:
    """Slow the disk down under a rover that drives, and compare its ticks with those before."""
    with site() as where:
        where.armed(program=ILL)
        quiet_s = time.monotonic()
        time.sleep(QUIET_S)
        where.folder.joinpath(broken_os.SLOW_DISK).write_text(str(SYNC_TAKES_S), encoding="ascii")
        ill_s = time.monotonic()
        oldest_s = max(_ages(where, ill_s + ILL_S))
        dropped = where.status()["log_dropped"]
        where.folder.joinpath(broken_os.SLOW_DISK).unlink()
        ends_s = ill_s + ILL_S
        times_s = where.ticks_beyond(ends_s)
        before, after = jitter(times_s, quiet_s, ill_s), jitter(times_s, ill_s, ends_s)
        found.changed = f"the newest record on the disk was up to {oldest_s:.2f} s old"
        found.demand(oldest_s > SYNC_TAKES_S, "the disk was not slow")
        found.demand(after.median_s - before.median_s < JITTER_S, f"the ticks: {before}, then {after}")
        found.demand(dropped == 0, f"{dropped} records were dropped")
        found.remark = f"jitter of the tick, median / p95 / worst: {before} before, {after} with it"


def _ages(where: HilSetup, ends_s: float) -> Iterator[float]:
    """Give again and again how old the newest record on the disk is."""
    while time.monotonic() < ends_s:
        yield time.monotonic() - where.ticks_beyond(0.0)[-1]
        time.sleep(LOOKS_S)


@procedure(
    "clock-step", 45, "the wall clock is set by hours, ahead and back",
    asked="no timer moves; clock_step event", expected=Reached.NOTE, within_s=0.2,
    remark="the daemon's own clock is turned: the computer's belongs to everybody",
)  # fmt: skip
def clock_step(found: Observed) -> None:
    """Set the clock ahead, then far back, under a rover that drives."""
    with site() as where:
        where.armed(program=ILL)
        begins_s = time.monotonic()
        steps = [_set_clock(where, by_s) for by_s in (HOURS_S, -HOURS_S)]
        events = [record for record in where.log() if record.get("name") == "clock_step"]
        found.demand([round(event["by_s"], -1) for event in events] == [HOURS_S, -2 * HOURS_S], f"clock_step: {events}")
        found.detected_s = max(event["t_s"] - set_s for event, set_s in zip(events, steps, strict=True))
        found.changed, found.cause, found.reached = "t_wall in each record", "clock_step", Reached.NOTE
        ends_s = steps[-1] + STEP_LASTS_S
        ticks = jitter(where.ticks_beyond(ends_s), begins_s, ends_s)
        found.demand(ticks.median_s < JITTER_S, f"the ticks: {ticks}")
        found.demand(where.drives, "the wheels stand")
        found.remark = f"jitter of the tick, median / p95 / worst: {ticks}"


def _set_clock(where: HilSetup, by_s: float) -> float:
    """Set the clock of the daemon, wait for a second of it, and return when that was."""
    fresh = where.folder / "fresh"
    fresh.write_text(str(by_s), encoding="ascii")
    set_s = time.monotonic()
    fresh.replace(where.folder / broken_os.CLOCK_STEP)
    where.ticks_beyond(set_s + STEP_LASTS_S)
    return set_s
