"""SIGKILL at random instants of a daemon's life, again and again over the same bench (fault catalogue, faults 33, 35).

A killed daemon can do nothing any more. What must hold all the same: the motor board's own deadman stops the wheels
within its period; the next start is disarmed and its wheels stay stopped; the log of the killed run reads back at least
to its last sync; no two runs share a number. More often:
``KILLS=200 pytest -n 0 -m long -s tests/system/test_sigkill.py``.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from enum import StrEnum
from pathlib import Path
from random import Random

import pytest

from tests.kit.logs import read_log
from tests.system.hil_setup import DEADMAN_S, MARGIN_S, Site, wait_for
from tests.system.measures import (
    ReadBack,
    after_death,
    all_folders,
    cut_off,
    now_s,
    numbered_twice,
    read_back,
    told_to_turn,
)
from wayfarer.fieldlog.sink import WRITE_S, WRITES_A_SYNC

KILLS = int(os.environ.get("KILLS", "12"))  # half of them on each rover; each takes about three seconds
STARTING_S = 1.5  # a daemon speaks about a second after its start
ARMING_S = 1.5  # the checks, and the second in which the heading must be at rest
DRIVING_S = 2.5  # more than two syncs of the log
STOPPING_S = 0.25  # from SIGTERM to the end of the process, about
BUSY_S = 0.3  # how late a thread may be on a computer that does other things
SYNC_S = WRITE_S * WRITES_A_SYNC


class Life(StrEnum):
    """What a daemon was doing when it was killed."""

    STARTING = "starting"
    ARMING = "arming"
    DRIVING = "driving"
    STOPPING = "stopping"


LIVES = (Life.DRIVING, Life.STARTING, Life.DRIVING, Life.ARMING, Life.STOPPING)
"""What is killed in turn: twice as often what lasts longest."""


class Killer:
    """Starts daemons at a site and kills them; what a kill left behind is asserted, at the next start as well.

    Args:
        where: its bench goes on from kill to kill.
        rng: draws the instants.
    """

    def __init__(self, where: Site, rng: Random) -> None:
        self._site, self._rng = where, rng
        self._still_since_s = now_s()
        self._folders: set[Path] = set()

    def kill(self, life: Life) -> bool:
        """Kill a daemon somewhere in this part of its life; return whether its wheels turned then.

        Raises:
            HilSetupError: it does not get there.
        """
        while (daemon := self._lead(life)).poll() is not None:  # a stop was faster than the kill
            self._forgive(daemon)
        daemon.kill()
        daemon.wait()
        return self._judge(life, now_s())

    # -- leading a daemon to its death -----------------------------------------------------------------------------

    def _lead(self, life: Life) -> subprocess.Popen[bytes]:
        """Return a daemon in this part of its life."""
        self._folders = set(all_folders(self._site.logs))
        if life is Life.STARTING:
            daemon = self._site.launch()
            time.sleep(self._rng.uniform(0.0, STARTING_S))
            return daemon
        daemon = self.up()
        if life is Life.ARMING:
            self._ask_to_arm(self._rng.uniform(0.0, ARMING_S))
            return daemon
        self._site.ask("arm", heading_deg=self._rng.uniform(0.0, 359.0))
        wait_for("the wheels turn", lambda: self._site.turning)
        if life is Life.STOPPING:
            daemon.send_signal(signal.SIGTERM)
        time.sleep(self._rng.uniform(0.0, STOPPING_S if life is Life.STOPPING else DRIVING_S))
        return daemon

    def up(self) -> subprocess.Popen[bytes]:
        """Return a daemon that has come up as it should.

        Raises:
            HilSetupError: it does not.
        """
        where, expected, there = self._site, cut_off(self._site.logs), set(all_folders(self._site.logs))
        daemon = where.daemon()
        runs = sorted(set(all_folders(where.logs)) - there)
        self._folders |= set(runs[:-1])  # of starts that a busy computer failed: they ended by themselves
        assert where.status()["mode"] == "disarmed"
        records = (record for run in runs for record in read_log(run))
        told = [record["last_run"] for record in records if record.get("name") == "unclean_shutdown"]
        assert told == ([expected] if expected else []), "the mission that was cut off"
        self._assert_still()
        return daemon

    def _ask_to_arm(self, then_wait_s: float) -> None:
        """Ask to arm without waiting for the answer: the daemon dies while it thinks about it."""
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(self._site.socket))
            line.sendall(b'{"do": "arm", "asked_s": %f}\n' % now_s())
            time.sleep(then_wait_s)

    def _assert_still(self) -> None:
        assert not told_to_turn(self._site.commands(self._still_since_s)), "wheels turned before anybody asked to arm"

    def _forgive(self, ended: subprocess.Popen[bytes]) -> None:
        """Let go of a daemon that ended by itself; that it must stop its wheels is another row's."""
        ended.wait()
        wait_for("the wheels stay stopped", lambda: not self._site.turning)
        self._still_since_s = now_s()

    # -- what is left ------------------------------------------------------------------------------------------------

    def _judge(self, life: Life, died_s: float) -> bool:
        where = self._site
        time.sleep(where.deadman_s + 2 * MARGIN_S)
        if life is Life.STARTING:
            self._assert_still()
        silence_s, stopped_s = after_death(where.commands(), died_s)
        self._still_since_s = now_s()
        found = self._read_back()
        lost_s = None if found.last_tick_s is None or found.ended else died_s - found.last_tick_s
        print(f"{where.rover}, {life}: stop after {stopped_s} s, {silence_s} s of silence; {lost_s} s of log lost")
        assert (stopped_s or 0.0) <= where.deadman_s + MARGIN_S
        assert (lost_s or 0.0) <= SYNC_S + BUSY_S
        assert found.armed or life is not Life.DRIVING, "the log does not say that the rover was armed"
        assert numbered_twice(where.logs) == []
        return stopped_s is not None

    def _read_back(self) -> ReadBack:
        """Return what the killed run's log says; a start that was killed early has none."""
        made = set(all_folders(self._site.logs)) - self._folders
        assert len(made) <= 1, "one start made several folders"
        return read_back(max(made)) if made else ReadBack()


@pytest.mark.long
@pytest.mark.parametrize("site", sorted(DEADMAN_S), indirect=True)
def test_every_kill_leaves_standing_wheels_and_a_whole_log(site: Site) -> None:
    killer = Killer(site, Random(12))
    turned = [killer.kill(LIVES[number % len(LIVES)]) for number in range(KILLS // 2)]
    killer.up()
    assert sum(turned) >= len(turned) // 3, "most of those that were killed while they drove"
