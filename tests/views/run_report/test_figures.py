"""The figures of one run: no text lies on another, axes are true, and extremes are seen."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import combinations
from math import dist
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from tests.views.run_report.logs import HEADER, WORLD, drive, episode, fix, tick, without, write_log
from tests.views.text.records import event, record
from wayfarer.fieldlog.reader import Record
from wayfarer.simhal.world.forest_file import from_row
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.drawing import house_style, save
from wayfarer.views.run_report.event_rows import MOST, event_rows
from wayfarer.views.run_report.map import spread_badges
from wayfarer.views.run_report.reading import read_run
from wayfarer.views.run_report.timeline import timeline_figure
from wayfarer.views.run_report.track import forest_track_figure, track_figure

Overlaps = Callable[[Figure], list[tuple[str, str]]]


@pytest.fixture(autouse=True)
def _style() -> Iterator[None]:
    with house_style(), matplotlib.rc_context({"figure.constrained_layout.use": False}):
        yield


def data_of(tmp_path: Path, *records: Record) -> RunData:
    return read_run(write_log(tmp_path / "run", [HEADER, *records]))


@pytest.fixture
def overlaps(monkeypatch: pytest.MonkeyPatch) -> Overlaps:
    """Return the pairs of texts of a figure that lie on each other, of those that are really drawn."""
    drawn: list[Text] = []
    draw = Text.draw

    def note(text: Text, renderer: Any) -> None:
        drawn.append(text)
        draw(text, renderer)

    monkeypatch.setattr(Text, "draw", note)

    def find(figure: Figure) -> list[tuple[str, str]]:
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        shown = [text for text in drawn if text.get_visible() and text.get_text().strip()]
        boxes = [(text.get_text(), text.get_window_extent(canvas.get_renderer())) for text in shown]
        assert boxes
        return [(one, other) for (one, box), (other, there) in combinations(boxes, 2) if _covers(box, there)]

    return find


def _covers(one: Bbox, other: Bbox) -> bool:
    common = Bbox.intersection(one, other)
    return common is not None and common.width > 0.5 and common.height > 0.5


def busy(seconds: int) -> list[Record]:
    """A run in which people and parts report something all the time."""
    names = ["hold", "resume", "goal", "loop_stalled", "sensor_failed", "board_silent"]
    reported = [
        event(names[at % 6], 0.37 * at, goal_heading_deg=20.0, sensor="compass") for at in range(int(seconds / 0.37))
    ]
    marked = [event("mark", 1.3 * at, text="a tree that leans " * (at % 3)) for at in range(seconds)]
    board = [record("board", at, battery_v=12.0 - 0.1 * at, faults=[]) for at in range(seconds)]
    return sorted([*drive(seconds), *reported, *marked, *board], key=lambda each: float(each["t_s"]))


@pytest.mark.parametrize("seconds", [2, 12])
def test_texts_of_the_time_lines_do_not_overlap(tmp_path: Path, seconds: int, overlaps: Overlaps) -> None:
    figure, _ = timeline_figure(data_of(tmp_path, *busy(seconds)))
    assert overlaps(figure) == []


def test_texts_of_the_track_do_not_overlap(tmp_path: Path, overlaps: Overlaps) -> None:
    data = data_of(tmp_path, *episode(), *(event("mark", 4.0) for _ in range(12)), fix(4.0, 1.0))
    assert overlaps(track_figure(data)) == []


def test_overlap_is_noticed(overlaps: Overlaps) -> None:
    """The tests above can fail."""
    figure = Figure()
    figure.text(0.5, 0.5, "one")
    figure.text(0.51, 0.5, "another")
    assert len(overlaps(figure)) == 1


def test_kinds_of_events_without_room_are_counted_and_are_those_that_matter_least(tmp_path: Path) -> None:
    marks = [event("mark", 0.1 * at, text="mud") for at in range(MOST)]
    data = data_of(tmp_path, *sorted([*marks, *drive(3.0), event("hold", 1.0)], key=lambda each: float(each["t_s"])))
    figure, left_out = timeline_figure(data)
    assert left_out == 1
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == [f"{at + 1} mud" for at in range(MOST)]


def test_events_of_a_kind_share_a_row_and_long_marks_are_cut(tmp_path: Path) -> None:
    data = data_of(tmp_path, *episode(), event("hold", 5.0), event("mark", 6.0, text="long " * 9), event("hold", 7.0))
    assert [(row.text, len(row.times_s)) for row in event_rows(data)] == [
        ("immobilised", 1), ("nose up", 1), ("1 long long long …", 1), ("hold", 2),
    ]  # fmt: skip


def test_times_in_which_the_wheels_were_held_are_the_last_row(tmp_path: Path) -> None:
    held = [{**each, "level": "hold"} for each in drive(2.0, 1.0)]
    figure, _ = timeline_figure(data_of(tmp_path, *drive(1.0), *held, *drive(4.0, 2.0)))
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == ["held"]
    (bars,) = figure.axes[0].collections[-1].get_paths()
    edges_s = np.asarray(bars.vertices, dtype=float)[:, 0]
    assert (edges_s.min(), edges_s.max()) == pytest.approx((1.0, 2.0))


@given(st.lists(st.tuples(st.floats(0.0, 300.0), st.floats(0.0, 300.0)), max_size=30))
def test_badges_lie_neither_on_each_other_nor_on_their_place(places_pt: list[tuple[float, float]]) -> None:
    badges_pt = spread_badges(places_pt, 10.0)
    assert all(dist(one, other) >= 10.0 - 1e-5 for one, other in combinations(badges_pt, 2))
    assert all(dist(badge, at) >= 10.0 - 1e-9 for badge, at in zip(badges_pt, places_pt, strict=True))


def test_a_metre_is_as_long_to_the_north_as_to_the_east(tmp_path: Path) -> None:
    figure = track_figure(data_of(tmp_path, *drive(4.0)))
    (axes,) = figure.axes
    box = axes.get_window_extent()
    (west_m, east_m), (south_m, north_m) = axes.get_xlim(), axes.get_ylim()
    assert box.width / (east_m - west_m) == pytest.approx(box.height / (north_m - south_m))


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 225.0])
def test_whole_way_is_on_the_map(tmp_path: Path, heading_deg: float) -> None:
    data = data_of(tmp_path, *(tick(0.05 * step, heading_deg=heading_deg) for step in range(200)))
    (axes,) = track_figure(data).axes
    for limits, name in ((axes.get_xlim(), "east_m"), (axes.get_ylim(), "north_m")):
        assert limits[0] < data.ticks[name].min() <= data.ticks[name].max() < limits[1]


def pieces_of(figure: Figure, label: str) -> int:
    """How many unbroken pieces the line of this name has."""
    (line,) = (line for line in figure.axes[0].get_lines() if line.get_label() == label)
    broken = np.concatenate(([True], np.isnan(np.asarray(line.get_xdata())), [True]))
    return int(np.count_nonzero(np.diff(broken)) // 2)


def test_way_is_broken_where_records_are_missing(tmp_path: Path) -> None:
    way = "follow the goal"
    assert pieces_of(track_figure(data_of(tmp_path / "whole", *drive())), way) == 1
    lost = track_figure(data_of(tmp_path / "lost", *without(drive(), 20, 60)))
    assert pieces_of(lost, way) == 2
    assert np.isfinite(lost.axes[0].get_xlim()).all()
    assert pieces_of(lost, "records missing") == 1


def test_way_is_broken_where_the_tick_after_the_gap_has_no_heading(tmp_path: Path) -> None:
    ticks = without(drive(), 20, 60)
    ticks[20]["heading_deg"] = None
    assert pieces_of(track_figure(data_of(tmp_path, *ticks)), "follow the goal") == 2


def test_ways_in_the_forest_are_broken_where_records_are_missing(tmp_path: Path) -> None:
    truth = [record("truth", each["t_s"] - 100.0, x_m=25.0, y_m=each["t_s"] - 87.5) for each in drive()]
    records = [each for pair in zip(drive(), truth, strict=True) for each in pair]
    figure = forest_track_figure(data_of(tmp_path, *without(records, 40, 120)), from_row(WORLD))
    assert pieces_of(figure, "follow the goal") == 2
    assert pieces_of(figure, "dead reckoning") == 2


def test_panels_share_their_axis_of_time(tmp_path: Path) -> None:
    figure, _ = timeline_figure(data_of(tmp_path, *busy(4)))
    panels = [axes for axes in figure.axes if axes.axison and axes.get_ylabel()]
    assert [axes.get_ylabel() for axes in panels] == [
        "heading, °", "turned, °", "pitch, °", "roll, °", "speed, m/s", "battery, V", "period, ms",
    ][: len(panels)]  # fmt: skip
    assert len(panels) >= 6
    assert len({tuple(axes.get_xlim()) for axes in panels}) == 1


def test_nothing_is_drawn_across_a_stall_and_its_length_is_written_in_plain_numbers(
    tmp_path: Path, overlaps: Overlaps
) -> None:
    """The process stood still for 4 s, as by ``kill -STOP``: no record is missing, only time."""
    boards = [record("board", at_s, battery_v=12.0 - at_s / 10.0, faults=[]) for at_s in (0.97, 1.97, 6.02, 7.02)]
    stalled = [tick(at / 20.0) for at in range(41)] + [tick(6.0 + at / 20.0) for at in range(41)]
    figure, _ = timeline_figure(data_of(tmp_path, *sorted([*stalled, *boards], key=lambda each: each["t_s"])))
    for axes in figure.axes:
        for line in (line for line in axes.lines if line.get_linestyle() != "None"):
            x_s, y = (np.asarray(values, dtype=float) for values in line.get_data())
            if x_s.size > 2:  # not a limit, which holds all the time
                ends_s = np.flatnonzero(~np.isnan(y[:-1] + y[1:]))
                assert not ((x_s[ends_s] <= 2.0) & (x_s[ends_s + 1] >= 6.0)).any(), line.get_label()
    period = next(axes for axes in figure.axes if axes.get_ylabel() == "period, ms")
    assert overlaps(figure) == []
    shown = [text.get_text() for text in period.get_yticklabels() if text.get_text()]
    assert {"100", "1000"} <= set(shown)
    assert all(text.isdecimal() for text in shown)


def test_an_hour_is_drawn_in_few_points_without_losing_a_single_tilted_tick(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).normal(size=72_000)
    ticks = [tick(0.05 * step, pitch_deg=float(noise[step])) for step in range(72_000)]
    ticks[3210]["pitch_deg"] = 33.0
    figure, _ = timeline_figure(data_of(tmp_path, *ticks))
    svg = save(figure, tmp_path, "time-lines", "").svg
    assert len(svg) < 1_500_000
    (axes,) = (axes for axes in figure.axes if axes.get_ylabel() == "pitch, °")
    _, top_px = axes.transData.transform((0.0, 33.0))
    heights = {
        float(y) for line in re.findall(r' d="(M[^"]*)"', svg) for y in re.findall(r"[ML] [\d.]+ ([\d.]+)", line)
    }
    top_pt = (figure.bbox.height - top_px) * 72.0 / figure.dpi
    assert any(abs(each - top_pt) < 0.2 for each in heights)


def test_time_is_in_minutes_where_the_run_is_long(tmp_path: Path) -> None:
    figure, _ = timeline_figure(data_of(tmp_path, *drive(1.0), tick(1200.0)))
    assert figure.axes[-1].get_xlabel() == "time since the beginning, min"
