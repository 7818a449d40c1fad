"""Figures show what the rows say, whatever ran."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import pytest

from tests.reports.campaigns import STRANGERS, names, row, rows_of
from tests.reports.reading_plots import columns, names_of_rows
from wayfarer.escape.api import Phase
from wayfarer.experiments.measures import COMPARED, compare
from wayfarer.experiments.paper import FORESTS
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.tables import comparison_table
from wayfarer.experiments.trial_log import Trajectory, TrajectoryPoint
from wayfarer.logview import palette
from wayfarer.reports.figures import escape_figure, gain_figure, grouped, lay_out, paths_figure
from wayfarer.reports.page.plots import Figure, Plots
from wayfarer.reports.worst_trials import path_in, trial_map
from wayfarer.simhal.world.generate import generate_forest

Rows = Mapping[str, Sequence[TrialRow]]


def paths_of(rows: Rows) -> Figure:
    return paths_figure(rows, [39.0, 41.0], FORESTS)


FIGURES: dict[str, Callable[[Rows], Figure]] = {"paths": paths_of, "escape": escape_figure}
ODD = {
    "one trial": [row("pledge", 0)],
    "one path for all": [row("pledge", n) for n in range(5)],
    "no way out": [row("pledge", n, "entrapped", 1000.0) for n in range(5)],
    "crashes only": [row("pledge", n, "fault", None) for n in range(5)],
    "crashes and one escape": [row("pledge", 0), *(row("pledge", n, "fault", None) for n in range(1, 5))],
    "short paths": [row("pledge", n, "escaped", 0.5 + n / 100) for n in range(5)],
    "a path of no length": [row("pledge", 0, "tipped", 0.0), row("pledge", 1)],
}


@pytest.mark.parametrize("rows", ODD.values(), ids=ODD)
@pytest.mark.parametrize("name", FIGURES)
def test_odd_campaigns_are_drawn_without_a_warning(name: str, rows: list[TrialRow]) -> None:
    figure: Any = FIGURES[name]({"pledge": rows})
    plots = Plots()
    plots.place(figure)
    assert plots.to_json()
    assert 0.0 <= figure.x_range.start < figure.x_range.end < math.inf


def test_rows_are_the_algorithms_in_their_groups() -> None:
    assert names_of_rows(paths_of(rows_of(names(12)))) == [
        label for group in grouped(names(12)) for label in map(_label, group.algorithms)
    ]


def _label(name: str) -> str:
    return name if len(name) <= 18 else "…" + name[-17:]


def test_algorithms_stand_in_the_papers_groups() -> None:
    groups = grouped([STRANGERS[1], "cv-react", "levy-walk", "levy-pledge", "pledge"])
    assert [(group.title, group.algorithms) for group in groups] == [
        ("Pledge-inspired", ["levy-pledge", "pledge"]),
        ("Stochastic", ["levy-walk"]),
        ("Reactive", ["cv-react"]),
        ("Others", [STRANGERS[1]]),
    ]
    assert [title for _, title in lay_out(groups).headings] == [group.title for group in groups]


def test_papers_figure_shows_what_the_rows_say() -> None:
    rows = [row("forest-pledge", n, "escaped", path_m) for n, path_m in enumerate((50.0, 60.0, 70.0, 80.0, 390.0))]
    shown = {"forest-pledge": [*rows, row("forest-pledge", 5, "entrapped", 1000.0)]}
    figure = paths_of(shown)
    box = columns(figure, "boxes")
    assert [box[name] for name in ("low", "first", "median", "third", "high")] == [[50], [60], [70], [80], [80]]
    beyond = columns(figure, "outliers")
    assert (beyond["x"], beyond["trial"]) == ([390], [4])
    assert columns(figure, "mean, ours")["text"] == ["130.0 ± 145.8"]
    assert columns(figure, "mean, the paper's")["text"] == ["81.3 ± 29.3"]
    assert columns(figure, "mean, the paper's")["high"] == pytest.approx([110.6])
    assert sum(columns(figure, "histogram")["count"]) == len(rows), "the path of a failure is no path of a success"


def test_papers_mean_and_shortest_path_are_in_view_however_far_off() -> None:
    figure: Any = paths_of({"levy-walk": [row("levy-walk", n, path_m=1.0 + n) for n in range(5)]})
    assert figure.x_range.start < 1.0
    assert figure.x_range.end > 247.5


def test_forest_plot_shows_the_numbers_of_the_table_beside_zero() -> None:
    base, *others = compare([each for own in rows_of(names(4)).values() for each in own], "forest-pledge")
    table = comparison_table([base, *others])
    for column, measure in enumerate(COMPARED, start=1):
        found = {one.algorithm: change for one in others if (change := one.changes[measure.name])}
        figure: Any = gain_figure(measure, found)
        drawn = columns(figure, measure.name)
        assert drawn["algorithm"] == names_of_rows(figure) == ["pledge", "rand-pledge", "cv-pledge"]
        assert drawn["text"] == [cells[column] for _, cells in table.rows[1:]]
        assert figure.x_range.start < min(0.0, *drawn["low"]) <= max(0.0, *drawn["high"]) < figure.x_range.end


# --- the map of a trial


def test_way_is_drawn_whole_each_piece_in_its_phase() -> None:
    points = [TrajectoryPoint(25.0, 12.5 + n, phase) for n, phase in enumerate([*Phase, *Phase])]
    drawn = {phase: path_in(points, phase)[1] for phase in Phase}
    pieces = [each for ys in drawn.values() for each in pairwise(ys) if not math.isnan(sum(each))]
    assert sorted(pieces) == [(12.5 + n, 13.5 + n) for n in range(len(points) - 1)]


@pytest.mark.parametrize("slips_m", [[], [(25.0, 14.0)]])
def test_every_phase_that_moves_is_a_layer_of_the_map(slips_m: list[tuple[float, float]]) -> None:
    points = [TrajectoryPoint(25.0, 12.5 + n, Phase.FOLLOW, float(n)) for n in range(9)]
    figure = trial_map("worst", generate_forest(0, 0, 0), Trajectory(points, slips_m))
    tags = {tag for renderer in figure.renderers for tag in renderer.tags}
    assert tags == {f"layer:{phase}" for phase in palette.PHASE_COLOURS} | {"layer:slips"}
