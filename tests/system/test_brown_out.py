"""The motor board loses its power for a moment while the rover drives, then the computer dies: do the wheels stop?

A board that has lost its power has forgotten its deadman. A daemon that drives on, and is killed before it has noticed,
would leave wheels that nothing stops. More often:
``KILLS=20 pytest -n 0 -m long -s tests/system/test_brown_out.py``.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import os
import time
from random import Random

import pytest

from tests.system.hil_setup import DEADMAN_S, Site, wait_for
from tests.system.measures import now_s, stop_after, told_to_turn
from wayfarer.fieldlog.folders import run_folders

KILLS = int(os.environ.get("KILLS", "6"))  # half of them on each rover; each takes about three seconds
LATEST_S = 0.5  # from the board's loss of power to the kill: longer than the health poll needs to see it
MARGIN_S = 0.05  # between the two writes of one drive command, on a busy computer


@pytest.mark.long
@pytest.mark.parametrize("site", sorted(DEADMAN_S), indirect=True)
def test_wheels_stand_within_the_deadman_after_a_brown_out_of_the_board_and_the_death_of_the_daemon(site: Site) -> None:
    chance = Random(24)
    for _ in range(KILLS // 2):
        daemon = site.armed()
        site.bench("power_cycle")
        after_s = chance.uniform(0.0, LATEST_S)
        time.sleep(after_s)
        daemon.kill()
        killed_s = now_s()
        daemon.wait()
        _, stopped_s = stop_after(site.stopped())
        print(f"{site.rover}, killed after {after_s:.3f} s: stood after {stopped_s - killed_s:.3f} s")
        assert stopped_s - killed_s <= site.deadman_s + MARGIN_S


def test_start_after_a_brown_out_is_disarmed(site: Site) -> None:
    """Instead of the computer the daemon alone is started again."""
    site.armed().kill()
    killed_s = site.bench("power_cycle")["t_s"]
    _, stopped_s = stop_after(site.stopped())
    assert stopped_s - killed_s <= 0.3
    assert site.bench("look")["deadman_armed"] == [False], "the board kept its deadman over the loss"
    cut_off = run_folders(site.logs)[-1].name
    site.daemon()
    event = site.told("unclean_shutdown")
    assert event["last_run"] == cut_off
    assert site.status()["mode"] == "disarmed"
    assert not told_to_turn(site.commands(stopped_s)), "wheels turned before anybody asked to arm"
    site.ask("arm", heading_deg=0.0)
    wait_for("the wheels turn", lambda: site.drives)
    assert site.bench("look")["deadman_armed"] == [True]
