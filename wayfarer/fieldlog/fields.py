"""Texts that are fit for a terminal. Pure."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any


def escape_control_chars(text: str) -> str:
    """Return a text without anything that a terminal obeys: those characters are written out."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def escape_document(document: Any, depth: int = sys.maxsize) -> Any:
    """Return what came as JSON with all its texts and keys escaped.

    Raises:
        RecursionError: it is nested deeper than ``depth``, or than Python can follow.
    """
    if depth < 0:
        raise RecursionError("it is nested too deep")
    if isinstance(document, str):
        return escape_control_chars(document)
    if isinstance(document, Mapping):
        return {escape_control_chars(str(key)): escape_document(each, depth - 1) for key, each in document.items()}
    return [escape_document(each, depth - 1) for each in document] if isinstance(document, list | tuple) else document
