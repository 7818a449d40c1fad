"""Labels and badges do not lie on each other."""

from __future__ import annotations

from itertools import combinations
from math import dist

from hypothesis import given
from hypothesis import strategies as st

from wayfarer.views.run_report.labels import Label, place, spread, text_width_pt

ROOM_PT = 300.0
WORDS = st.sampled_from(["hold", "resume", "compass failed (12 times)", "1 hit log", "a mark as long as the axis " * 3])
LABELS = st.lists(st.builds(Label, WORDS, st.floats(0.0, ROOM_PT), st.integers(0, 3), st.just("black")), max_size=40)
PLACES = st.lists(st.tuples(st.floats(0.0, 300.0), st.floats(0.0, 300.0)), max_size=30)


@given(LABELS, st.integers(1, 8))
def test_no_label_lies_on_another(labels: list[Label], lanes: int) -> None:
    for one, other in combinations(place(labels, ROOM_PT, lanes), 2):
        if one.lane == other.lane:
            left, right = sorted((one, other), key=lambda placed: placed.left_pt)
            assert left.left_pt + text_width_pt(left.label.text) < right.left_pt


@given(LABELS)
def test_labels_stay_on_the_axis_where_they_can(labels: list[Label]) -> None:
    for label, lane, left_pt in place(labels, ROOM_PT, 3):
        assert 0 <= lane < 3
        assert left_pt >= 0.0
        assert left_pt + text_width_pt(label.text) <= max(ROOM_PT, text_width_pt(label.text)) + 1e-9


def test_what_matters_most_is_placed_first_when_room_is_short() -> None:
    labels = [Label("event", 100.0 + at, 3, "black") for at in range(4)] + [Label("1 mark", 101.0, 0, "black")]
    assert [placed.label.text for placed in place(labels, ROOM_PT, 2)] == ["event", "1 mark"]


def test_label_at_the_right_end_is_written_to_the_left() -> None:
    (placed,) = place([Label("the end", ROOM_PT, 0, "black")], ROOM_PT, 1)
    assert placed.left_pt + text_width_pt("the end") == ROOM_PT


@given(PLACES)
def test_badges_lie_neither_on_each_other_nor_on_their_place(places_pt: list[tuple[float, float]]) -> None:
    badges_pt = spread(places_pt, 10.0)
    assert all(dist(one, other) >= 10.0 - 1e-5 for one, other in combinations(badges_pt, 2))
    assert all(dist(badge, at) >= 10.0 - 1e-9 for badge, at in zip(badges_pt, places_pt, strict=True))


def test_badges_of_marks_at_one_place_stand_around_it() -> None:
    badges_pt = spread([(0.0, 0.0)] * 6, 10.0)
    assert max(dist(badge, (0.0, 0.0)) for badge in badges_pt) < 10.5
