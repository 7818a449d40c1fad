"""Where runs are logged, unless ``--logs`` says it."""

from __future__ import annotations

import os
from pathlib import Path

from wayfarer.config.rover_path import STATE_FOLDER

SYSTEM_LOGS = STATE_FOLDER / "field_logs"
OWN_LOGS = Path("field_logs")


def log_folder(logs: Path | None) -> Path:
    """Return where runs are logged."""
    if logs is not None:
        return logs
    return SYSTEM_LOGS if os.access(SYSTEM_LOGS.parent, os.W_OK) else OWN_LOGS
