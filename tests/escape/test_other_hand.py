"""Trials that go on twice from a contact, and what is learnt from them."""

from __future__ import annotations

from itertools import islice

import pytest

from benchmarks.other_hand import Contact, contacts

pytestmark = [
    pytest.mark.process,
    # The thread that forks is the only one that the child needs.
    pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning"),
]


def test_child_that_keeps_the_hand_drives_the_path_of_its_parent() -> None:
    found = list(islice(contacts(1, switches=False), 2))
    assert found[0].first_wall
    assert [contact.cost_m for contact in found] == [0.0, 0.0]


def test_child_with_the_other_hand_drives_another_path() -> None:
    first = next(contacts(1))
    assert first.first_wall
    assert abs(first.cost_m) > 5.0


def test_tree_finds_a_hand_that_can_be_told() -> None:
    from benchmarks import hand  # its scikit-learn takes two seconds, which each worker would need to collect the tests

    nothing = Contact(0, True, True, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 0)
    told = [
        nothing._replace(layout=layout, offset_m=side * (1.0 + layout), cost_m=-9.0 * side)
        for layout in range(20)
        for side in (1, -1)
    ]
    (row,) = list(hand.rows(told))[:1]
    assert row[:2] == ("first wall", "40")
    assert row[3:] == ("50 %", "4.5")
    found = next(hand.tree_lines(told))
    assert "AUC 1.00" in found
    assert "gain +4.50" in found
