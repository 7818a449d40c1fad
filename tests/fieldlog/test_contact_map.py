"""The event ``contact_map``, read and laid onto the ground."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from tests.views.text.records import HEADER, drive, event, numbered
from wayfarer.fieldlog.contact_map import ContactMapNoted
from wayfarer.fieldlog.run_fold import RunFold

NOTED: dict[str, Any] = {
    "ahead_m": 5.0, "right_m": 1.0, "trunks": [[7.0, 0.0, 7.0, 2.0, 0.9]], "way": [[6.0, 3.0]], "mode": "plan",
}  # fmt: skip


def noted(goal_heading_deg: float | None = 0.0, **changes: Any) -> ContactMapNoted:
    """What the fold yields of the event after a drive towards a goal."""
    ticks, fold = drive(0.0, 0.2, goal_heading_deg=goal_heading_deg), RunFold()
    events = [fold.take(each) for each in numbered([HEADER, *ticks, event("contact_map", 0.2, **NOTED | changes)])]
    (found,) = (each for each in events[-1] if isinstance(each, ContactMapNoted))
    return found


def test_goal_to_the_north_is_ahead_and_the_east_is_right() -> None:
    assert noted().trunks_from((10.0, 20.0)) == [pytest.approx((9.0, 22.0, 11.0, 22.0, 0.9))]
    assert noted().way_from((10.0, 20.0)) == [(10.0, 20.0), pytest.approx((12.0, 21.0))]


def test_goal_to_the_east_turns_everything_clockwise() -> None:
    assert noted(90.0).trunks_from((0.0, 0.0)) == [pytest.approx((2.0, 1.0, 2.0, -1.0, 0.9))]


def test_straight_ahead_and_pledge_have_no_way() -> None:
    assert noted(90.0, way=[]).way_from((0.0, 0.0)) == []
    assert noted(mode="pledge").way_from((0.0, 0.0)) == []


def test_what_is_not_all_there_is_left_out() -> None:
    damaged = noted(trunks=[[1.0], "x", [1.0, 2.0, 3.0, None, 1.0], [7.0, 0.0, 7.0, 2.0, 9.0]], way=[[1e99, 0.0], 3])
    assert damaged.trunks == ((7.0, 0.0, 7.0, 2.0, 9.0),)
    assert damaged.trunks_from((0.0, 0.0))[0][4] == 1.0
    assert damaged.way == ()
    unplaced = [noted(None), noted(ahead_m=None), noted(right_m=nan)]
    assert [each.is_placed for each in [*unplaced, noted()]] == [False, False, False, True]
