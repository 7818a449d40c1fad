"""A daemon that is ended, killed, suspended, or loses its power."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import signal
import time
from random import Random
from subprocess import Popen

from wayfarer.fault_scenarios.process_tests.hil_setup import PATIENCE_S, HilSetup, site, wait_for
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.process_tests.sigkill import LIVES, Killer
from wayfarer.fault_scenarios.process_tests.wheel_history import stop_after, told_to_turn
from wayfarer.fault_scenarios.scenario import Reached

MARGIN_S = 0.02  # between the two writes of one drive command
SUSPENDED_S = 1.0
WAKING_S = 0.3  # in which a woken daemon must have ticked


@procedure(
    "brown-out", 33, "the power fails for a moment: computer and motor board start anew",
    asked="comes up DISARMED; previous log readable; event unclean_shutdown", expected=Reached.DEADMAN, within_s=0.3,
    remark="the computer's own restart is played by starting the daemon again",
)  # fmt: skip
def brown_out(found: Observed) -> None:
    """Kill the daemon and interrupt the board's power; the next daemon must find both out."""
    with site() as where:
        where.armed().kill()
        killed_s = where.bench("power_cycle")["t_s"]
        _, stop_s = stop_after(where.stopped())
        found.stopped_s = max(0.0, stop_s - killed_s)
        found.demand(where.bench("look")["deadman_armed"] == [False], "the board kept its deadman over the loss")
        cut_off = max(where.logs.iterdir()).name
        where.daemon()
        event = where.told("unclean_shutdown")
        found.changed, found.cause, found.reached = f"run {event['run']} has no outcome", event["name"], Reached.DEADMAN
        found.demand(event["run"] == cut_off and event["last_t_s"] is not None, f"{cut_off} was cut off: {event}")
        found.demand(where.status()["mode"] == "disarmed", "it came up armed")
        found.demand(not told_to_turn(where.commands(stop_s)), "wheels turned before anybody asked to arm")
        where.ask("arm", heading_deg=0.0)
        found.demand(wait_for("the wheels turn", lambda: where.drives), "it does not drive again")
        found.demand(where.bench("look")["deadman_armed"] == [True], "it drives without a deadman")


@procedure(
    "sigterm", 34, "the service is stopped while the rover drives",
    asked="motors 0 first, then log close; 0.1 s, exit < 2 s", expected=Reached.FAULT, within_s=0.1,
)  # fmt: skip
def sigterm(found: Observed) -> None:
    """End the daemon as systemd does."""
    with site() as where:
        daemon = where.armed()
        began_s = time.monotonic()
        daemon.terminate()
        found.demand(daemon.wait(PATIENCE_S) == 0, f"exit code {daemon.returncode}")
        took_s = time.monotonic() - began_s
        found.demand(took_s < 2.0, f"it took {took_s:.2f} s to end")
        turned_s, stop_s = stop_after(where.stopped())
        found.stopped_s = max(0.0, stop_s - began_s)
        found.demand(stop_s - turned_s < where.deadman_s - MARGIN_S, "it was the deadman that stopped the wheels")
        outcome = where.log()[-1]
        found.demand(outcome["record"] == "outcome", "the log has no outcome")
        found.changed, found.cause = "the signal", outcome.get("reason", "")
        found.reached = Reached.FAULT if found.cause == "signal" else Reached.NONE
        found.remark = f"ended after {took_s:.2f} s"


@procedure(
    "sigkill", 35, "the daemon is killed: driving, starting, arming, stopping",
    asked="S4 stops; next start repairs log, disarmed", expected=Reached.DEADMAN, within_s=0.3 + MARGIN_S,
    remark="python -m tests.system.sigkill --kills 200 does it at as many random instants",
)  # fmt: skip
def sigkill(found: Observed) -> None:
    """Kill a daemon once in each part of its life."""
    with site() as where:
        killer = Killer(where, Random(35))
        kills = [killer.kill(life) for life in LIVES]
        found.problems += [f"{kill.life}: {problem}" for kill in kills for problem in kill.problems]
        found.problems += killer.restart()
        stops = [kill.stopped_s for kill in kills if kill.stopped_s is not None]
        found.stopped_s = max(stops)
        lost = [kill.lost_s for kill in kills if kill.lost_s is not None]
        found.changed = f"{len(kills)} deaths, {len(stops)} of them with turning wheels"
        found.reached, found.cause = Reached.DEADMAN, "the board's own timeout"
        found.remark = f"the logs end at most {max(lost, default=0.0):.2f} s before the death"


@procedure(
    "sigstop", 36, "the daemon is suspended, or the computer swaps",
    asked="S4 stops; systemd watchdog SIGABRT + restart; 0.25 s motors", expected=Reached.DEADMAN,
    within_s=0.25 + MARGIN_S, remark="the watchdog's part: tests/system/test_systemd.py",
)  # fmt: skip
def sigstop(found: Observed) -> None:
    """Suspend the daemon; when it is woken it must hold, and disarm in order."""
    with site("minirover") as where:
        daemon = where.armed()
        suspended_s = time.monotonic()
        daemon.send_signal(signal.SIGSTOP)
        turned_s, stop_s = stop_after(where.stopped())
        found.stopped_s = stop_s - suspended_s
        found.reached = Reached.DEADMAN if abs(stop_s - turned_s - where.deadman_s) <= MARGIN_S else Reached.NONE
        found.changed = f"nothing was told to the board for {stop_s - turned_s:.2f} s"
        _wake(where, daemon, found)


@procedure(
    "suspend", 46, "the computer sleeps for a second: time jumps",
    asked="treat as loop stall: zero, re-check; 1 cycle", expected=Reached.HOLD, within_s=0.15,
    remark="a tick that the sleep cut in two is finished first, so two cycles and the time to wake up are allowed",
)  # fmt: skip
def suspend(found: Observed) -> None:
    """Suspend the daemon for a while and look at its first ticks afterwards."""
    with site() as where:
        daemon = where.armed()
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(SUSPENDED_S)
        found.changed = f"{SUSPENDED_S:g} s are missing between two ticks"
        _wake(where, daemon, found)


def _wake(where: HilSetup, daemon: Popen[bytes], found: Observed) -> None:
    """Wake a suspended daemon, and see that it holds before it does anything else."""
    woken_s = time.monotonic()
    daemon.send_signal(signal.SIGCONT)
    where.ticks_beyond(woken_s + WAKING_S)
    after = [record for record in where.log() if record["record"] == "tick" and record["t_s"] >= woken_s]
    held = next((tick for tick in after if tick["level"] in {"hold", "fault"}), None)
    found.demand(held in after[:2], "it did not hold within two ticks")
    if held is not None:
        found.cause = str(held["cause"])
        if found.reached is Reached.NONE:
            found.reached, found.detected_s = Reached.HOLD, held["t_s"] - woken_s
