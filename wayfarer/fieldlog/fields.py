"""Lenient typed access to records: a wrong type reads as missing, and no text can command a terminal. Pure.

The reader leaves out a record with a value that cannot be. A key may still not be there, a failing part or a third
party's algorithm may have said anything, and a name need not be fit for a terminal.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any

# No time, distance, angle or voltage of a run comes near it: bytes of a number beyond it were changed.
MAX_PLAUSIBLE = 1e10


def number(record: Mapping[str, Any], key: str) -> float | None:
    """Return a number, or None; none is NaN, or so large that sums of them overflow."""
    value = record.get(key)
    if isinstance(value, int | float) and -MAX_PLAUSIBLE < value < MAX_PLAUSIBLE and not isinstance(value, bool):
        return value
    return None


def or_nan(value: float | None) -> float:
    """Return a number, NaN for one that is not known."""
    return nan if value is None else value


def integer(record: Mapping[str, Any], key: str) -> int | None:
    """Return a whole number, such as a seed with all its digits, or None."""
    value = record.get(key)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def safe_text(record: Mapping[str, Any], key: str) -> str | None:
    """Return a text that is fit for a terminal, or None."""
    value = record.get(key)
    return escape_control_chars(value) if isinstance(value, str) else None


def table(record: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return an object; an empty one if there is none."""
    value = record.get(key)
    return value if isinstance(value, dict) else {}


def escape_control_chars(text: str) -> str:
    """Return a text without anything that a terminal obeys: those characters are written out."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def escape_document(document: Any) -> Any:
    """Return what came as JSON with all its texts escaped, at any depth; names of keys stay as they are."""
    if isinstance(document, str):
        return escape_control_chars(document)
    if isinstance(document, Mapping):
        return {key: escape_document(each) for key, each in document.items()}
    return [escape_document(each) for each in document] if isinstance(document, list) else document
