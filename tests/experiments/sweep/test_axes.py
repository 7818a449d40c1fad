from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.errors import BadInput
from wayfarer.experiments.sweep.axes import MOST_VALUES, parse_axis


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("k=10:50:10", (10, 20, 30, 40, 50)),
        ("k=0.2:0.8:0.2", (0.2, 0.4, 0.6, 0.8)),
        ("k=0:1:0.3", (0, 0.3, 0.6, 0.9)),
        ("k=3:1:-1", (3, 2, 1)),
        ("k=-30:30:30", (-30, 0, 30)),
        ("k=5:5:1", (5,)),
        (" k = 1, 2.5 ,1e1", (1, 2.5, 10)),
        ("k=7,7,7.0", (7,)),
        ("k=motion,contact", ("motion", "contact")),
        ("k=true,false", (True, False)),
    ],
)
def test_lists_and_ranges_give_their_values(text: str, values: tuple[object, ...]) -> None:
    axis = parse_axis(text)
    assert axis.key == "k"
    assert axis.values == values
    assert list(map(type, axis.values)) == list(map(type, values))


@pytest.mark.parametrize(
    "text",
    [
        "k", "k=", "=1", "k=1,,2", "k=1,", "k=1:2", "k=1:2:3:4", "k=1:2:0", "k=0:0:0", "k=1:2:-1", "k=a:b:c",
        "k=1:inf:1", "k=1:1e999999:1", "k=0:1:1e-999999", "k=1:nan:1", "k=nan:2:1", "k=0:1:1e-9", "k=1e999999:2:1", "",
    ],
)  # fmt: skip
def test_what_is_no_axis_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(BadInput, match=r"KEY=VALUES|FIRST:LAST:STEP|between two commas") as raised:
        parse_axis(text)
    assert "\n" not in str(raised.value)


@given(first=st.integers(-1000, 1000), step=st.integers(1, 99), count=st.integers(1, MOST_VALUES))
def test_range_in_hundredths_is_exact_and_ends_where_it_should(first: int, step: int, count: int) -> None:
    last = first + (count - 1) * step
    axis = parse_axis(f"k={first / 100}:{last / 100}:{step / 100}")
    assert axis.values == tuple((first + number * step) / 100 for number in range(count))


@given(text=st.text())
def test_any_text_is_an_axis_or_bad_input(text: str) -> None:
    with suppress(BadInput):
        assert parse_axis(text).values
