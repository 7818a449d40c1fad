"""All figures beside their limits, as a Markdown table.

With ``daemon`` only those of ``wayfarer run --sim``, with ``log`` only those of the field log; with ``trial``, what a
trial costs in units that hold on any computer; with ``instructions``, how many of them a control tick, ``import
wayfarer.cli`` and a daemon's start take; with ``soak``, whether anything grows in a simulated day full of faults; with
``missions``, in a thousand missions of one daemon; with ``gps``, how near dead reckoning is to the true way, before and
after a report lays it onto the receiver's fixes; with ``detector``, how well each anomaly is noticed, with
``witnesses``, how well each sense notices a stall; with ``yaw``, how often a rover turns towards what stops it;
with ``stuck``, how rovers fail in the clutter.
``guard`` and ``stops`` say whether a change of the code has changed results or stops, ``size`` how much there is to
read, ``mutants`` whether the tests bite.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
from argparse import Namespace
from collections.abc import Callable

from benchmarks import (
    by_hand,
    calibration,
    command,
    daemon,
    detector,
    disk,
    gps,
    missions,
    rover,
    stack,
    stuck,
    witnesses,
    yaw_at_stall,
)
from benchmarks.figures import HEADER, Figure, print_table
from benchmarks.guard import print_guard
from benchmarks.instructions import print_instructions
from benchmarks.mutants import print_mutants
from benchmarks.size import print_size
from benchmarks.soak import print_soak
from benchmarks.stops import print_stops
from wayfarer.cli import version_text
from wayfarer.config.rover_file import load_rover


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("what", nargs="?", choices=WHAT, default="figures")
    parser.add_argument("--quick", action="store_true", help="fewer trials and runs: half a minute")
    parser.add_argument("--hours", type=float, default=24.0, help="of the soak, simulated")
    parser.add_argument("--missions", type=int, default=1000, help="in one daemon")
    parser.add_argument("--idle-s", type=float, default=1.0, help="disarmed after each mission, simulated")
    parser.add_argument(
        "--trials", type=int, help="of each case of the detector (60); drives of the witnesses (30); pairs of the guard"
    )
    parser.add_argument("--rover", default="sim", help="whose detector")
    parser.add_argument("--first-seed", type=int, default=0, help="of the witnesses' drives")
    parser.add_argument("--mujoco", action="store_true", help="measure the detector on grounds of five frictions")
    parser.add_argument("--only", nargs="*", default=(), help="campaigns of the guard")
    parser.add_argument("--accept", action="store_true", help="the guard's new digests, unless a campaign is worse")
    parser.add_argument("--gate", action="store_true", help="compare the instructions with main's; fail at +3 %%")
    parser.add_argument("--python", help="count the instructions of its wayfarer, not of this one's")
    parser.add_argument("--functions", type=int, default=0, help="of a tick, the costliest in instructions")
    asked = parser.parse_args()
    cores = len(os.sched_getaffinity(0))
    print(f"{version_text()}, Python {platform.python_version()}, {cores} cores, {platform.machine()}\n")
    sys.exit(WHAT[asked.what](asked))


def _print_figures(asked: Namespace) -> None:
    print_table(HEADER, [figure.row() for figure in _figures(asked.quick)])


def _print_trial(asked: Namespace) -> None:
    print_table(HEADER, [calibration.trial_cost(runs=3 if asked.quick else 20).row()])


def _print_daemon(asked: Namespace) -> None:
    for_s = 10 if asked.quick else 60
    print_table(HEADER, [figure.row() for figure in (*daemon.figures(for_s), *by_hand.figures(for_s))])


def _print_log(asked: Namespace) -> None:
    print_table(HEADER, [figure.row() for figure in _log(asked.quick)])


def _print_detector(asked: Namespace) -> None:
    header, cases = (
        (detector.MUJOCO_HEADER, detector.MUJOCO_CASES) if asked.mujoco else (detector.HEADER, detector.CASES)
    )
    print_table(header, detector.rows(load_rover(asked.rover), cases, asked.trials or 60))


def _print_witnesses(asked: Namespace) -> None:
    drives = witnesses.rows(load_rover(asked.rover), asked.trials or 30, asked.first_seed)
    print_table(witnesses.HEADER, list(drives))


def _figures(quick: bool) -> list[Figure]:
    return [
        *(command.campaigns(trials=50, runs=1) if quick else command.campaigns(trials=1000, runs=3)),
        calibration.trial_cost(runs=3 if quick else 20),
        stack.ticks(trials=20 if quick else 200),
        *stack.set_up(trials=50 if quick else 200),
        command.version(runs=7),
        *stack.wake_ups(runs=3 if quick else 7),
        *rover.depths(trials=5 if quick else 50),
        *rover.hanging_bus(runs=1 if quick else 5),
        *daemon.figures(for_s=10 if quick else 60),
        *by_hand.figures(for_s=10 if quick else 60),
        *_log(quick),
    ]


def _log(quick: bool) -> list[Figure]:
    runs = 1 if quick else 5
    return [*disk.costs(runs), *disk.jitter(runs, for_s=2.0)]


WHAT: dict[str, Callable[[Namespace], int | None]] = {
    "figures": _print_figures,
    "trial": _print_trial,
    "instructions": lambda asked: print_instructions(asked.python, gate=asked.gate, functions=asked.functions),
    "daemon": _print_daemon,
    "log": _print_log,
    "soak": lambda asked: print_soak(asked.hours),
    "missions": lambda asked: missions.print_missions(asked.missions, asked.idle_s),
    "gps": lambda asked: print_table(gps.HEADER, gps.rows(trials=1 if asked.quick else 5)),
    "detector": _print_detector,
    "witnesses": _print_witnesses,
    "stuck": lambda asked: print_table(stuck.HEADER, stuck.rows(asked.trials or 100)),
    "yaw": lambda asked: print_table(yaw_at_stall.HEADER, yaw_at_stall.rows(asked.trials or 6)),
    "guard": lambda asked: print_guard(asked.only, asked.trials, accept=asked.accept),
    "stops": lambda _: print_stops(),
    "size": lambda _: print_size(),
    "mutants": lambda _: print_mutants(),
}

if __name__ == "__main__":
    main()
