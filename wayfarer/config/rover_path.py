"""Where a rover's files are; needs no pydantic, so that a broken rover file can still be looked at."""

from __future__ import annotations

from pathlib import Path

# On a rover, and in the unit of its service (``STATE_DIRECTORY``).
ROVER_FILE = Path("/etc/wayfarer/rover.toml")
STATE_FOLDER = Path("/var/lib/wayfarer")  # logs and calibration
SHIPPED = Path(__file__).parents[1] / "rovers"
# The JSON Schema of rover files, for editors; docs/generate.py writes it. Editors look for it where the first line of a
# rover file says: shipped ones have a relative path there, and those of ``wayfarer init`` this absolute one.
SCHEMA = SHIPPED / "rover.schema.json"
SCHEMA_ELSEWHERE = f"#:schema {SCHEMA}\n"
ROVER_FILE_BYTES = 1_000_000  # chosen by us: a hundred times the longest one


def is_rover_file(name_or_path: str) -> bool:
    """Return whether a file is named (a slash, or ``.toml`` at its end), and not a shipped rover."""
    return "/" in name_or_path or name_or_path.endswith(".toml")


def rover_path(name_or_path: str) -> Path:
    """Return the file that is named, or that of a shipped rover."""
    return Path(name_or_path) if is_rover_file(name_or_path) else SHIPPED / f"{name_or_path}.toml"


def own_folder(name_or_path: str) -> Path | None:
    """Return where somebody's own drivers and algorithms are looked for first: beside the rover file."""
    return rover_path(name_or_path).parent if is_rover_file(name_or_path) else None
