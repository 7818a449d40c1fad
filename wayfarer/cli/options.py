"""Options, help texts and refusals that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli import completion
from wayfarer.cli.log_folder import OWN_LOGS, SYSTEM_LOGS
from wayfarer.config.rover_path import ROVER_FILE
from wayfarer.errors import BadInput

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
        metavar="NAME|FILE",
        autocompletion=completion.rovers,
        help=f"Name of a built-in rover, or a rover file (TOML). (default: {ROVER_FILE})",
    ),
]
AlgorithmOption = Annotated[
    str, typer.Option(metavar="NAME", autocompletion=completion.algorithm, help="Escape algorithm; see wayfarer list.")
]
AllowCode = Annotated[
    bool,
    typer.Option(
        "--allow-code",
        help="Import what a log or results name as 'module:attribute': only if you trust the writer.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for scripts; docs/json.md describes it.")]


def examples(*commands: str) -> str:
    """Return the end of a help text."""
    return "\n".join(["Examples:", *commands])


def refuse(*mistakes: tuple[object, str]) -> None:
    """Refuse options that do not go together: of each mistake, whether it was made and what to say of it.

    Raises:
        BadInput: one was made; of several the first is told.
    """
    for made, why in mistakes:
        if made:
            raise BadInput(why)
