"""What commands print: JSON for scripts, the next command for a person, and colour if it means something.

JSON is one document on a line of stdout, or a document per line where a run is shown record by record;
``docs/reference/json.md`` describes each. Notes, progress and the next command go to stderr.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from typing import Any, TextIO

from wayfarer.fieldlog.fields import escape_control_chars

# The terminal's colours (SGR codes), by the tone of a text; they follow the user's colour scheme.
COLOURS = {
    "quiet": "2", "phase": "36", "person": "1", "good": "32", "warning": "33", "fault": "1;31", "end": "1;32",
}  # fmt: skip


def painted(text: str, tone: str, stream: TextIO | None = None) -> str:
    """Return a text in the colour of its tone, if ``stream`` (None: stdout) is a terminal whose owner wants colours.

    ``NO_COLOR`` (no-color.org) and ``TERM=dumb`` say that nobody does.
    """
    wanted = (stream or sys.stdout).isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return f"\x1b[{COLOURS[tone]}m{text}\x1b[0m" if wanted and tone in COLOURS else text


def print_json(document: object) -> None:
    """Print a document as JSON: named tuples and dataclasses are objects, a number that is none (NaN) is null."""
    print(json.dumps(_plain(document), allow_nan=False))


def say_next(*words: object) -> None:
    """Print the command that comes next, its words quoted for a shell and fit for a terminal."""
    print("Next:", shlex.join(escape_control_chars(str(word)) for word in words), file=sys.stderr)


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if (names := getattr(value, "__struct_fields__", None)) is not None:  # of a record of a log
        value = {name: getattr(value, name) for name in names}
    elif is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value
