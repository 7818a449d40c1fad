"""Figures that one can read: whatever ran, no text lies on another one or outside the figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from tests.experiments.report.campaigns import STRANGERS, names, row, rows_of
from wayfarer.escape.api import Phase
from wayfarer.experiments.report.drawing import house_style, log_distances, save
from wayfarer.experiments.report.escape_figure import escape_figure
from wayfarer.experiments.report.forest_figure import forest_figure, legend_figure
from wayfarer.experiments.report.forest_map import STROKES
from wayfarer.experiments.report.groups import grouped
from wayfarer.experiments.report.paths_figure import paths_figure
from wayfarer.experiments.report.ratio_figure import quantile, ratio_figure, ratios
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import summarise
from wayfarer.experiments.trajectory import Trace, TrajectoryPoint
from wayfarer.simhal.world.generate import generate_forest

Rows = Mapping[str, Sequence[TrialRow]]


def paths_of(rows: Rows) -> Figure:
    return paths_figure(rows, {name: summarise(name, own) for name, own in rows.items()}, [39.0, 41.0])


FIGURES: dict[str, Callable[[Rows], Figure]] = {"paths": paths_of, "escape": escape_figure, "ratio": ratio_figure}
ODD = {
    "one trial": [row("pledge", 0)],
    "one path for all": [row("pledge", n) for n in range(5)],
    "no way out": [row("pledge", n, "entrapped", 1000.0) for n in range(5)],
    "crashes only": [row("pledge", n, "fault", None) for n in range(5)],
    "crashes and one escape": [row("pledge", 0), *(row("pledge", n, "fault", None) for n in range(1, 5))],
    "short paths": [row("pledge", n, "escaped", 0.5 + n / 100) for n in range(5)],
    "a path of no length": [row("pledge", 0, "tipped", 0.0), row("pledge", 1)],
}


@pytest.fixture(autouse=True)
def styled() -> Iterator[None]:
    with house_style():
        yield


def texts(figure: Figure) -> list[tuple[str, Bbox]]:
    """Draw a figure, and return its visible texts with the boxes that they take."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    shown = [text for text in figure.findobj(Text) if isinstance(text, Text) and _is_shown(text)]
    return [(text.get_text(), text.get_window_extent(canvas.get_renderer())) for text in shown]


def _is_shown(text: Text) -> bool:
    if not (text.get_visible() and text.get_text().strip()):
        return False
    axes = text.axes
    return not isinstance(axes, Axes) or _in_view(text, axes)


def _in_view(text: Text, axes: Axes) -> bool:
    """Whether a tick label belongs to a tick within the axes: matplotlib draws no other."""
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        for tick in axis.get_major_ticks():
            if text in (tick.label1, tick.label2):
                shown = tick.label1.get_visible() if text is tick.label1 else tick.label2.get_visible()
                return shown and low <= tick.get_loc() <= high
    return True


def assert_readable(figure: Figure) -> None:
    boxes = texts(figure)
    for (one, box), (other, other_box) in combinations(boxes, 2):
        shared = Bbox.intersection(box, other_box)
        assert shared is None or min(shared.width, shared.height) < 1.0, f"'{one}' lies on '{other}'"
    width_px, height_px = figure.get_size_inches() * figure.dpi
    for text, box in boxes:
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width_px + 1 and box.y1 <= height_px + 1, f"'{text}' is cut"


@pytest.mark.parametrize("count", [1, 3, 10, 12])
@pytest.mark.parametrize("name", FIGURES)
def test_no_texts_collide_and_none_is_cut(name: str, count: int) -> None:
    assert_readable(FIGURES[name](rows_of(names(count))))


@pytest.mark.parametrize("name", FIGURES)
def test_strangers_alone_are_readable(name: str) -> None:
    figure = FIGURES[name](rows_of(STRANGERS))
    assert_readable(figure)
    assert "Others" in [text for text, _ in texts(figure)]


@pytest.mark.parametrize("rows", ODD.values(), ids=ODD)
@pytest.mark.parametrize("name", FIGURES)
def test_odd_campaigns_are_drawn_without_a_warning(name: str, rows: list[TrialRow]) -> None:
    assert_readable(FIGURES[name]({"pledge": rows}))


def test_collision_would_be_found() -> None:
    """The tests above can fail."""
    figure = Figure()
    for at in (0.5, 0.51):
        figure.text(at, 0.5, "here")
    with pytest.raises(AssertionError, match="'here' lies on 'here'"):
        assert_readable(figure)
    figure = Figure()
    figure.text(0.99, 0.5, "beyond the edge")
    with pytest.raises(AssertionError, match="is cut"):
        assert_readable(figure)


