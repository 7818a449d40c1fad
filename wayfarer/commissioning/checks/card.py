"""The card or disk that the logs are on: how worn it is, what went wrong on it, and whether it keeps anything.

eMMC memory says how worn it is; SD cards mostly say nothing. There the file system's own errors and slow writes are the
only signs.
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
MEMORY = ("tmpfs", "ramfs")
MEMORY_DISKS = ("zram", "ram")
# JEDEC JESD84-B51, EXT_CSD 267 to 269, which Linux shows as pre_eol_info and life_time: 1 is normal, 2 is 80 % of the
# spare blocks gone, 3 is urgent; wear in steps of 10 %, 0x0b is beyond its life. 0 is not defined.
SPARE_LOW = 2
WORN_PERCENT = 90
SLOW_SYNC_MS = 2000.0  # a card pauses for up to 500 ms (field.md 3); one that works is not four times as slow


class CardHealth(NamedTuple):
    """How the disk of the logs is; None for what it does not tell.

    ``disk_memory`` is what keeps the logs in memory only, empty where a disk keeps them; ``disk_errors`` counts what
    went wrong in the file system since it was last repaired; ``disk_worn_percent`` is how much of its life is used at
    most, over 100 beyond it; ``disk_spare_low``: its spare blocks are nearly used up.
    """

    disk_read_only: bool | None = None
    disk_memory: str | None = None
    disk_errors: int | None = None
    disk_worn_percent: int | None = None
    disk_spare_low: bool | None = None


class CardTrouble(NamedTuple):
    """Something that is wrong with a card, by its kind, with what to do."""

    kind: str
    found: str
    cause: str
    remedy: str


class _Mount(NamedTuple):
    point: str
    device: str
    kind: str
    options: str


def card_health(folder: Path, root: Path = Path("/")) -> CardHealth:
    """Return how the disk of a folder is; the folder need not be there.

    Args:
        folder: where runs are logged.
        root: what system files are looked up under; another one in a test.
    """
    mount = _mount_of(os.path.realpath(folder), root)
    memory = None if mount is None else ""
    if mount is not None and mount.kind == "overlay":
        upper = dict(option.partition("=")[::2] for option in mount.options.split(",")).get("upperdir", "")
        seen = bool(upper) and os.access(root / upper.lstrip("/"), os.F_OK)  # no error where a folder is closed to us
        mount = _mount_of(upper, root) if seen else None
        memory = "" if seen else "an overlay whose upper layer cannot be seen"
    device = None if mount is None else _device(mount, root)
    if mount is not None and mount.kind in MEMORY:
        memory = mount.kind
    elif device is not None and device.name.startswith(MEMORY_DISKS):
        memory = device.name
    return CardHealth(_is_read_only(folder.absolute()), memory, *(_signs(device, root) if device is not None else ()))


def card_troubles(health: CardHealth, sync_ms: float | None = None) -> list[CardTrouble]:
    """Say what is wrong with a card, the worst first; ``sync_ms``: the longest that it lately took to store records."""
    read_only, memory, errors, worn_percent, spare_low = health
    replace = "copy the logs and replace the card"
    told = [
        (read_only, "read_only", "it is mounted read-only", "so /etc/fstab says, or it failed (see dmesg)",
         "mount it for writing; replace a card that mounts itself read-only"),
        (errors, "errors", f"its file system has counted {errors} errors", "it was pulled out or cut off, or it fails",
         "copy the logs, reboot with fsck.mode=force, and replace the card if there are more errors after that"),
        ((worn_percent or 0) >= WORN_PERCENT, "worn", f"{worn_percent} % of its life is used", "writing wears it out",
         replace),
        (spare_low, "spare", "its spare blocks are nearly used up", "writing wears it out", replace),
        ((sync_ms or 0.0) > SLOW_SYNC_MS, "slow", f"it took {(sync_ms or 0.0) / 1000.0:.1f} s to store records",
         "it is worn, or other programs write a lot", "see which (iotop), else replace the card"),
        (memory, "memory", f"the logs are in memory ({memory}), lost at power-off",
         "a read-only root with an overlay, or a tmpfs",
         "log to a partition that is written (docs/how-to/unattended.md)"),
    ]  # fmt: skip
    return [CardTrouble(kind, found, cause, remedy) for wrong, kind, found, cause, remedy in told if wrong]


async def card(inspection: Inspection) -> Finding:
    """Check whether the card with the logs keeps them, and how worn it is."""
    health = await asyncio.to_thread(card_health, inspection.host.log_folder, inspection.host.root)
    troubles = card_troubles(health)
    if troubles:
        found = "; ".join(trouble.found for trouble in troubles)
        return warn("card", found, troubles[0].cause, troubles[0].remedy)
    told = {
        "life used at most {} %": health.disk_worn_percent,
        "{} errors of the file system": health.disk_errors,
    }
    if all(value is None for value in told.values()):
        return skipped("card", "it does not tell how it is")
    return ok("card", ", ".join(text.format(value) for text, value in told.items() if value is not None))


def _is_read_only(folder: Path) -> bool | None:
    try:
        there = next(path for path in (folder, *folder.parents) if path.exists())
        return bool(os.statvfs(there).f_flag & os.ST_RDONLY)
    except OSError:
        return None


def _mount_of(path: str, root: Path) -> _Mount | None:
    """Return what is mounted at a path, whatever lies below it; None where the system does not tell."""
    best = None
    for line in (system_text(MOUNTS, root) or "").splitlines():
        place, _, what = line.partition(" - ")
        fields, kinds = place.split(" "), what.split(" ")
        point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), fields[4])
        within = path == point or path.startswith(point.rstrip("/") + "/")
        if within and (best is None or len(point) >= len(best.point)):  # of two at one point the later is seen
            best = _Mount(point, fields[2], kinds[0], kinds[-1])
    return best


def _device(mount: _Mount, root: Path) -> Path | None:
    """Return the folder of a mounted partition in /sys, None where it is on no block device."""
    try:
        device = (root / "sys/dev/block" / mount.device).resolve(strict=True)
    except OSError:
        return None
    return device


def _signs(partition: Path, root: Path) -> tuple[int | None, int | None, bool | None]:
    disk = partition.parent if (partition / "partition").exists() else partition
    errors = _numbers(root / "sys/fs/ext4" / partition.name / "errors_count")
    life, spare = _numbers(disk / "device/life_time"), _numbers(disk / "device/pre_eol_info")
    worn = max(life, default=0)
    return errors[0] if errors else None, 10 * worn if worn else None, max(spare) >= SPARE_LOW if spare else None


def _numbers(path: Path) -> list[int]:
    """Return the numbers in a file of the kernel, none where it has none."""
    try:
        return [int(word, 0) for word in path.read_text(encoding="ascii").split()]
    except (OSError, ValueError):
        return []
