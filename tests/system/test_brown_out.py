"""The board's power dips, then the daemon is killed; ``python -m tests.system.brown_out`` does it more often."""

from __future__ import annotations

import pytest

from tests.system.bounds import bound_s
from tests.system.brown_out import kills
from tests.system.hil_setup import Site, wait_for
from tests.system.wheel_history import stop_after, told_to_turn

pytestmark = pytest.mark.slow


def test_wheels_stand_within_the_deadman_after_a_brown_out_of_the_board_and_the_death_of_the_daemon() -> None:
    done = list(kills(6, seed=24))
    assert {kill.rover for kill in done} == {"forestrover", "minirover"}
    assert [kill for kill in done if not kill.stands] == []


def test_start_after_a_brown_out_is_disarmed(site: Site) -> None:
    """Instead of the computer the daemon alone is started again."""
    site.armed().kill()
    killed_s = site.bench("power_cycle")["t_s"]
    _, stopped_s = stop_after(site.stopped())
    assert stopped_s - killed_s <= bound_s("brown-out")
    assert site.bench("look")["deadman_armed"] == [False], "the board kept its deadman over the loss"
    cut_off = max(site.logs.iterdir()).name
    site.daemon()
    event = site.told("unclean_shutdown")
    assert event["run"] == cut_off
    assert event["last_t_s"] is not None
    assert site.status()["mode"] == "disarmed"
    assert not told_to_turn(site.commands(stopped_s)), "wheels turned before anybody asked to arm"
    site.ask("arm", heading_deg=0.0)
    wait_for("the wheels turn", lambda: site.drives)
    assert site.bench("look")["deadman_armed"] == [True]
