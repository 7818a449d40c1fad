"""What commands print for scripts, and for the person who goes on: JSON, and the next command.

JSON is one document on a line of stdout, or a document a line where a run is shown record by record;
``docs/reference/json.md`` describes each. Notes, progress and the next command go to stderr.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from typing import Any

from wayfarer.fieldlog.fields import escape_control_chars


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
    elif isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value
