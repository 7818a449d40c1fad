"""SIGKILL at random instants of a daemon's life, again and again over the same bench (field catalogue, faults 33, 35).

A killed daemon can do nothing any more. What must hold all the same: the motor board's own deadman stops the wheels
within its period; the next start is disarmed and its wheels stand still; the log of the killed run reads back at least
to its last sync; no two runs share a number.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import signal
import socket
import subprocess
import time
from collections.abc import Iterable, Iterator
from enum import StrEnum
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.system.hil_setup import Site, hil_site, wait_for
from tests.system.log_recovery import (
    ReadBack,
    all_folders,
    cut_off,
    numbered_twice,
    read_back,
)
from tests.system.wheel_history import Commands, told_to_turn
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.writer_thread import WRITE_S, WRITES_A_SYNC

STARTING_S = 1.5  # a daemon speaks about a second after its start
ARMING_S = 1.5  # the checks, and the second in which the heading must be at rest
DRIVING_S = 2.5  # more than two syncs of the log
STOPPING_S = 0.25  # from SIGTERM to the end of the process, about
MARGIN_S = 0.02  # between the two writes of one drive command
BUSY_S = 0.3  # how late a thread may be on a computer that does other things
SYNC_S = WRITE_S * WRITES_A_SYNC
KILLS_A_SITE = 10  # then the other rover


class Life(StrEnum):
    """What a daemon was doing when it was killed."""

    STARTING = "starting"
    ARMING = "arming"
    DRIVING = "driving"
    STOPPING = "stopping"


LIVES = (Life.DRIVING, Life.STARTING, Life.DRIVING, Life.ARMING, Life.STOPPING)
"""What is killed in turn: twice as often what lasts longest."""


class Kill(NamedTuple):
    """What came of one kill; times in seconds, None where there is nothing to time.

    ``silence_s`` is from the last command to the stop, ``stopped_s`` from the death to the stop, where wheels turned.
    ``lost_s`` is from the last control tick that can be read to the death; None without a tick, or with an outcome.
    ``torn`` tells whether the kill cut a line. ``problems`` is empty where all was as it must be.
    """

    rover: str
    life: Life
    silence_s: float | None
    stopped_s: float | None
    lost_s: float | None
    torn: bool
    problems: tuple[str, ...]


class Killer:
    """Starts daemons at a site and kills them; what a kill left behind is judged by the next start as well.

    Args:
        where: its bench goes on from kill to kill.
        rng: draws the instants.
    """

    def __init__(self, where: Site, rng: Random) -> None:
        self._site, self._rng = where, rng
        self._still_since_s = time.monotonic()
        self._problems: list[str] = []
        self._folders: set[Path] = set()

    def kill(self, life: Life) -> Kill:
        """Kill a daemon somewhere in this part of its life.

        Raises:
            HilSetupError: it does not get there.
        """
        self._problems = []
        while (daemon := self._lead(life)).poll() is not None:  # a stop was faster than the kill
            self._forgive(daemon)
        daemon.kill()
        daemon.wait()
        return self._judge(life, time.monotonic())

    def restart(self) -> tuple[str, ...]:
        """Start a daemon, and return what is wrong with how it comes up.

        Raises:
            HilSetupError: it does not.
        """
        self._problems = []
        self._up().terminate()
        return tuple(self._problems)

    # -- leading a daemon to its death -----------------------------------------------------------------------------

    def _lead(self, life: Life) -> subprocess.Popen[bytes]:
        """Return a daemon in this part of its life."""
        self._folders = set(all_folders(self._site.logs))
        if life is Life.STARTING:
            daemon = self._site.launch()
            time.sleep(self._rng.uniform(0.0, STARTING_S))
            return daemon
        daemon = self._up()
        if life is Life.ARMING:
            self._ask_to_arm(self._rng.uniform(0.0, ARMING_S))
            return daemon
        self._site.ask("arm", heading_deg=self._rng.uniform(0.0, 359.0))
        wait_for("the wheels turn", lambda: self._site.turning)
        if life is Life.STOPPING:
            daemon.send_signal(signal.SIGTERM)
        time.sleep(self._rng.uniform(0.0, STOPPING_S if life is Life.STOPPING else DRIVING_S))
        return daemon

    def _up(self) -> subprocess.Popen[bytes]:
        """Return a daemon that is up, and note what is wrong with it."""
        where, expected, there = self._site, cut_off(self._site.logs), set(all_folders(self._site.logs))
        daemon = where.daemon()
        runs = sorted(set(all_folders(where.logs)) - there)
        self._folders |= set(runs[:-1])  # of starts that a busy computer failed: they ended by themselves
        if (mode := where.status()["mode"]) != "disarmed":
            self._problems.append(f"the daemon came up {mode}")
        records = (record for run in runs for record in RunReader(run))
        told = [record["run"] for record in records if record.get("name") == "unclean_shutdown"]
        if told != ([expected] if expected else []):
            self._problems.append(f"the daemon tells of {told} as cut off, but it was {expected}")
        self._note_motion()
        return daemon

    def _ask_to_arm(self, then_wait_s: float) -> None:
        """Ask to arm without waiting for the answer: the daemon dies while it thinks about it."""
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(self._site.socket))
            line.sendall(b'{"do": "arm"}\n')
            time.sleep(then_wait_s)

    def _note_motion(self) -> None:
        if told_to_turn(self._site.commands(self._still_since_s)):
            self._problems.append("wheels turned before anybody asked to arm")

    def _forgive(self, ended: subprocess.Popen[bytes]) -> None:
        """Let go of a daemon that ended by itself; that it must stop its wheels is another row's."""
        ended.wait()
        wait_for("the wheels stand still", lambda: not self._site.turning)
        self._still_since_s = time.monotonic()

    # -- what is left ------------------------------------------------------------------------------------------------

    def _judge(self, life: Life, died_s: float) -> Kill:
        where = self._site
        time.sleep(where.deadman_s + 2 * MARGIN_S)
        if life is Life.STARTING:
            self._note_motion()
        silence_s, stopped_s = after_death(where.commands(), died_s)
        self._still_since_s = time.monotonic()
        found = self._read_back()
        lost_s = None if found.last_tick_s is None or found.ended else died_s - found.last_tick_s
        wrong = {
            f"the wheels were stopped {stopped_s} s after the death": (stopped_s or 0.0) > where.deadman_s + MARGIN_S,
            f"the log ends {lost_s} s before the death": (lost_s or 0.0) > SYNC_S + BUSY_S,
            "the log does not say that the rover was armed": life is Life.DRIVING and not found.armed,
        }
        self._problems += [
            *found.problems,
            *numbered_twice(where.logs),
            *(text for text, holds in wrong.items() if holds),
        ]
        return Kill(where.rover, life, silence_s, stopped_s, lost_s, found.torn, tuple(self._problems))

    def _read_back(self) -> ReadBack:
        """Return what the killed run's log says; a start that was killed early has none."""
        made = set(all_folders(self._site.logs)) - self._folders
        if len(made) > 1:
            self._problems.append(f"one start made {len(made)} folders")
        return read_back(max(made)) if made else ReadBack()


