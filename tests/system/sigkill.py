"""SIGKILL of the real daemon at many random instants, and a table of what came of it.

::

    python -m tests.system.sigkill --kills 200

Each kill takes about three seconds; the exit code is 1 where anything was not as it must be.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from statistics import median

from tests.system.hil_setup import HilSetupError
from tests.system.killer import Kill, Life, sweep

COLUMNS = "{:<22}{:>6}{:>9}{:>24}{:>24}{:>20}{:>6}{:>10}"
LAST = ("torn", "problems")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.system.sigkill", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    kills: list[Kill] = []
    try:
        for kill in sweep(options.kills, options.seed):
            kills.append(kill)
            print(f"{len(kills)}/{options.kills}", *kill, sep="  ", file=sys.stderr, flush=True)
    except HilSetupError as trouble:
        print(f"broken off: {trouble}", file=sys.stderr)
    print(table(kills))
    return int(len(kills) < options.kills or any(kill.problems for kill in kills))


def table(kills: list[Kill]) -> str:
    lines = [
        COLUMNS.format("killed while", "kills", "turning", "silence to stop s", "death to stop s", "log lost s", *LAST),
        COLUMNS.format("", "", "", "min / median / max", "min / median / max", "median / max", "", ""),
    ]
    for rover in sorted({kill.rover for kill in kills}):
        for life in Life:
            lines.append(row(f"{rover} {life}", [kill for kill in kills if (kill.rover, kill.life) == (rover, life)]))
    return "\n".join([*lines, row("all", kills)])


def row(name: str, kills: list[Kill]) -> str:
    silence, stopped = ([getattr(kill, field) for kill in kills] for field in ("silence_s", "stopped_s"))
    return COLUMNS.format(
        name,
        len(kills),
        sum(each is not None for each in silence),
        told(silence, (min, median, max)),
        told(stopped, (min, median, max)),
        told([kill.lost_s for kill in kills], (median, max)),
        sum(kill.torn for kill in kills),
        sum(bool(kill.problems) for kill in kills),
    )


def told(values: Iterable[float | None], statistics: Iterable[Callable[[list[float]], float]]) -> str:
    there = [value for value in values if value is not None]
    return " / ".join(f"{statistic(there):.3f}" for statistic in statistics) if there else "-"


if __name__ == "__main__":
    sys.exit(main())
