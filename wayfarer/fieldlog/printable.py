"""Makes texts from a log safe to print on a terminal."""

from __future__ import annotations


def clean(text: str) -> str:
    """Return a text without anything that a terminal obeys: those characters are written out."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)
