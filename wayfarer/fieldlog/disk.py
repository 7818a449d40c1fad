"""The disk of a log: its free space, and its trouble, told to the person once with advice and once when it is over."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path

MB = 1_000_000  # bytes
DRIVES_ON = "; the rover drives on"  # ends what is told of trouble while a run goes on
ADVICE = {
    errno.ENOSPC: "delete old runs",
    errno.EDQUOT: "delete old runs, or ask for a larger quota",
    errno.EROFS: "mount the disk for writing; a card that mounts itself read-only is wearing out (see dmesg)",
    errno.EIO: "the card or disk is failing (see dmesg): save what is on it and replace it",
    errno.ENOTDIR: "a file stands where the folder should be",
    errno.ENOENT: "was it deleted, or is the disk not there?",
    errno.ESTALE: "a new one is begun; copy it before you edit it",
    errno.EEXIST: "log into a separate folder",
    errno.EFBIG: "the disk allows no file of this size: set a smaller part_mb",
}
# What a disk does to anybody, as opposed to a folder that was named wrongly or that another user may write only.
DISK_FAILS = frozenset({errno.EROFS, errno.EIO, errno.ENOSPC, errno.EDQUOT})


def free_mb(folder: Path) -> float:
    """Return how much may still be written to the disk of a folder.

    Raises:
        OSError: there is no such folder, or its disk does not answer.
    """
    return shutil.disk_usage(folder).free / MB


def total_mb(folder: Path) -> float:
    """Return the size of the disk of a folder; errors as ``free_mb``."""
    return shutil.disk_usage(folder).total / MB


def error_advice(error: OSError) -> str:
    """Return what went wrong and what a person can do about it."""
    if error.errno in {errno.EACCES, errno.EPERM}:
        return f"{error.strerror}: user {os.geteuid()} needs the right to write there; or choose another --log-dir"
    advice = ADVICE.get(error.errno or 0, "look at the disk (df, dmesg)")
    return f"{error.strerror}: {advice}"


class DiskTrouble:
    """What is wrong at present, by who found it; each text is told once, until all is well again.

    Args:
        tell: takes a line for the person; must not wait.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._told: set[str] = set()
        self._present: dict[str, str] = {}
        self._dropped_before = 0

    @property
    def now(self) -> str | None:
        """What the trouble is at present, None if there is none; from any thread."""
        texts = list(self._present.values())
        return texts[0].removesuffix(DRIVES_ON) if texts else None

    def begins(self, source: str, text: str) -> None:
        """Tell what the trouble is."""
        self._present[source] = text
        if text not in self._told:
            self._told.add(text)
            self._tell(text)

    def ends(self, source: str, dropped: int) -> None:
        """Take note that a source is well again; ``dropped`` is how many lines the log has lost so far."""
        self._present.pop(source, None)
        if self._present:
            return
        if self._told:
            self._told.clear()
            self._tell(f"the field log is written again; records missing: {dropped - self._dropped_before}")
        self._dropped_before = dropped