def test_algorithms_stand_in_the_papers_groups() -> None:
    groups = grouped(["someone:zig_zag", "cv-react", "levy-walk", "levy-pledge", "pledge"])
    assert [(group.title, group.algorithms) for group in groups] == [
        ("Pledge-inspired", ["levy-pledge", "pledge"]),
        ("Stochastic", ["levy-walk"]),
        ("Reactive", ["cv-react"]),
        ("Others", ["someone:zig_zag"]),
    ]


def test_papers_figure_shows_what_the_rows_say() -> None:
    rows = [row("forest-pledge", n, "escaped", path_m) for n, path_m in enumerate((50.0, 60.0, 70.0, 80.0, 90.0))]
    figure = paths_of({"forest-pledge": [*rows, row("forest-pledge", 5, "entrapped", 1000.0)]})
    paths, failures = figure.axes
    lines = [np.asarray(line.get_xdata()).tolist() for line in paths.lines]
    assert [70.0, 70.0] in lines  # median
    assert [81.3] in lines  # the paper's mean
    assert [40.0, 40.0] in lines  # mean shortest path
    assert 90.0 < paths.get_xlim()[1] < 200.0, "the path of a failure is no path of a success"
    bars = [patch.get_extents().transformed(failures.transData.inverted()).width for patch in failures.patches]
    assert bars == pytest.approx([100 / 6])
    assert "16.7" in [text for text, _ in texts(figure)]


def test_papers_mean_and_shortest_path_are_in_view_however_far_off() -> None:
    paths = paths_of({"levy-walk": [row("levy-walk", n, path_m=1.0 + n) for n in range(5)]}).axes[0]
    low, high = paths.get_xlim()
    assert low < 1.0
    assert high > 247.5


def test_ratio_counts_failures_as_endless() -> None:
    rows = [row("pledge", n, "escaped", 39.0 * (n + 1)) for n in range(3)]
    found = ratios([row("pledge", 3, "entrapped", 50.0), *rows, row("pledge", 4)._replace(shortest_path_m=None)])
    assert found == [1.0, 2.0, 3.0, math.inf]
    assert [quantile(found, share) for share in (0.05, 0.25, 0.5, 0.51, 0.75, 0.95)] == [
        1.0,
        1.0,
        2.0,
        3.0,
        3.0,
        math.inf,
    ]


@pytest.mark.parametrize("values", [[60.0], [61.0, 64.0], [37.5, 1000.0], [0.5, 0.6], [3.0, 250_000.0]])
def test_distances_are_all_in_view_between_two_ticks_at_least(values: list[float]) -> None:
    axes = Figure().subplots()
    log_distances(axes, values)
    low, high = axes.get_xlim()
    assert low <= min(values) <= max(values) <= high
    assert sum(low <= tick <= high for tick in axes.get_xticks()) >= 2


def test_every_phase_has_its_colour_and_no_two_share_one() -> None:
    assert sorted(phase.value for stroke in STROKES for phase in stroke.phases) == sorted(
        phase.value for phase in Phase
    )
    assert len({stroke.colour for stroke in STROKES}) == len(STROKES)


def test_way_is_drawn_whole_each_piece_in_the_colour_of_its_phase() -> None:
    trace = Trace([TrajectoryPoint(25.0, 12.5 + n, phase) for n, phase in enumerate(Phase)], [(25.0, 14.0)])
    axes = forest_figure(generate_forest(0, 0, 0), trace).axes[0]
    for stroke in STROKES:
        line = next(line for line in axes.lines if line.get_color() == stroke.colour and line.get_linestyle() == "-")
        starts = {12.5 + n for n, phase in enumerate(Phase) if phase in stroke.phases and n < len(Phase) - 1}
        assert starts <= set(np.asarray(line.get_ydata()).tolist())


def test_drawings_of_forests_are_readable() -> None:
    assert_readable(forest_figure(generate_forest(0, 0, 0), Trace([TrajectoryPoint(25.0, 12.5, Phase.FOLLOW)], [])))
    assert_readable(legend_figure())


def test_drawing_is_described_has_ids_of_its_own_and_two_files(tmp_path: Path) -> None:
    first, second = (save(legend_figure(), tmp_path, name, 'a < b & "c"') for name in ("one", "two"))
    assert {path.name for path in tmp_path.iterdir()} == {"one.png", "one.svg", "two.png", "two.svg"}
    element = ElementTree.fromstring(first.svg.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1))
    assert element.attrib["aria-label"] == 'a < b & "c"'
    ids = [
        [each.attrib["id"] for each in ElementTree.fromstring(svg).iter() if "id" in each.attrib]
        for svg in (first.svg, second.svg)
    ]
    assert ids[0]
    assert not set(ids[0]) & set(ids[1])
    referred = {each.attrib[key][1:] for each in element.iter() for key in each.attrib if key.endswith("href")}
    assert referred <= set(ids[0])
