"""Options and help texts that several commands share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

ROVER_FILE = Path("/etc/wayfarer/rover.toml")
SYSTEM_LOGS = Path("/var/lib/wayfarer/field_logs")
OWN_LOGS = Path("field_logs")

Logs = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help=f"Folder of all runs' logs. (default: {SYSTEM_LOGS} if you may write there, else ./{OWN_LOGS})",
    ),
]
Config = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE", help=f"Name of a built-in rover, or a rover file (TOML). (default: {ROVER_FILE})"
    ),
]
Algorithm = Annotated[str, typer.Option(metavar="NAME", help="Escape algorithm; see wayfarer list.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print everything as one JSON object.")]


def examples(*commands: str) -> str:
    """Return the end of a help text."""
    return "\n".join(["Examples:", *commands])


def log_folder(logs: Path | None) -> Path:
    """Return where runs are logged."""
    if logs is not None:
        return logs
    return SYSTEM_LOGS if os.access(SYSTEM_LOGS.parent, os.W_OK) else OWN_LOGS
