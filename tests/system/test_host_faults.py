"""A computer whose disk is slow, and one whose wall clock is set."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import time
from collections.abc import Iterator

from tests.system import broken_os
from tests.system.hil_setup import Site
from tests.system.measures import jitter, now_s
from tests.system.subprocesses import MAIN, python

ILL = python(f"from {broken_os.__name__} import patch_os; patch_os(); {MAIN}")
QUIET_S = ILL_S = 2.5
LOOKS_S = 0.1
SYNC_TAKES_S = 0.5
JITTER_S = 0.01
HOURS_S = 3 * 3600.0
STEP_LASTS_S = 1.0


def test_slow_disk_delays_no_tick_and_costs_no_record(site: Site) -> None:
    """The queue of the log holds minutes; what it cannot hold is counted by log_gap."""
    site.armed(program=ILL)
    quiet_s = now_s()
    time.sleep(QUIET_S)
    site.folder.joinpath(broken_os.SLOW_DISK).write_text(str(SYNC_TAKES_S), encoding="ascii")
    ill_s = now_s()
    ends_s = ill_s + ILL_S
    oldest_s = max(ages(site, ends_s))
    dropped = site.status()["log_dropped"]
    site.folder.joinpath(broken_os.SLOW_DISK).unlink()
    times_s = site.ticks_beyond(ends_s)
    before, after = jitter(times_s, quiet_s, ill_s), jitter(times_s, ill_s, ends_s)
    print(f"jitter of the tick, median / p95 / worst: {before} before, {after} with it; {oldest_s:.2f} s")
    assert oldest_s > SYNC_TAKES_S, "the disk was not slow"
    assert after.median_s - before.median_s < JITTER_S
    assert dropped == 0


def ages(site: Site, ends_s: float) -> Iterator[float]:
    """Give again and again how old the newest record on the disk is."""
    while now_s() < ends_s:
        yield now_s() - site.ticks_beyond(0.0)[-1]
        time.sleep(LOOKS_S)


def test_wall_clock_that_is_set_moves_no_timer(site: Site) -> None:
    """The daemon's own clock is set: the computer's belongs to everybody."""
    site.armed(program=ILL)
    begins_s = now_s()
    steps = [set_clock(site, by_s) for by_s in (HOURS_S, -HOURS_S)]
    events = [record for record in site.log() if record.get("name") == "clock_step"]
    assert [round(event["by_s"], -1) for event in events] == [HOURS_S, -2 * HOURS_S]
    assert all(event["t_s"] - set_s <= 0.2 for event, set_s in zip(events, steps, strict=True))
    ends_s = steps[-1] + STEP_LASTS_S
    ticks = jitter(site.ticks_beyond(ends_s), begins_s, ends_s)
    print(f"jitter of the tick, median / p95 / worst: {ticks}")
    assert ticks.median_s < JITTER_S
    site.drives_on()


def set_clock(site: Site, by_s: float) -> float:
    """Set the clock of the daemon, wait for a second of it, and return when that was."""
    fresh = site.folder / "fresh"
    fresh.write_text(str(by_s), encoding="ascii")
    set_s = now_s()
    fresh.replace(site.folder / broken_os.CLOCK_STEP)
    site.ticks_beyond(set_s + STEP_LASTS_S)
    return set_s
