"""Texts that are fit for a terminal. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def escape_control_chars(text: str) -> str:
    """Return a text without anything that a terminal obeys: those characters are written out."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def escape_document(document: Any) -> Any:
    """Return what came as JSON with all its texts and keys escaped, at any depth."""
    if isinstance(document, str):
        return escape_control_chars(document)
    if isinstance(document, Mapping):
        return {escape_control_chars(str(key)): escape_document(each) for key, each in document.items()}
    return [escape_document(each) for each in document] if isinstance(document, list | tuple) else document
