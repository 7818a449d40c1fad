"""A disk that is slow, a wall clock that is set, and files that change or go while the daemon runs."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import shutil
import time
from collections.abc import Iterator

import pytest

from tests.system import broken_os
from tests.system.hil_setup import Site, wait_for
from tests.system.measures import jitter, now_s
from tests.system.subprocesses import MAIN, python
from wayfarer.daemon.socket.protocol import RequestRefused

ILL = python(f"from {broken_os.__name__} import patch_os; patch_os(); {MAIN}")
QUIET_S = ILL_S = 2.5
LOOKS_S = 0.1
SYNC_TAKES_S = 0.5
JITTER_S = 0.01
HOURS_S = 3 * 3600.0
STEP_LASTS_S = 1.0
TOLD_WITHIN_S = 1.3
CRUISE, GENTLER = "cruise_m_s = 0.42", "cruise_m_s = 0.21"


def test_slow_disk_delays_no_tick_and_costs_no_record(site: Site) -> None:
    """The queue of the log holds minutes; what it cannot hold is counted."""
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


def test_rover_file_that_is_changed_counts_from_the_next_start_on(site: Site) -> None:
    daemon = site.armed()
    site.config.write_text(site.config.read_text("utf-8").replace(CRUISE, GENTLER), encoding="utf-8")
    time.sleep(1.0)
    before = site.log()[0]
    assert before["config"]["escape"]["cruise_m_s"] == 0.42
    site.drives_on()
    daemon.terminate()
    daemon.wait()
    site.daemon()
    after = site.log()[0]
    assert after["config"]["escape"]["cruise_m_s"] == 0.21
    assert before["config_hash"] != after["config_hash"]


def test_rover_drives_on_without_its_folder_of_logs_and_check_fails(site: Site) -> None:
    """A file in the folder's place; a card that is read-only refuses in the same place, with another error."""
    daemon = site.armed()
    shutil.rmtree(site.logs)
    site.logs.write_text("no folder", encoding="ascii")
    drives_on_without_a_log(site)
    daemon.terminate()
    daemon.wait()
    checked = site.run("check", "--rover", site.config, "--log-dir", site.logs, "--json")
    assert checked.returncode == 1
    assert "cannot be written" in checked.stdout


def drives_on_without_a_log(site: Site) -> None:
    """The daemon notices, the rover drives on, and it is not armed again."""
    began_s = time.monotonic()
    wait_for("the daemon says that it loses records", lambda: site.status()["log_dropped"] > 0)
    assert time.monotonic() - began_s <= TOLD_WITHIN_S
    assert "the field log" in site.said(), "nothing on the terminal"
    site.drives_on()
    site.ask("disarm")
    with pytest.raises(RequestRefused, match="log"):
        site.ask("arm", heading_deg=0.0)
