"""Damaging what was whole: bytes as a disk, a wire or an editor does it, JSON as another program does it.

What is done to a content is told by a few bytes, drawn at once: Hypothesis's own strategies for nested values take ten
times as long as what is tried with them. They are made small by leaving bytes out, and so fewer changes remain.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite
from struct import unpack
from typing import Any, TypeVar

import msgspec
from hypothesis import strategies as st

T = TypeVar("T")

NUMBERS = (
    0, -1, 1, 3, 255, 256, 65_535, 2**31, 2**53, 2**63 - 1, 2**64 - 1, 0.5, -0.0, 1e-320, 1e9, -1e9, 1e18, 1e300,
    -1e308, 1.7976931348623157e308,
)  # fmt: skip
TEXTS = ("", "nan", "follow", "\u202e", "\x1b[31m", "\n", "a\0b", "٣", "\U0001f9ed", "x" * 300, "../..", "this:that")
NUMBER_TEXTS = (
    b"0", b"-0", b"1e999", b"-1e999", b"NaN", b"nan", b"inf", b"-Infinity", b"1e308", b"9" * 400, b"9" * 5_000, b"0x10",
    b"1_000", b"true", b"null", b'""',
)  # fmt: skip
TOKENS = (
    *NUMBER_TEXTS, b"[" * 1_500, b"]" * 300, b"{", b"}", b'{"a":' * 300, b",", b":", b'"', b"'", b"\\", b"\\ud800",
    b"=", b"#", b"\n", b"\r", b"\r\n", b"\0", b"\0" * 600, b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xc2\x85",
    b"\xe2\x80\xa8", b"\x1b[2J", b"\x0b", b"x" * 9_000,
)  # fmt: skip
CONTAINERS = (b"[]", b"{}", b'[[1,"x",null]]', b'{"a":{"b":1}}', b'[1.0,2.0,3.0,4.0,"left"]')
LENGTHS = (1, 0, 2, 4, 8, 64, 1_024)
DEPTH = 600  # fewer than Python reads (1000)
CHANGE_BYTES = 10  # about as many as tell one change


class Choices:
    """Takes choices out of bytes; when they are used up, always the first."""

    def __init__(self, told: bytes) -> None:
        self._told = told

    @property
    def more(self) -> bool:
        return bool(self._told)

    def take(self, count: int) -> bytes:
        """Take so many bytes, zeros beyond the end."""
        taken, self._told = self._told[:count], self._told[count:]
        return taken.ljust(count, b"\0")

    def below(self, count: int) -> int:
        """Choose a number from 0 to below ``count``."""
        return int.from_bytes(self.take(1 if count <= 256 else 3), "big") % count

    def of(self, items: Sequence[T]) -> T:
        return items[self.below(len(items))]


def _choices(most: int) -> st.SearchStrategy[bytes]:
    return st.binary(max_size=most * CHANGE_BYTES)


# -- bytes -----------------------------------------------------------------------------------------------------------


def bytes_of(whole: Sequence[bytes], tokens: Sequence[bytes] = (), most: int = 6) -> st.SearchStrategy[bytes]:
    """Make contents out of some: whole, damaged, mixed; ``tokens`` are words that their reader knows."""
    return st.builds(partial(damaged, (*TOKENS, *tokens), tuple(whole)), st.sampled_from(whole), _choices(most))


def damaged(tokens: Sequence[bytes], others: Sequence[bytes], content: bytes, told: bytes) -> bytes:
    """Return a content in which some pieces were replaced."""
    choices = Choices(told)
    while choices.more:
        begin = choices.below(len(content) + 1)
        piece = _piece(choices, tokens, (content, *others))
        length = choices.of(LENGTHS) if choices.below(2) else len(piece)  # a wire that garbles keeps the length
        content = content[:begin] + piece + content[begin + length :]
    return content


def _piece(choices: Choices, tokens: Sequence[bytes], sources: Sequence[bytes]) -> bytes:
    """Return what comes in the place of some bytes: nothing, other bytes, a token, a piece of this or another."""
    kind = choices.below(4)
    if kind == 0:
        return b""
    if kind == 1:
        return choices.take(1 + choices.below(3))
    if kind == 2:
        return choices.of(tokens)
    source = choices.of(sources)
    begin = choices.below(len(source) + 1)
    return source[begin : begin + choices.of(LENGTHS)]


# -- JSON ------------------------------------------------------------------------------------------------------------


def json_of(whole: Sequence[Any], most: int = 4) -> st.SearchStrategy[Any]:
    """Make JSON values out of some: whole, or changed here and there."""
    return st.builds(changed, st.sampled_from([msgspec.json.encode(value) for value in whole]), _choices(most))


def changed(content: bytes, told: bytes) -> Any:
    """Return the value of a JSON text with some changes in it."""
    value, choices = msgspec.json.decode(content), Choices(told)
    while choices.more:
        value = _change(choices, value)
    return value


def any_value(choices: Choices) -> Any:
    return choices.of(_VALUES)(choices)


def _any_float(choices: Choices) -> float:
    (number,) = unpack(">d", choices.take(8))
    return float(number) if isfinite(number) else 1e22


_VALUES: tuple[Callable[[Choices], Any], ...] = (
    lambda choices: choices.of((None, True, False)),
    lambda choices: choices.of(NUMBERS),
    lambda choices: choices.of(TEXTS),
    lambda choices: int.from_bytes(choices.take(choices.below(9)), "big", signed=True),
    _any_float,
    lambda choices: msgspec.json.decode(choices.of(CONTAINERS)),
    lambda choices: nested(choices.of(TEXTS)),
)


def _change(choices: Choices, value: Any) -> Any:
    """Return a value with one change somewhere in it; what is a container is mostly gone into."""
    inside = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    if not inside or not choices.more or choices.below(8) == 7:
        return any_value(choices)
    key = choices.of(inside)
    choices.of(_CHANGES)(choices, value, key)
    return value


def nested(value: Any, depth: int = DEPTH) -> Any:
    """Return a value within so many lists."""
    for _ in range(depth):
        value = [value]
    return value


def _within(choices: Choices, value: Any, key: Any) -> None:
    value[key] = _change(choices, value[key])


def _remove(_choices: Choices, value: Any, key: Any) -> None:
    del value[key]


def _replace(choices: Choices, value: Any, key: Any) -> None:
    value[key] = any_value(choices)


def _swap(choices: Choices, value: Any, key: Any) -> None:
    other = choices.of(list(value) if isinstance(value, dict) else range(len(value)))
    value[key], value[other] = value[other], value[key]


def _add(choices: Choices, value: Any, key: Any) -> None:
    if isinstance(value, dict):
        value[choices.of((*TEXTS, f"{key}_m"))] = any_value(choices)
    else:
        value.insert(key, any_value(choices))


_CHANGES: tuple[Callable[[Choices, Any, Any], None], ...] = (_within, _within, _within, _remove, _replace, _swap, _add)


def as_json(value: Any) -> bytes:
    """Return a value as JSON, however deep it is."""
    try:
        return msgspec.json.encode(value)
    except TypeError:  # too deep for it
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(20 * DEPTH)
        try:
            return json.dumps(value).encode()
        finally:
            sys.setrecursionlimit(limit)
