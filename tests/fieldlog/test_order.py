"""What breaks the order of a log is left out, and nothing else is: one bad line never costs those after it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.fieldlog.order import WINDOW, Order
from wayfarer.fieldlog.schema import KINDS, Record

TICK_S = 0.05


def in_order(records: list[Record]) -> list[Record]:
    return list(Order().all_of(records))


def tick(n: int, t_s: float) -> Record:
    return {"record": "tick", "n": n, "t_s": t_s}


def log(length: int, *, begins_s: float = 1000.0) -> list[Record]:
    """Return a log in parts of 100 ticks, with a header before each."""
    ticks = [tick(n, begins_s + n * TICK_S) for n in range(1, length + 1)]
    header: dict[str, Any] = {"record": "run"}
    parts = [
        [{**header, "part": at // 100, "t_s": ticks[at]["t_s"]}, *ticks[at : at + 100]] for at in range(0, length, 100)
    ]
    return [record for part in parts for record in part]


@given(
    st.lists(st.tuples(st.sampled_from(KINDS), st.integers(1, 5000), st.floats(0.0, 5000.0)), max_size=600),
    st.floats(0.0, 1e8),
)
def test_log_with_gaps_and_stalls_is_given_whole(steps: list[tuple[str, int, float]], begins_s: float) -> None:
    records, n, t_s = [], 0, begins_s
    for kind, numbers, passed_s in steps:
        n, t_s = n + numbers, t_s + max(passed_s, TICK_S * numbers)
        records.append({"record": kind, "t_s": t_s} | ({} if kind == "run" else {"n": n}))
    assert in_order(records) == records


def test_position_and_tick_may_be_written_after_what_came_later() -> None:
    """An event is written at once, with its own time; a tick that stood still has the time at which it began."""
    stalled = [*log(50), {"record": "event", "n": 51, "t_s": 1062.0}, tick(52, 1002.55), tick(53, 1062.1)]
    stalled.append({"record": "position", "n": 54, "t_s": 1059.5})
    assert in_order(stalled) == stalled


def test_two_ticks_may_have_the_same_time() -> None:
    """Virtual time stands still between two ticks where the one before came late."""
    late = [*log(50), tick(51, 1062.0), tick(52, 1062.0), tick(53, 1062.05)]
    assert in_order(late) == late


def test_tick_may_stand_still_for_any_time() -> None:
    """An event is written meanwhile, and the motor board's answer is written by the next tick."""
    stalled = [*log(50), {"record": "event", "n": 51, "t_s": 1602.0}, tick(52, 1002.55)]
    stalled += [{"record": "board", "n": 53, "t_s": 1002.6}, tick(54, 1602.1), tick(55, 1602.15)]
    assert in_order(stalled) == stalled


@pytest.mark.parametrize("kind", ["event", "board", "computer", "fault", "position"])
@pytest.mark.parametrize("late_s", [0.9, 50.0, 99.0, 1e6])
def test_record_that_is_later_than_the_ticks_after_it_is_dropped_alone(kind: str, late_s: float) -> None:
    records = log(600)
    at = 333
    wrong: Record = {"record": kind, "n": records[at]["n"], "t_s": records[at]["t_s"] + late_s}
    assert in_order([*records[:at], wrong, *records[at + 1 :]]) == [*records[:at], *records[at + 1 :]]


@pytest.mark.parametrize("kind", ["event", "board", "computer", "fault", "truth"])
def test_record_that_is_earlier_than_the_tick_before_it_is_dropped(kind: str) -> None:
    records = log(600)
    wrong: Record = {"record": kind, "n": 601, "t_s": records[-1]["t_s"] - 6.0}
    assert in_order([*records, wrong]) == records


@pytest.mark.parametrize("by_s", [1e6, 50.0, -50.0])
def test_outcome_and_truth_have_the_time_of_the_record_before_them(by_s: float) -> None:
    records = log(300)
    for kind in ("outcome", "truth"):
        last: Record = {"record": kind, "n": 301, "t_s": records[-1]["t_s"]}
        assert in_order([*records, last]) == [*records, last]
        assert in_order([*records, last | {"t_s": last["t_s"] + by_s}]) == records


