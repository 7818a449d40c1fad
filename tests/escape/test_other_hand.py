"""Trials that go on twice from a contact."""

from __future__ import annotations

from itertools import islice

import pytest

from benchmarks.other_hand import contacts

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
