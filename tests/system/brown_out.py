"""The motor board loses its power for a moment while the rover drives, and then the computer dies: do the wheels stand?

::

    python -m tests.system.brown_out --kills 20

A board that has lost its power has forgotten its deadman. A daemon that drives on, and is killed before it has noticed,
would leave wheels that nothing stops. Each kill takes about three seconds; the exit code is 1 where wheels turned for
longer than the board's deadman allows.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from random import Random
from typing import NamedTuple

from tests.system.hil_setup import DEADMAN_S, HilSetupError, Site, hil_site
from tests.system.wheel_history import stop_after

LATEST_S = 0.5  # from the board's loss of power to the kill: longer than the health poll needs to see it
MARGIN_S = 0.05  # between the two writes of one drive command, on a busy computer


class Kill(NamedTuple):
    """One kill: how long after the board's loss of power it came, and for how long the wheels then turned, at most."""

    rover: str
    after_s: float
    turned_s: float

    @property
    def stands(self) -> bool:
        """Whether the wheels stood within the board's deadman."""
        return self.turned_s <= DEADMAN_S[self.rover] + MARGIN_S


def kills(number: int, seed: int) -> Iterator[Kill]:
    """Interrupt a board's power and kill the daemon, so many times, on both rovers in turn."""
    chance = Random(seed)
    for rover in DEADMAN_S:
        with hil_site(rover) as where:
            for _ in range(number // 2):
                yield _kill(where, chance.uniform(0.0, LATEST_S))


def _kill(where: Site, after_s: float) -> Kill:
    daemon = where.armed()
    where.bench("power_cycle")
    time.sleep(after_s)
    daemon.kill()
    killed_s = time.monotonic()
    daemon.wait()
    try:
        _, stop_s = stop_after(where.stopped())
    except HilSetupError:  # they turn for ever
        return Kill(where.rover, after_s, time.monotonic() - killed_s)
    return Kill(where.rover, after_s, max(0.0, stop_s - killed_s))


def main() -> int:
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.system.brown_out", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    failed = 0
    for kill in kills(options.kills, options.seed):
        failed += not kill.stands
        verdict = "" if kill.stands else "  TOO LONG"
        print(
            f"{kill.rover:<12} killed {kill.after_s:.3f} s later, turned on for {kill.turned_s:.3f} s{verdict}",
            flush=True,
        )
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
