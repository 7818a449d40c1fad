"""What the log of a killed run still says, and which run was cut off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import FILE_NAME, run_folders, run_number
from wayfarer.fieldlog.reader import RunReader

OUTCOME = b'"record":"outcome"'


class ReadBack(NamedTuple):
    """What can be read of a log.

    ``last_tick_s`` is the time of its last control tick, None where there is none; ``armed`` and ``ended`` whether it
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
    records = list(reader)
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
    return sorted(logs.iterdir()) if logs.exists() else []


def cut_off(logs: Path) -> str | None:
    """Return the name of the newest run if it has no outcome; found by other means than the daemon's own."""
    runs = run_folders(logs)
    if not runs or _says_outcome(runs[-1].glob(FILE_NAME)):
        return None
    return runs[-1].name


def _says_outcome(parts: Iterable[Path]) -> bool:
    return any(OUTCOME in part.read_bytes() for part in parts)
