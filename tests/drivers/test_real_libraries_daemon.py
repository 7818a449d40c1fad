"""The daemon of both shipped rovers over the real smbus2, spidev and pyserial: the oldest ones and this Python's.

The bounds are those of what-stops-the-wheels.md. The bench writes down what the wheels were told and when, on the
clock that all processes of a machine share: a busy machine delays what is seen here more than what is judged.
"""

from __future__ import annotations

import json
from itertools import pairwise

import pytest

from tests.drivers.real_site import I2C, SERIAL, SPI, RealSite, each_forestrover, each_site
from tests.system.hil_setup import BUSY, STARTS, wait_for
from tests.system.measures import first_stop, now_s, spans
from wayfarer.daemon.socket.protocol import RequestRefused

pytestmark = pytest.mark.process

FROZEN_S, GONE_S = 2.5, 1.0
MARGIN_S = 0.02  # between the two writes of one drive command
BUSY_S = 0.1  # how late a process may be on a computer that does other things
COMPASS_STALE_S, MOTION_STALE_S = 0.30, 1.0  # rows 2 and 3 of the table; row 22
LATE_S = 0.1  # what hung in the wire arrives late, and is taken back by the next tick
CLEARED_BY_ARMING = {"motors_failed"}


each_device = pytest.mark.parametrize("device", [I2C, SPI])  # a MiniRover loses its motors with its compass


def driving(site: RealSite) -> None:
    """Have the rover drive, with the daemon that is there or a new one."""
    if not site.sees():
        site.daemon()
    wait_for("the wheels turn", lambda: site.drives or armed_again(site))


def armed_again(site: RealSite) -> bool:
    """Arm a disarmed rover once all is well, and return that it does not drive yet.

    A computer without time for a transfer disarms it, or refuses to arm it at first.
    """
    status = site.status()
    if status["mode"] == "disarmed" and set(status["conditions"]) <= CLEARED_BY_ARMING:
        try:
            site.ask("arm", heading_deg=0.0)
        except RequestRefused as refused:
            if not BUSY.search(str(refused)):
                raise
    return False


def assert_stood(site: RealSite, since_s: float, device: str) -> None:
    """The wheels stood in time: held for a sensor that says nothing, or stopped with the motors' bus by their board."""
    wait_for("the wheels are stopped", lambda: not site.turning)
    turned_s, stopped_s = first_stop(site.commands(), since_s)
    print(f"{site.rover}, {device}: stood after {stopped_s - since_s:.3f} s, {stopped_s - turned_s:.3f} s of silence")
    if device == motors_of(site):
        assert stopped_s - turned_s <= site.deadman_s + MARGIN_S
    else:
        assert stopped_s - since_s < (COMPASS_STALE_S if device == I2C else MOTION_STALE_S) + BUSY_S


def assert_goes_on(site: RealSite, since_s: float, device: str, late_s: float = LATE_S) -> None:
    """Once the device is back, a hold ends by itself; if the motors were lost, only arming ends it.

    ``late_s`` is how long the wheels may turn by a command that hung in the wire.
    """
    if device != motors_of(site):
        site.drives_on()
        return
    assert site.status()["mode"] == "disarmed"
    back_s = now_s()
    wait_for("all is well", lambda: set(site.status()["conditions"]) <= CLEARED_BY_ARMING)
    site.ticks_beyond(back_s + 2 * site.deadman_s)
    stood_s = first_stop(site.commands(), since_s)[1]
    assert all(end_s - start_s <= late_s for start_s, end_s in spans(site.commands(stood_s)))
    driving(site)


def motors_of(site: RealSite) -> str:
    return I2C if site.rover == "minirover" else SERIAL


@each_site
def test_parts_pass_the_checks(site: RealSite) -> None:
    for _ in range(STARTS):
        done = site.run("check", "--json", "--rover", site.config, "--log-dir", site.logs)
        if not BUSY.search(done.stdout):
            break
    assert done.returncode == 0, done.stdout + done.stderr
    verdicts = {finding["name"]: finding["verdict"] for finding in json.loads(done.stdout)["findings"]}
    asked = {I2C, SPI, motors_of(site), "motor board", "compass", "compass calibration", "motion"}
    assert {name: verdicts[name] for name in asked} == dict.fromkeys(asked, "ok")


@each_site
@each_device
def test_chip_that_freezes_stops_the_wheels_and_never_the_control_loop(site: RealSite, device: str) -> None:
    driving(site)
    frozen_s = site.bench("hang", bus=device, for_s=FROZEN_S)["t_s"]
    assert_stood(site, frozen_s, device)
    ticks_s = [t_s for t_s in site.ticks_beyond(frozen_s + FROZEN_S) if frozen_s <= t_s < frozen_s + FROZEN_S]
    assert len(ticks_s) >= 0.8 * 20.0 * FROZEN_S
    assert all(late_s - t_s < 0.2 for t_s, late_s in pairwise(ticks_s)), "a tick waits one transfer at most"
    assert_goes_on(site, frozen_s, device)


@each_site
@each_device
def test_device_that_vanishes_and_comes_back(site: RealSite, device: str) -> None:
    driving(site)
    gone_s = now_s()
    site.dev.unplug(device)
    try:
        assert_stood(site, gone_s, device)
        site.ticks_beyond(gone_s + GONE_S)
    finally:
        site.dev.plug(device)  # also for the tests that come after
    errors = (record["error"] for record in site.log() if record.get("error") and record["t_s"] > gone_s)
    told = [error for error in errors if not BUSY.search(error)]
    assert told
    assert [error for error in told if f"{device}: no such device" not in error] == []
    assert_goes_on(site, gone_s, device)


@each_forestrover
def test_serial_adapter_that_is_pulled_out_and_plugged_in_again(site: RealSite) -> None:
    driving(site)
    gone_s = now_s()
    site.unplug_serial()  # on a busy computer this may last longer than the deadman
    try:
        assert_stood(site, gone_s, SERIAL)
        site.ticks_beyond(gone_s + GONE_S)
    finally:
        site.plug_serial()  # also for the tests that come after
    assert_goes_on(site, gone_s, SERIAL)


@each_forestrover
@pytest.mark.parametrize(
    ("blocked_s", "late_s"), [(0.5, LATE_S), (FROZEN_S, 0.0)], ids=["shorter than a write may take", "longer"]
)
def test_serial_line_that_blocks(site: RealSite, blocked_s: float, late_s: float) -> None:
    driving(site)
    began_s = now_s()
    site.line.block()
    assert_stood(site, began_s, SERIAL)
    site.ticks_beyond(began_s + blocked_s)
    site.line.unblock()
    assert_goes_on(site, began_s, SERIAL, late_s)
