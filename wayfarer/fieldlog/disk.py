"""The disk of a log: its free space, and what to do about its errors."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

MB = 1_000_000  # bytes
ADVICE = {
    errno.ENOSPC: "delete old runs",
    errno.EDQUOT: "delete old runs, or ask for a larger quota",
    errno.EROFS: "mount the disk for writing; a card that mounts itself read-only is wearing out (see dmesg)",
    errno.EIO: "the card or disk is failing (see dmesg): save what is on it and replace it",
    errno.ENOTDIR: "a file stands where the folder should be",
    errno.ENOENT: "was it deleted, or is the disk not there?",
    errno.EEXIST: "log into a separate folder",
    errno.EFBIG: "the disk allows no file of this size: set a smaller part_mb",
}


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
