"""Where runs are logged, unless ``--logs`` says it, and the name by which a run is shown."""

from __future__ import annotations

import os
from pathlib import Path

SYSTEM_LOGS = Path("/var/lib/wayfarer/field_logs")
OWN_LOGS = Path("field_logs")


def log_folder(logs: Path | None) -> Path:
    """Return where runs are logged."""
    if logs is not None:
        return logs
    return SYSTEM_LOGS if os.access(SYSTEM_LOGS.parent, os.W_OK) else OWN_LOGS


def run_title(run: Path) -> str:
    """Return the name of a run's folder, however it was given (``.`` has none), fit for a terminal."""
    from wayfarer.fieldlog.printable import clean

    return clean(run.resolve().name)
