"""Reads the motors' table of a rover file, even if the rest of the file is broken.

Only the keys that say where the board is must be right, because no other mistake may prevent a stop.
"""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from wayfarer.config.rover_path import ROVER_FILE_BYTES
from wayfarer.daemon.socket.driven import DrivenBoard
from wayfarer.errors import BadConfig, BadInput, kind_and_text
from wayfarer.files.regular_file import open_regular


class NamedBoard(NamedTuple):
    """What a rover file says of its motors, and whose file it is."""

    driven: DrivenBoard
    file: os.stat_result


def motors_of(path: Path) -> NamedBoard:
    """Return the motors of a rover file; the only check is that they name a driver.

    Raises:
        BadInput: the file cannot be read.
        BadConfig: there are no motors in it.
    """
    rover, about = _read(path)
    parts = rover.get("parts")
    table = parts.get("motors") if isinstance(parts, dict) else None
    if not isinstance(table, dict) or not isinstance(table.get("driver"), str):
        raise BadConfig("no [parts.motors] with a driver: this rover has no wheels to stop")
    return NamedBoard(DrivenBoard(table, str(rover.get("buses", "linux"))), about)


def _read(path: Path) -> tuple[dict[str, Any], os.stat_result]:
    try:
        with open_regular(path) as file:  # of the file that is read: another one may be at its path a moment later
            about, content = os.fstat(file.fileno()), file.read(ROVER_FILE_BYTES) or b""
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror}; name one with --config") from None
    except ValueError:  # a zero byte in its name
        raise BadInput("cannot be read: no file can have this name; name one with --config") from None
    text = content.decode("utf-8-sig", errors="replace")
    try:
        return tomllib.loads(text), about
    except (ValueError, RecursionError) as error:
        found = _salvaged(text)
        if "driver" not in found["parts"]["motors"]:
            raise BadConfig(f"not valid TOML: {kind_and_text(error)}") from None
        return found, about


def _salvaged(text: str) -> dict[str, Any]:
    """Return the motors and the buses from the single lines of a file that is not valid TOML as a whole."""
    top: dict[str, Any] = {}
    motors: dict[str, Any] = {}
    table: dict[str, Any] | None = top
    for line in text.splitlines():
        if header := re.match(r"\s*\[\s*([\w\s.-]+?)\s*\]\s*(#.*)?$", line):
            table = motors if re.fullmatch(r"parts\s*\.\s*motors", header[1]) else None
        elif table is not None:
            table.update(_line(line))
    return {"buses": top.get("buses", "linux"), "parts": {"motors": motors}}


def _line(text: str) -> dict[str, Any]:
    """Return key and value of a line; an invalid value as text, so that the key does not count as left out."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        key, equals, value = text.partition("=")
        return {key.strip(): value.partition("#")[0].strip(" \t\"'")} if equals else {}
