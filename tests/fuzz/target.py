"""What is fuzzed: a reader, its cases, and what is tried with each."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

from hypothesis.strategies import SearchStrategy

from wayfarer.errors import WayfarerError

Case = Any  # literals only, so that its repr can be pasted
Try = Callable[[Case], str]


class Target(NamedTuple):
    """One reader.

    name: for the test's name.
    cases: makes cases.
    opened: sets up what the tries need, and yields what is done with a case: it returns the outcome in a few words, or
        raises because of a bug.
    quick: how many cases a test of the tier ``unit`` tries.
    """

    name: str
    cases: SearchStrategy[Case]
    opened: Callable[[], AbstractContextManager[Try]]
    quick: int = 60


def refused(error: WayfarerError) -> str:
    """Return the outcome of a case that was refused, once it is seen to have a text of one line."""
    text = str(error)
    assert text.strip() and "\n" not in text, f"{type(error).__name__}: {text!r}"
    return f"{type(error).__name__}: {shape(text)}"


def shape(text: str) -> str:
    """Return a text without what differs from case to case, so that outcomes can be counted."""
    without_quoted = re.sub(r"'[^']*'|\"[^\"]*\"", "'", text)
    return re.sub(r"[^ ]*[\d/\\][^ ]*", "#", without_quoted)[:80]


def reading(read: Callable[[], str]) -> str:
    """Return what reading says of its outcome, or how it refused."""
    try:
        return read()
    except WayfarerError as error:
        return refused(error)
