"""The error tree: one line each, meant for a person."""

from __future__ import annotations

import pytest

from wayfarer import errors
from wayfarer.errors import UnknownName, WayfarerError, WrongPart, near_names

ALL = [error for error in vars(errors).values() if isinstance(error, type) and issubclass(error, WayfarerError)]


def test_page_draws_every_error() -> None:
    assert errors.__doc__ is not None
    assert [error.__name__ for error in ALL if error.__name__ not in errors.__doc__] == []


def test_unknown_name_offers_the_nearest() -> None:
    text = str(UnknownName("algorithm", "plege", ["pledge", "forest-pledge", "levy-walk"]))
    assert text == "unknown algorithm 'plege': did you mean pledge?"


def test_unknown_name_lists_all_where_none_is_near() -> None:
    assert str(UnknownName("rover", "zzz", ["sim", "mini"])) == "unknown rover 'zzz': known: mini, sim"


KEYS = ["ground", "escape.heading_p", "escape.turn_p", "escape.turn_angle_deg", "sim.trees_per_ha"]


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("escape.banana", []),  # the section's name makes none alike
        ("nope", []),
        ("Escape.Turn_Angel_Deg", ["escape.turn_angle_deg"]),
        ("turn_angle", ["escape.turn_angle_deg", "escape.turn_p"]),
        ("escpe.turn_angle_deg", ["escape.turn_angle_deg"]),
        ("tree_per_ha", ["sim.trees_per_ha"]),
        ("tree", []),
        ("gr", []),
    ],
)
def test_suggestions_are_near(name: str, near: list[str]) -> None:
    assert near_names(name, KEYS) == near


def test_of_many_names_those_in_the_section_are_listed_or_else_the_sections() -> None:
    many = [*KEYS, *(f"board.key_{number}" for number in range(20))]
    assert str(UnknownName("key", "escape.z", many)).endswith(
        "known: escape.heading_p, escape.turn_angle_deg, escape.turn_p"
    )
    assert str(UnknownName("key", "zzz", many)).endswith("known: board.*, escape.*, ground, sim.*")
    assert str(UnknownName("scenario", "zzz", [f"s{number:02d}" for number in range(30)])).endswith("s19, and 10 more")


def test_unknown_name_with_a_line_break_is_one_line() -> None:
    """Found by ``tests/fuzz``: such a verb came over the control socket."""
    assert "\n" not in str(UnknownName("verb", "st\nop", ["stop"]))


def test_wrong_part_says_what_answered() -> None:
    error = WrongPart("i2c-1 0x60", expected="CMPS14 version 7", got="version 3")
    assert (error.expected, error.got) == ("CMPS14 version 7", "version 3")
    assert str(error).startswith("i2c-1 0x60: expected CMPS14 version 7, got version 3;")