def test_outcome_of_a_run_in_which_nothing_happened_is_given() -> None:
    header, outcome = {"record": "run", "t_s": 1000.0}, {"record": "outcome", "n": 1, "t_s": 1000.0}
    assert in_order([header, outcome]) == [header, outcome]


def test_header_that_is_later_than_its_log_is_dropped() -> None:
    records = log(300)
    late = records[0] | {"t_s": records[0]["t_s"] + 50.0}
    assert in_order([late, *records[1:]]) == records[1:]


CHANGES = st.fixed_dictionaries(
    {}, optional={"n": st.none() | st.integers(0, 2**53), "t_s": st.floats(0.0, 1e9) | st.floats(900.0, 1100.0)}
)


@given(st.integers(2, 700), st.integers(0), CHANGES)
def test_changed_number_or_time_costs_one_record_at_most(length: int, at: int, change: dict[str, Any]) -> None:
    records = log(length)
    at %= len(records)
    records[at] = records[at] | change
    assert lost([*records[:at], *records[at + 1 :]], records) <= 1


@given(st.integers(2, 700), st.integers(0), st.integers(0))
def test_line_that_is_there_twice_is_dropped_once(length: int, line: int, at: int) -> None:
    whole = log(length)
    line %= len(whole)
    twice = whole[line]
    at = line + 1 + at % (len(whole) - line)
    given_back = in_order([*whole[:at], twice, *whole[at:]])
    if twice["record"] == "run" and len(given_back) > len(whole):  # of an earlier part: it has no number to tell
        given_back.pop(at)
    assert given_back == whole


@given(st.integers(2, 700), st.integers(0))
def test_two_lines_in_each_others_place_cost_one_of_them(length: int, at: int) -> None:
    records = log(length)
    at %= len(records) - 1
    records[at], records[at + 1] = records[at + 1], records[at]
    assert lost(records, records) <= 1


@pytest.mark.parametrize("change", [{"t_s": 5e6}, {"n": 100_000}, {"t_s": 0.0}])
@given(block=st.integers(1, WINDOW // 4 - 2), at=st.integers(0, 400))
def test_many_bad_lines_side_by_side_cost_only_themselves(change: dict[str, Any], block: int, at: int) -> None:
    records = log(800)
    bad = [
        record | {key: value + (count if value else 0) for key, value in change.items() if key in record}
        for count, record in enumerate(records[at : at + block])
    ]
    good = [*records[:at], *records[at + block :]]
    few = at if at <= block else 0  # so few lines at the beginning may as well be the wrong ones
    assert lost(good, [*records[:at], *bad, *records[at + block :]]) <= max(1, few)


JUNK = st.builds(
    lambda kind, n, t_s: {"record": kind, "t_s": t_s} | ({} if n == -1 else {"n": n}),
    st.sampled_from(KINDS),
    st.none() | st.integers(-1, 400) | st.integers(0, 2**53),
    st.integers(0, 300).map(float) | st.floats(0.0, 1e9),
)


@given(st.lists(JUNK, max_size=2 * WINDOW))
def test_what_is_given_of_any_junk_is_in_order(records: list[Record]) -> None:
    order = Order()
    found = [each for record in records for each in order.take(record)] + list(order.rest())
    assert order.dropped == len(records) - len(found)
    numbers = [record["n"] for record in found if record.get("n") is not None]
    assert all(before < after for before, after in pairwise(numbers))
    ticks_s = [record["t_s"] for record in found if record["record"] == "tick"]
    assert ticks_s == sorted(ticks_s)
    latest_s = settled_s = -1.0
    for record in found:
        latest_s = max(latest_s, record["t_s"])
        if record["record"] == "tick":
            assert record["t_s"] >= settled_s
            settled_s = latest_s


def lost(good: list[Record], records: list[Record]) -> int:
    """Return how many of the good records of a log are not given."""
    kept = {id(record) for record in in_order(records)}
    return sum(id(record) not in kept for record in good)