def after_death(commands: Commands, died_s: float) -> tuple[float | None, float | None]:
    """Return how long after the last command, and after the death, wheels that turned were stopped; None for others.

    Infinite where they were not.
    """
    told = [command for command in commands if command[0] <= died_s]
    if not told or not any(told[-1][1:]):
        return None, None
    stop_s = next((t_s for t_s, left, right in commands if t_s > died_s and not (left or right)), float("inf"))
    return stop_s - told[-1][0], stop_s - died_s


def sweep(kills: int, seed: int) -> Iterator[Kill]:
    """Give this many kills, each in a part of its life by turns, the two rovers by turns; then every bench's restart.

    A problem with the restart after the last kill at a bench is told with that kill.
    """
    rng = Random(seed)
    for first in range(0, kills, KILLS_A_SITE):
        numbers = range(first, min(first + KILLS_A_SITE, kills))
        yield from _at_one_site(("forestrover", "minirover")[first // KILLS_A_SITE % 2], numbers, rng)


def _at_one_site(rover: str, numbers: Iterable[int], rng: Random) -> Iterator[Kill]:
    with hil_site(rover) as where:
        killer, last = Killer(where, rng), None
        for number in numbers:
            if last is not None:
                yield last
            last = killer.kill(LIVES[number % len(LIVES)])
        assert last is not None
        yield last._replace(problems=last.problems + killer.restart())
