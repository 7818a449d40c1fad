"""Free space on the disk of a log, in MB."""

from __future__ import annotations

import shutil
from pathlib import Path

MB = 1_000_000  # bytes


def free_mb(folder: Path) -> float:
    """Return how much may still be written to the disk of a folder.

    Raises:
        OSError: there is no such folder, or its disk does not answer.
    """
    return shutil.disk_usage(folder).free / MB
