"""The card or disk that the logs are on: whether it can be written, and whether it keeps anything.

SD cards do not say how worn they are. What shows it is slow writing, which the log's writer measures, and a file system
that the kernel has made read-only after an error.
"""

from __future__ import annotations

import asyncio
import os
import re
from pathlib import Path
from typing import NamedTuple

from wayfarer.commissioning.checks.api import Finding, Inspection, ok, skipped, warn
from wayfarer.commissioning.checks.system import system_text

MOUNTS = "/proc/self/mountinfo"  # man 5 proc
# What a person reads of each: the upper layer of an overlay is nearly always a tmpfs.
MEMORY = {"tmpfs": "tmpfs", "ramfs": "ramfs", "overlay": "an overlay, as it seems"}
# A card pauses for up to 500 ms (docs/reference/hardware.md); one that works is not four times as slow.
SLOW_SYNC_MS = 2000.0


class CardHealth(NamedTuple):
    """How the disk of the logs is; None for what it does not tell.

    ``disk_memory`` is what keeps the logs in memory only, as far as the mounts tell; empty if a disk keeps them.
    """

    disk_read_only: bool | None = None
    disk_memory: str | None = None


class CardTrouble(NamedTuple):
    """Something that is wrong with a card, by its kind, with what to do."""

    kind: str
    found: str
    cause: str
    remedy: str


def card_health(folder: Path, root: Path = Path("/")) -> CardHealth:
    """Return how the disk of a folder is; the folder need not be there.

    Args:
        folder: where runs are logged.
        root: what system files are looked up under; another one in a test.
    """
    kind = _file_system(os.path.realpath(folder), root)
    return CardHealth(_is_read_only(folder.absolute()), None if kind is None else MEMORY.get(kind, ""))


def card_troubles(health: CardHealth, sync_ms: float | None = None) -> list[CardTrouble]:
    """Say what is wrong with a card, the worst first; ``sync_ms``: the longest that it lately took to store records."""
    read_only, memory = health
    told = [
        (read_only, "read_only", "it is mounted read-only", "so /etc/fstab says, or it failed (see dmesg)",
         "mount it for writing; replace a card that mounts itself read-only"),
        ((sync_ms or 0.0) > SLOW_SYNC_MS, "slow", f"it took {(sync_ms or 0.0) / 1000.0:.1f} s to store records",
         "it is worn, or other programs write a lot", "see which (iotop), else replace the card"),
        (memory, "memory", f"the logs are in memory ({memory}), lost at power-off",
         "a read-only root with an overlay, or a tmpfs",
         "log to a partition that is written (docs/how-to/unattended.md)"),
    ]  # fmt: skip
    return [CardTrouble(kind, found, cause, remedy) for wrong, kind, found, cause, remedy in told if wrong]


async def card(inspection: Inspection) -> Finding:
    """Check whether the card with the logs can be written and keeps them."""
    health = await asyncio.to_thread(card_health, inspection.host.log_folder, inspection.host.root)
    if troubles := card_troubles(health):
        found = "; ".join(trouble.found for trouble in troubles)
        return warn("card", found, troubles[0].cause, troubles[0].remedy)
    if health.disk_memory is None:
        return skipped("card", "this computer does not tell what the logs are on")
    return ok("card", "it can be written and keeps the logs")


def _is_read_only(folder: Path) -> bool | None:
    try:
        there = next(path for path in (folder, *folder.parents) if path.exists())
        return bool(os.statvfs(there).f_flag & os.ST_RDONLY)
    except OSError:
        return None


def _file_system(path: str, root: Path) -> str | None:
    """Return which file system is mounted at a path, whatever lies below it; None if this computer does not tell."""
    best, longest = None, -1
    for line in (system_text(MOUNTS, root) or "").splitlines():
        place, _, what = line.partition(" - ")
        point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), place.split(" ")[4])
        within = path == point or path.startswith(point.rstrip("/") + "/")
        if within and len(point) >= longest:  # of two at one point the later is seen
            best, longest = what.split(" ")[0], len(point)
    return best
