"""A real daemon drives by a RoboClaw, whose board stops the wheels by itself: real processes, simulated chips."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.hil_setup import MARGIN_S, Site, hil_site, wait_for
from tests.system.measures import now_s, stop_after
from wayfarer.config.rover_file import rover_text
from wayfarer.hal import WheelReading

NONE = WheelReading(0.0, None, None)
TIMEOUT_S = 0.2  # the board's own, which a request just before may have fed once more
PARTS = """[parts.motors]
driver = "roboclaw"
port = "/dev/ttyAMA0"
baud = 115200
reverse_right = true

[parts.wheels]
driver = "roboclaw_wheels"
port = "/dev/ttyAMA0"
baud = 115200
counts_per_m = 3000
"""


@pytest.fixture
def site(bench: Path, tmp_path: Path) -> Iterator[Site]:
    file = tmp_path / "claw.toml"
    text, replaced = re.subn(r"\[parts\.motors\](?:.+\n)*", PARTS, rover_text("forestrover"))
    assert replaced == 1
    file.write_text(text, encoding="utf-8")
    with hil_site(bench, str(file)) as made:
        yield made


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "suspended"])
def test_board_stops_the_wheels_of_a_daemon_that_is_gone(site: Site, how: signal.Signals) -> None:
    daemon = site.armed()
    daemon.send_signal(how)
    turned_s, stopped_s = stop_after(site.stopped())
    assert TIMEOUT_S - MARGIN_S <= stopped_s - turned_s <= 2.0 * TIMEOUT_S + MARGIN_S


def test_board_that_loses_its_power_is_opened_again_and_the_rover_drives_on(site: Site) -> None:
    site.armed()
    wait_for("its wheels turn", lambda: any((tick.get("wheels") or NONE).left_m for tick in site.log()))
    lost_s = now_s()
    site.bench("power_cycle")
    failed = site.told("motors_failed")
    assert failed["t_s"] - lost_s < 1.0
    wait_for("it drives on", lambda: site.drives)
