"""Reports of logs that lack something, or hold what no rover writes; what is unknown stays a gap in a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bokeh.models import Scatter
from hypothesis import given
from hypothesis import strategies as st

from tests.logview.records import Json, event, noted, record
from tests.reports.logs import (
    ARMED,
    HEADER,
    OUTCOME,
    by_time,
    check_page,
    data_of,
    drawn,
    drive,
    fix,
    line_of,
    page_of,
    text_of,
    tick,
    titles,
    without,
)
from wayfarer.fieldlog.record import SCHEMA
from wayfarer.reports.data import (
    Columns,
    Floats,
    ValueSpan,
    around,
    at_ticks,
    event_marks,
    is_trouble,
    pieces,
    read_run,
    spans,
    thinned,
)
from wayfarer.reports.map import map_plot, track_of
from wayfarer.reports.panels import panels_of
from wayfarer.reports.run import GAPS, NO_TICKS, NO_WAY, run_facts, track_caption


def test_log_without_ticks_says_so(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, event("opened", 0.1, parts=["compass"]), OUTCOME)
    check_page(page)
    assert NO_TICKS in text_of(page)
    assert NO_WAY in text_of(page)


def test_log_without_a_heading_still_has_time_series(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *(tick(0.05 * step, heading_deg=None) for step in range(40)), OUTCOME)
    assert NO_WAY in text_of(page)
    assert {"speed, m/s", "left wheel's duty"} <= set(titles(page))


def test_lost_beginning_is_no_start(tmp_path: Path) -> None:
    def on_map(name: str, *records: Json) -> tuple[bool, bool]:
        """Whether the map has a star at the start, and whether it says that something is lost."""
        track = track_of(data_of(tmp_path / name, *records))
        scatters: Any = map_plot(track).select({"type": Scatter})
        return "star" in {each.marker for each in scatters}, GAPS in track_caption(track)

    assert on_map("late", {**HEADER, "part": 2}, *without(drive(), 0, 40)) == (False, False)
    assert on_map("headless", *without(drive(), 0, 40)) == (False, False)
    assert on_map("gap", HEADER, *without([ARMED, *drive()], 20, 60)) == (True, True)
    assert on_map("whole", HEADER, ARMED, *drive()) == (True, False)


def test_ticks_that_are_few_or_say_nothing_make_a_page(tmp_path: Path) -> None:
    nothing = dict.fromkeys(("wanted_left", "wanted_right", "applied_left", "applied_right"))
    bare = [record("tick", float(step), phase="", why="", **nothing) for step in range(3)]
    header = {"record": "run", "t_s": 100.0, "t_wall": 0.0, "schema": SCHEMA}
    assert NO_TICKS in text_of(page_of(tmp_path / "even", header, *bare))
    check_page(page_of(tmp_path / "uneven", header, *bare, tick(3.01)))
    check_page(page_of(tmp_path / "one", HEADER, tick(0.0)))


def test_time_without_ticks_is_marked(tmp_path: Path) -> None:
    page = page_of(tmp_path, HEADER, *drive(1.0), *(tick(31.0 + 0.05 * step) for step in range(20)), OUTCOME)
    assert '"no ticks for 30.1 s"' in drawn(page)
    assert "0:00:31.0 no ticks for 30.1 s" in text_of(page)
    (event,) = (data := read_run(tmp_path / "00001-run")).events
    assert is_trouble(event)
    assert [(round(each.t_s, 6), each.layer) for each in event_marks(data)] == [(0.95, "trouble")], "it began there"


def test_way_and_lines_are_broken_where_no_ticks_came(tmp_path: Path) -> None:
    boards = [record("board", at_s, battery_v=12.0) for at_s in (0.5, 6.5)]
    ticks = [*drive(1.0), *(tick(6.0 + 0.05 * step) for step in range(20))]
    data = data_of(tmp_path, HEADER, *by_time(*ticks, *boards), OUTCOME)
    assert np.flatnonzero(np.isnan(track_of(data).path.east_m)).tolist() == [20]
    assert [int(np.isnan(line[1]).sum()) for name in ("heading", "battery") if (line := line_of(name, data))] == [1, 1]


def test_battery_is_not_drawn_across_a_silence_of_the_board(tmp_path: Path) -> None:
    boards = [record("board", at_s, battery_v=12.0) for at_s in (0.0, 10.0, 20.5)]
    ticks = [tick(0.5 * step) for step in range(42)]
    line = line_of("battery", data_of(tmp_path, HEADER, *by_time(*ticks, *boards)))
    assert line is not None
    np.testing.assert_array_equal(line[1], [12.0, 12.0, np.nan, 12.0])


def test_goals_are_those_that_the_rover_took(tmp_path: Path) -> None:
    def goal(name: str, *records: Json) -> str:
        return dict(run_facts(data_of(tmp_path / name, HEADER, *records, OUTCOME), name))["goal"]

    ticks = drive()
    armed = [event("armed", 1.0, goal_heading_deg=20.0), event("goal", 2.0, goal_heading_deg=359.7)]
    armed += [event("goal", 2.5, goal_heading_deg=0.0), *ticks[60:]]
    assert goal("whole", *ticks[:20], *armed) == "20°, then 0°"
    assert goal("late", *ticks) == "0°"
    assert goal("never armed", *({**each, "goal_heading_deg": None} for each in ticks)) == "none"


def test_further_numbers_are_columns_of_all_ticks_and_only_so_many(tmp_path: Path) -> None:
    ticks = [tick(0.0), tick(0.05, moon_deg=1.0), tick(0.1, moon_deg="new"), tick(0.15, moon_deg=2, sun=True)]
    data = data_of(tmp_path / "few", HEADER, *ticks)
    assert list(data.further) == ["moon_deg"]
    np.testing.assert_array_equal(data.further["moon_deg"], [np.nan, 1.0, np.nan, 2.0])
    many = {f"\x1b{number}": number for number in range(1000)}
    panels = panels_of(data_of(tmp_path / "many", HEADER, *drive(1.0), tick(1.0, **many)))
    assert [panel.title for panel in panels[-2:]] == ["\\x1b10", "\\x1b11"]


def test_lost_records_are_no_late_tick(tmp_path: Path) -> None:
    late = [*drive(1.0), tick(1.5), *(tick(1.55 + 0.05 * step) for step in range(20))]
    assert line_of("period", data_of(tmp_path / "late", HEADER, *late)) is not None
    numbered = [{**each, "n": number + (6 if number > 19 else 1)} for number, each in enumerate(late)]
    data = data_of(tmp_path / "lost", HEADER, *numbered)
    assert line_of("period", data) is None
    assert "5 records are missing" in str(data.damage)


ODD: list[Json] = [
    {"heading_deg": "north", "phase": 7, "why": None, "anomalies": "touched", "level": ["hold"], "side": "left"},
    {"heading_deg": 1e300, "applied_left": None, "applied_right": "full", "counter_deg": {}, "travelled_m": None},
    {"compass": 5, "motion": [], "contact": {"t_s": None}, "anomalies": [None, "eaten", 3]},
    {"motion": {"forward_m": None}, "compass": {"t_s": "now"}, "pitch_deg": None, "roll_deg": -1e15, "phase": "dance"},
    {"motion": {"t_s": 1e12, "forward_m": 1e12, "right_m": 0.0, "quality": 1.0}, "mood": "cheerful", "cause": 4},
    {"motion": {"t_s": 101.0, "forward_m": 5e9, "right_m": 0.0, "quality": 1.0}}, {"t_s": 1e300}, {"t_s": -1e15},
]  # fmt: skip


ODD_EVENTS = [
    event("", 0.2), event("mark", 0.3), noted(0.4, "\x1b[2J\n林 $x$ " + "long " * 100),
    event("goal", 0.5, goal_heading_deg=None), event("sensor_failed", 0.6), event("clock_step", 0.7, by_s="much"),
    event("armed", 0.8, goal_heading_deg="home"), {**event("x", 0.9), "name": None},
    {**fix(1.0, 0.0), "latitude_deg": None}, {**fix(1.1, 0.0), "latitude_deg": 99.0}, fix(1.2, 0.0, None),
    record("board", 1.0, battery_v=None, faults=None), record("truth", 1.0, x_m=None), record("computer", 1.0),
]  # fmt: skip
ODD_HEADERS: list[Json] = [
    {"config": None, "rover": "\x1b[31m\x00\uffff<b>", "seed": "\x07", "t_wall": None},
    {"config": {"vehicle": None, "safety": [], "board": 3, "control_hz": "fast"}, "t_wall": 1e300},
    {"config": {"control_hz": 0.0}, "rover": None, "algorithm": 3, "version": [], "seed": {}, "simulated": "yes"},
]  # fmt: skip


@pytest.mark.parametrize("header", ODD_HEADERS, ids=str)
def test_odd_values_never_break_the_page(tmp_path: Path, header: Json) -> None:
    """Many are in one log; which value breaks which reader is tried in ``tests/fuzz/on_logs.py``."""
    odd = [{**tick(1.0 + 0.05 * at), **each} for at, each in enumerate(ODD)]
    records = [*drive(1.0), *ODD_EVENTS, *odd, *drive(3.0)[30:]]
    check_page(page_of(tmp_path, HEADER | header, *records, {**OUTCOME, "reason": None, "text": 4}))


def times(values: Floats) -> Floats:
    return np.arange(values.size, dtype=np.float64)


def ticks(t_s: list[float], *broken_before: int) -> Columns:
    stretch = np.zeros(len(t_s))
    for at in broken_before:
        stretch[at:] += 1
    return {"t_s": np.array(t_s), "stretch": stretch}


def test_line_is_broken_where_the_log_breaks_off() -> None:
    t_s, values = at_ticks(ticks([0.0, 0.5, 9.0, 9.5, 9.6], 2, 4), np.arange(5.0))
    np.testing.assert_array_equal(values, [0.0, 1.0, np.nan, 2.0, 3.0, np.nan, 4.0])
    assert (np.diff(t_s) >= 0).all()


@given(st.lists(st.floats(0.0, 359.9), min_size=1, max_size=50).map(np.array), st.floats(0.0, 359.0))
def test_headings_never_jump_round_the_back(headings_deg: Floats, centre_deg: float) -> None:
    _, drawn_deg = around((times(headings_deg), headings_deg), centre_deg)
    assert not (np.abs(np.diff(drawn_deg)) > 180.0).any()
    known_deg = drawn_deg[~np.isnan(drawn_deg)]
    apart_deg = (known_deg + centre_deg - headings_deg) % 360.0
    assert np.minimum(apart_deg, 360.0 - apart_deg).max() < 1e-6


def test_heading_that_wavers_at_north_is_one_line() -> None:
    _, drawn_deg = around((times(np.zeros(4)), np.array([359.0, 1.0, 358.0, 2.0])), 0.0)
    assert drawn_deg.tolist() == [-1.0, 1.0, -2.0, 2.0]


@given(st.lists(st.floats(-100.0, 100.0) | st.just(np.nan), min_size=1, max_size=200).map(np.array), st.integers(1, 20))
def test_thin_line_is_short_and_keeps_extremes_ends_and_gaps(values: Floats, bins: int) -> None:
    t_s, kept = thinned((times(values), values), bins)
    gaps = int(np.isnan(kept).sum())
    assert kept.size <= max(2 * bins, 2 * (bins + gaps) + gaps)
    assert (np.diff(t_s) > 0).all()
    np.testing.assert_array_equal(kept, values[t_s.astype(int)])
    if not np.isnan(values).all():
        assert (np.nanmin(kept), np.nanmax(kept)) == (np.nanmin(values), np.nanmax(values))
    for first, last in zip(t_s[:-1].astype(int), t_s[1:].astype(int), strict=True):
        if not np.isnan(values[[first, last]]).any():
            assert not np.isnan(values[first : last + 1]).any(), "a gap was bridged"


def test_spans_join_equal_values_and_end_where_the_log_breaks_off() -> None:
    phases = np.array([1.0, 1.0, 2.0, 2.0, 2.0, np.nan])
    found = spans(ticks([0.0, 0.5, 1.0, 1.5, 9.0, 9.5], 4), phases)
    assert found == [ValueSpan(0.0, 1.0, 1.0), ValueSpan(1.0, 1.5, 2.0), ValueSpan(9.0, 9.5, 2.0)]


def test_more_spans_than_can_be_seen_are_sampled() -> None:
    found = spans(ticks([number * 0.05 for number in range(1000)]), times(np.zeros(1000)) % 3.0, most=50)
    assert 0 < len(found) <= 50
    assert {span.value for span in found} == {0.0, 1.0, 2.0}


@pytest.mark.parametrize("count", [0, 1])
def test_too_little_to_draw_is_no_error(count: int) -> None:
    few = np.zeros(count)
    assert len(spans(ticks([0.0] * count), few)) == count
    assert at_ticks(ticks([0.0] * count), few)[0].size == count
    assert around((few, few), 0.0)[0].size == thinned((few, few))[0].size == count
    assert pieces(np.ones(count, np.bool_), few)[0].size == 0


def test_a_piece_goes_on_to_where_the_next_begins() -> None:
    way = np.arange(6.0)
    inside = np.array([True, True, False, True, False, True])
    east_m, north_m = pieces(inside, way, way + 10.0)
    np.testing.assert_array_equal(east_m, [0.0, 1.0, 2.0, np.nan, 3.0, 4.0, np.nan])
    np.testing.assert_array_equal(north_m, east_m + 10.0)
