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
    """How the disk of the logs is mounted, None if this computer does not tell; ``disk_memory``: empty on a disk."""

    disk_read_only: bool | None = None
    disk_memory: str | None = None


def card_health(folder: Path, root: Path = Path("/")) -> CardHealth:
    """Return how the disk of a folder is; the folder need not be there. ``root``: what system files are below."""
    path, health, longest = os.path.realpath(folder), CardHealth(), -1
    for line in (system_text(MOUNTS, root) or "").splitlines():
        mount, _, disk = (part.split() for part in line.partition(" - "))
        point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), mount[4])
        within = path == point or path.startswith(point.rstrip("/") + "/")
        if within and len(point) >= longest:  # of two at one point the later is seen
            options = f"{mount[5]},{disk[-1]}".split(",")
            health, longest = CardHealth("ro" in options, MEMORY.get(disk[0], "")), len(point)
    return health


def card_troubles(health: CardHealth, sync_ms: float = 0.0) -> list[Finding]:
    """Say what is wrong, by kind, the worst first; ``sync_ms``: the longest that it lately took to store records."""
    told = (
        (health.disk_read_only, "read_only", "it is mounted read-only: so /etc/fstab says, or it failed (see dmesg)",
         "mount it for writing; replace a card that mounts itself read-only"),
        (sync_ms > SLOW_SYNC_MS, "slow",
         f"it took {sync_ms / 1000.0:.1f} s to store records: it is worn, or other programs write a lot",
         "see which (iotop), else replace the card"),
        (health.disk_memory, "memory",
         f"the logs are in memory ({health.disk_memory}), lost at power-off: the root is read-only, or it is a tmpfs",
         "log to a partition that is written (docs/how-to/unattended.md)"),
    )  # fmt: skip
    return [warn(kind, text, remedy) for wrong, kind, text, remedy in told if wrong]


async def card(inspection: Inspection) -> Finding:
    """Check whether the card with the logs can be written and keeps them."""
    health = await asyncio.to_thread(card_health, inspection.host.log_folder, inspection.host.root)
    if troubles := card_troubles(health):
        return warn("card", "; ".join(trouble.text for trouble in troubles), troubles[0].remedy)
    if health == CardHealth():
        return skipped("card", "this computer does not tell what the logs are on")
    return ok("card", "it can be written and keeps the logs")
