"""Who stops the wheels when the daemon dies, is suspended or is ended: real processes, over simulated chips.

A bus that hangs, and wheels that nobody owns: tests/drivers/test_real_libraries_daemon.py and test_stop_recorded.py.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import signal
import time

import pytest

from tests.system import buggy_algorithms
from tests.system.hil_setup import DEADMAN_S, MARGIN_S, PATIENCE_S, Site, wait_for
from tests.system.measures import now_s, stop_after

pytestmark = pytest.mark.parametrize("site", sorted(DEADMAN_S), indirect=True)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "suspended"])
def test_board_stops_the_wheels_of_a_daemon_that_is_gone(site: Site, how: signal.Signals) -> None:
    daemon = site.armed()
    gone_s = now_s()
    daemon.send_signal(how)
    turned_s, stopped_s = stop_after(site.stopped())
    # No earlier: nobody but the deadman stopped them. No later: it was armed.
    assert stopped_s - turned_s == pytest.approx(site.deadman_s, abs=MARGIN_S)
    assert stopped_s - gone_s <= site.deadman_s + MARGIN_S


def test_board_stops_the_wheels_of_a_killed_daemon_though_a_person_holds_the_key(site: Site) -> None:
    with site.driven_by_hand() as daemon:
        gone_s = now_s()
        daemon.kill()
        turned_s, stopped_s = stop_after(site.stopped())
    assert stopped_s - turned_s == pytest.approx(site.deadman_s, abs=MARGIN_S)
    assert stopped_s - gone_s <= site.deadman_s + MARGIN_S


@pytest.mark.parametrize("by", ["stop-motors", "SIGTERM"])
def test_wheels_are_stopped_for_good_though_a_person_holds_the_key(site: Site, by: str) -> None:
    with site.driven_by_hand() as daemon:
        if by == "SIGTERM":
            daemon.terminate()
        else:
            done = site.run("stop-motors", "--rover", site.config)
            assert done.returncode == 0, done.stderr
        assert daemon.wait(PATIENCE_S) == 0
        site.stopped()


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
    assert held[0]["t_s"] - woken_s <= 0.15, "two cycles, and the time to wake up"
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    assert site.log()[-1]["record"] == "outcome"


@pytest.mark.parametrize("suspended_s", [1.5, 3.0])
def test_wheels_turn_again_a_second_after_the_daemon_is_woken_or_not_at_all(site: Site, suspended_s: float) -> None:
    daemon = site.armed()
    daemon.send_signal(signal.SIGSTOP)
    time.sleep(suspended_s)
    woken_s = now_s()
    daemon.send_signal(signal.SIGCONT)
    wait_for("it turns again or is disarmed", lambda: site.turning or site.status()["mode"] == "disarmed")
    turns_s = [t_s - woken_s for t_s, left, right in site.commands(woken_s) if left or right]
    assert not turns_s or turns_s[0] > 0.9

    def causes() -> set[str]:
        return {record["cause"] for record in site.log() if record.get("name") == "health" and "cause" in record}

    # A thread writes the log. The second cause is there if the daemon slept amid a transfer.
    wait_for("the log says why", lambda: causes() & {"resume_warning", "motors_failed"})


def test_ended_daemon_stops_the_wheels_itself_and_writes_how_it_ended(site: Site) -> None:
    daemon = site.armed()
    began_s = now_s()
    daemon.terminate()
    assert daemon.wait(PATIENCE_S) == 0
    took_s = now_s() - began_s
    stopped_s = site.stopped_by_daemon_s()
    print(f"{site.rover}: stopped {stopped_s - began_s:.3f} s after SIGTERM, ended after {took_s:.3f} s")
    assert stopped_s - began_s <= 0.1
    assert took_s < 2.0
    outcome = site.log()[-1]
    assert (outcome["record"], outcome["reason"], outcome["text"]) == ("outcome", "signal", "ended by SIGTERM")


def test_error_in_an_algorithm_ends_the_daemon_with_the_wheels_stopped(site: Site) -> None:
    daemon = site.armed("--algorithm", f"{buggy_algorithms.__name__}:RAISES")
    assert daemon.wait(PATIENCE_S) == 1
    last_tick_s = site.ticks_beyond(0.0)[-1]  # a cycle before the error
    assert site.stopped_by_daemon_s() - last_tick_s <= 0.1
    outcome = site.log()[-1]
    assert (outcome["record"], outcome["reason"]) == ("outcome", "failed")
    assert buggy_algorithms.BUG in outcome["text"]
