"""The error tree: one line each, meant for a person."""

from __future__ import annotations

from wayfarer import errors
from wayfarer.errors import UnknownName, WayfarerError, WrongPart

ALL = [error for error in vars(errors).values() if isinstance(error, type) and issubclass(error, WayfarerError)]


def test_page_draws_every_error() -> None:
    assert errors.__doc__ is not None
    assert [error.__name__ for error in ALL if error.__name__ not in errors.__doc__] == []


def test_unknown_name_offers_the_nearest() -> None:
    text = str(UnknownName("algorithm", "plege", ["pledge", "forest-pledge", "levy-walk"]))
    assert text == "unknown algorithm 'plege': did you mean pledge or forest-pledge?"


def test_unknown_name_lists_all_where_none_is_near() -> None:
    assert str(UnknownName("rover", "zzz", ["sim", "mini"])) == "unknown rover 'zzz': known: mini, sim"


def test_unknown_name_with_a_line_break_is_one_line() -> None:
    """Found by ``tests/fuzz``: such a verb came over the control socket."""
    assert "\n" not in str(UnknownName("verb", "st\nop", ["stop"]))


def test_wrong_part_says_what_answered() -> None:
    error = WrongPart("i2c-1 0x60", expected="CMPS14 version 7", got="version 3")
    assert (error.expected, error.got) == ("CMPS14 version 7", "version 3")
    assert str(error).startswith("i2c-1 0x60: expected CMPS14 version 7, got version 3;")
