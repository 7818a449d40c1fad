"""What is measured at a site: what its wheels were told, what a log still says, how evenly the loop ticks."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from math import inf
from pathlib import Path
from statistics import median, quantiles
from time import CLOCK_BOOTTIME, clock_gettime
from typing import NamedTuple, TypeAlias

from tests.kit.logs import keys_of
from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import run_number
from wayfarer.fieldlog.reader import RunReader

PERIOD_S = 0.05  # of the shipped rovers

Commands: TypeAlias = list[tuple[float, float, float]]
"""Each is (time that it is true from, left duty, right duty)."""


def now_s() -> float:
    """Return the time on the clock of daemon and bench: seconds since the start of the computer, asleep or not."""
    return clock_gettime(CLOCK_BOOTTIME)


# -- wheels ------------------------------------------------------------------------------------------------------------


def stop_after(commands: Commands) -> tuple[float, float]:
    """Return when wheels that are stopped now were last told to turn, and when they were told to stand for good.

    Raises:
        ValueError: they were never told to turn.
    """
    last = max(index for index, (_, left, right) in enumerate(commands) if left or right)
    stop_s = next(t_s for t_s, left, right in commands[last:] if not (left or right))
    return commands[last][0], stop_s


def spans(commands: Commands) -> list[tuple[float, float]]:
    """Return from when to when any wheel was told to turn; a span that has not ended ends in infinity."""
    found: list[tuple[float, float]] = []
    start_s: float | None = None
    for t_s, left, right in commands:
        if (left or right) and start_s is None:
            start_s = t_s
        elif not (left or right) and start_s is not None:
            found.append((start_s, t_s))
            start_s = None
    return found if start_s is None else [*found, (start_s, inf)]


def told_to_turn(commands: Commands) -> bool:
    """Return whether any wheel was told to turn."""
    return any(left or right for _, left, right in commands)


def first_stop(commands: Commands, after_s: float) -> tuple[float, float]:
    """Return when wheels were last told to turn before they were first stopped after a time, and when that was.

    Raises:
        ValueError: they did not turn before, or were not stopped.
    """
    stop_s = min((t_s for t_s, left, right in commands if t_s > after_s and not (left or right)))
    return max(t_s for t_s, left, right in commands if t_s < stop_s and (left or right)), stop_s


def after_death(commands: Commands, died_s: float) -> tuple[float | None, float | None]:
    """Return how long after the last command, and after the death, wheels that turned were stopped; None for others.

    Infinite if they were not.
    """
    told = [command for command in commands if command[0] <= died_s]
    if not told or not any(told[-1][1:]):
        return None, None
    stop_s = next((t_s for t_s, left, right in commands if t_s > died_s and not (left or right)), inf)
    return stop_s - told[-1][0], stop_s - died_s


# -- logs --------------------------------------------------------------------------------------------------------------


class ReadBack(NamedTuple):
    """What can be read of a log.

    ``last_tick_s`` is the time of its last control tick, None if there is none; ``armed`` and ``ended`` whether it
    tells of arming and of an outcome; ``torn`` whether a line of it is cut.
    """

    last_tick_s: float | None = None
    armed: bool = False
    ended: bool = False
    torn: bool = False


def read_back(run: Path) -> ReadBack:
    """Read the log of a run that was killed; but for its last line it is whole, and no record is missing."""
    try:
        reader = RunReader(run)
    except BadInput:  # killed between the folder and its file
        return ReadBack()
    records = [keys_of(record) for record in reader]
    damage = reader.damage
    assert damage.lines == damage.torn <= 1, damage
    assert damage.unreadable == damage.missing == 0, damage
    ticks = [record["t_s"] for record in records if record["record"] == "tick"]
    return ReadBack(
        ticks[-1] if ticks else None,
        any(record.get("name") == "armed" for record in records),
        any(record["record"] == "outcome" for record in records),
        bool(damage.torn),
    )


def numbered_twice(logs: Path) -> list[str]:
    """Return what runs share a number."""
    numbers = Counter(run_number(folder) for folder in all_folders(logs))
    return [f"{count} runs have the number {number}" for number, count in numbers.items() if count > 1]


def all_folders(logs: Path) -> list[Path]:
    """Return the folders of all runs; unlike ``run_folders`` also those in which no log was begun."""
    return sorted(path for path in logs.iterdir() if path.is_dir()) if logs.exists() else []


def cut_off(logs: Path) -> str | None:
    """Return the name of the run whose mission has no end in the file of the last mission."""
    try:
        told = json.loads((logs / ".last_mission.json").read_bytes())
    except FileNotFoundError:
        return None
    return str(told["run"]) if told["mission_ended"] is None else None


# -- ticks -------------------------------------------------------------------------------------------------------------


class Jitter(NamedTuple):
    """How far the time between two ticks is from the period: median, 95th percentile and worst, in seconds."""

    median_s: float
    p95_s: float
    worst_s: float

    def __str__(self) -> str:
        return f"{1e3 * self.median_s:.1f} / {1e3 * self.p95_s:.1f} / {1e3 * self.worst_s:.1f} ms"


def jitter(times_s: Sequence[float], from_s: float, to_s: float) -> Jitter:
    """Return the jitter of the ticks in a span of time.

    Raises:
        ValueError: there are hardly any.
    """
    there = [t_s for t_s in times_s if from_s <= t_s <= to_s]
    if len(there) < 0.5 * (to_s - from_s) / PERIOD_S:
        raise ValueError(f"only {len(there)} ticks in {to_s - from_s:.1f} s")
    off = [abs(later - earlier - PERIOD_S) for earlier, later in pairwise(there)]
    return Jitter(median(off), quantiles(off, n=20)[-1], max(off))
