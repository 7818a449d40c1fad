"""Who stops the wheels when the daemon dies, hangs, is ended, or has gone: real processes, over simulated chips.

The bench (``wayfarer.simhal.hil_server``) is a process of its own, and writes down what the wheels were told and when.
All processes of a machine share one monotonic clock, so its times compare with those in the daemon's log; a busy
machine delays what this test sees, not what it judges.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import signal
import time
from itertools import pairwise

import pytest

from tests.system import buggy_algorithms
from tests.system.bounds import bound_s
from tests.system.hil_setup import DEADMAN_S, MARGIN_S, PATIENCE_S, Site, wait_for
from tests.system.wheel_history import spans, stop_after
from wayfarer.drivers.sabertooth import packet
from wayfarer.simhal.hil_buses import HilI2C, HilSerial

pytestmark = pytest.mark.parametrize("site", sorted(DEADMAN_S), indirect=True)

I2C, SERIAL = "/dev/i2c-1", "/dev/ttyAMA0"
HANG_S = 1.0


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "suspended"])
def test_board_stops_the_wheels_of_a_daemon_that_is_gone(site: Site, how: signal.Signals) -> None:
    daemon = site.armed()
    gone_s = time.monotonic()
    daemon.send_signal(how)
    turned_s, stopped_s = stop_after(site.stopped())
    # No earlier: nobody but the deadman stopped them. No later: it was armed.
    assert stopped_s - turned_s == pytest.approx(site.deadman_s, abs=MARGIN_S)
    assert stopped_s - gone_s <= site.deadman_s + MARGIN_S


def test_suspended_daemon_notices_when_it_wakes_and_ends_in_order(site: Site) -> None:
    daemon = site.armed()
    daemon.send_signal(signal.SIGSTOP)
    site.stopped()
    woken_s = site.bench("look")["t_s"]
    daemon.send_signal(signal.SIGCONT)
    wait_for("a tick", lambda: site.log()[-1]["t_s"] > woken_s + 0.3)
    after = [record for record in site.log() if record["record"] == "tick" and record["t_s"] >= woken_s]
    # Its first tick may be one that the suspension cut in two, and applies what it had begun; no further one does.
    held = [tick for tick in after[:2] if tick["level"] in {"hold", "fault"}]
    assert held, after[:2]
    assert held[0]["t_s"] - woken_s <= bound_s("suspend"), "two cycles, and the time to wake up"
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    assert site.log()[-1]["record"] == "outcome"


@pytest.mark.parametrize("suspended_s", [1.5, 3.0])
def test_wheels_turn_again_a_second_after_the_daemon_is_woken_or_not_at_all(site: Site, suspended_s: float) -> None:
    daemon = site.armed()
    daemon.send_signal(signal.SIGSTOP)
    time.sleep(suspended_s)
    woken_s = time.monotonic()
    daemon.send_signal(signal.SIGCONT)
    wait_for("it turns again or is disarmed", lambda: site.turning or site.status()["mode"] == "disarmed")
    turns_s = [t_s - woken_s for t_s, left, right in site.commands(woken_s) if left or right]
    assert not turns_s or turns_s[0] > 0.9

    def causes() -> set[str]:
        return {record["cause"] for record in site.log() if record.get("name") == "health"}

    # A thread writes the log. The second cause is there where the daemon slept amid a transfer.
    wait_for("the log says why", lambda: causes() & {"resume_warning", "motors_failed"})


def test_ended_daemon_stops_the_wheels_itself_and_writes_how_it_ended(site: Site) -> None:
    daemon = site.armed()
    began_s = time.monotonic()
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    took_s = time.monotonic() - began_s
    stopped_s = site.stopped_by_daemon_s()
    print(f"{site.rover}: stopped {stopped_s - began_s:.3f} s after SIGTERM, ended after {took_s:.3f} s")
    assert stopped_s - began_s <= bound_s("sigterm")
    assert took_s < 2.0
    outcome = site.log()[-1]
    assert (outcome["record"], outcome["reason"], outcome["text"]) == ("outcome", "signal", "ended by SIGTERM")


def test_error_in_an_algorithm_ends_the_daemon_with_the_wheels_stopped(site: Site) -> None:
    daemon = site.armed("--algorithm", f"{buggy_algorithms.__name__}:RAISES")
    assert daemon.wait(PATIENCE_S) == 1
    last_tick_s = site.ticks_beyond(0.0)[-1]  # a cycle before the error
    assert site.stopped_by_daemon_s() - last_tick_s <= bound_s("algorithm-raises")
    outcome = site.log()[-1]
    assert (outcome["record"], outcome["reason"]) == ("outcome", "failed")
    assert buggy_algorithms.BUG in outcome["text"]


def turn_wheels(site: Site) -> None:
    """What another program might do: no deadman, and wheels that turn for ever."""
    path = str(site.folder / "bench")
    if site.rover == "minirover":
        bus = HilI2C(path, I2C)
        for command in ((19, 0), (8, 100), (11, 100)):
            bus.write(0x15, bytes(command))
        bus.close()
    else:
        port = HilSerial(path, SERIAL)
        port.write(packet(128, 0, 60) + packet(128, 4, 60))
        port.close()


def test_stop_motors_stops_wheels_that_nobody_owns(site: Site) -> None:
    turn_wheels(site)
    time.sleep(2 * site.deadman_s)
    look = site.bench("look")
    assert look["deadman_armed"] == [False]
    assert all(look["commanded"])
    began_s = time.monotonic()
    done = site.run("stop-motors", "--config", site.config)
    took_s = time.monotonic() - began_s
    assert done.returncode == 0, done.stderr
    _, stopped_s = stop_after(site.stopped())
    print(f"{site.rover}: stopped after {stopped_s - began_s:.3f} s, ended after {took_s:.3f} s: {done.stdout.strip()}")
    assert took_s < 5.0


def test_bus_that_hangs_stops_the_wheels_and_never_the_control_loop(site: Site) -> None:
    site.armed()
    hung_s = site.bench("hang", bus=I2C, for_s=HANG_S)["t_s"]
    wait_for("the bus is back", lambda: site.bench("look")["t_s"] > hung_s + HANG_S + 0.3)
    first, *later = (span for span in spans(site.bench("look")["commands"]) if span[1] > hung_s)
    ticks = [tick for tick in site.log() if tick["record"] == "tick" and hung_s <= tick["t_s"] < hung_s + HANG_S]
    print(f"{site.rover}: stopped after {first[1] - hung_s:.3f} s; {len(ticks)} ticks in {HANG_S} s; later {later}")
    # The compass hangs as well, and on the ForestRover only the compass: its wheels are held, and then go on.
    assert first[1] - hung_s < 0.5
    assert len(ticks) >= 0.8 * 20.0 * HANG_S
    assert all(late["t_s"] - tick["t_s"] < 0.2 for tick, late in pairwise(ticks)), "a tick waits one transfer at most"
    assert {tick["applied_left"] for tick in ticks if tick["t_s"] > hung_s + 0.5} == {0.0}
    if site.rover == "minirover":
        assert first[1] - hung_s <= site.deadman_s + MARGIN_S, "its board is on the same bus: only the deadman is left"
        assert site.status()["mode"] == "disarmed"
        # What hung in the wire arrives late, and is taken back by the next tick.
        assert all(end_s - start_s < 0.1 for start_s, end_s in later)
    else:
        assert site.status()["mode"] == "armed"
