"""Figure of the paper's simulations: path lengths by algorithm and group, beside the paper's."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.models.annotations import Span

from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.report.algorithm_rows import Rows, grouped, lay_out, plain_numbers, rows_plot, span_of
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import AlgorithmSummary
from wayfarer.experiments.tables import PaperFigures, mean_and_sd
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, source

ROW_PX = 52
BINS = 48  # of all paths, of equal width on the logarithmic axis
WHISKERS_IQR = 1.5  # Tukey's
# Places in a row, from its middle down: the histogram's foot, the box, our mean and the paper's.
FOOT, BOX, OURS, PAPERS = -0.02, 0.12, 0.29, 0.41
HISTOGRAM, BOX_HIGH = 0.44, 0.2

ByAlgorithm = Mapping[str, Sequence[TrialRow]]


class Box(NamedTuple):
    """The paths of an algorithm's successes, metres: quartiles, whiskers, and which trials lie beyond these."""

    low_m: float
    first_m: float
    median_m: float
    third_m: float
    high_m: float
    beyond: list[TrialRow]
    successes: list[TrialRow]


def boxes_of(by_algorithm: ByAlgorithm) -> dict[str, Box]:
    """Return the box of each algorithm that has successes; whiskers go to the last path within 1.5 quartile ranges."""
    return {name: _box_of(rows) for name, own in by_algorithm.items() if (rows := _successes(own))}


def _box_of(rows: list[TrialRow]) -> Box:
    first_m, median_m, third_m = np.percentile(_paths_m(rows), [25, 50, 75]).tolist()
    room_m = WHISKERS_IQR * (third_m - first_m)
    inside = {row for row in rows if first_m - room_m <= (row.path_m or 0.0) <= third_m + room_m}
    within_m = [row.path_m or 0.0 for row in inside]
    beyond = [row for row in rows if row not in inside]
    return Box(min(within_m), first_m, median_m, third_m, max(within_m), beyond, rows)


def paths_figure(
    by_algorithm: ByAlgorithm, summaries: Mapping[str, AlgorithmSummary], shortest_paths_m: Sequence[float],
    papers: Mapping[str, PaperFigures],
) -> Figure:  # fmt: skip
    """Return the successes' paths as histogram and box plot, with mean and standard deviation beside the paper's."""
    layout = lay_out(grouped(by_algorithm))
    boxes = boxes_of(by_algorithm)
    paths = {name: box.successes for name, box in boxes.items()}
    shortest_m = [statistics.fmean(shortest_paths_m)] if shortest_paths_m else []
    papers = {name: papers[name] for name in layout.at if name in papers}
    seen_m = [row.path_m or 0.0 for rows in paths.values() for row in rows]
    low_m, high_m = span_of([*seen_m, *shortest_m, *(paper.path_mean_m for paper in papers.values())])
    made = rows_plot(
        "paths", layout, ROW_PX, "path to the destination line, m (logarithmic)", low_m, high_m, x_axis_type="log"
    )
    plain_numbers(made)
    _histograms(made, layout, paths, np.geomspace(low_m, high_m, BINS + 1))
    _boxes(made, layout, boxes)
    ours = {name: (summaries[name].path_mean_m, summaries[name].path_sd_m) for name in paths}
    theirs = {name: (paper.path_mean_m, paper.path_sd_m) for name, paper in papers.items()}
    _means(made, layout, ours, OURS, "ours", palette.BLUE, low_m)
    _means(made, layout, theirs, PAPERS, "the paper's", palette.VERMILION, low_m)
    for at_m in shortest_m:
        made.add_layout(Span(location=at_m, dimension="height", line_color=palette.GOAL_LINE, line_dash=[5, 3]))
    return made


def _successes(rows: Sequence[TrialRow]) -> list[TrialRow]:
    return [row for row in rows if row.outcome in SUCCESSES and row.path_m]


def _paths_m(rows: Sequence[TrialRow]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([row.path_m for row in rows])


def _histograms(made: Figure, layout: Rows, paths: ByAlgorithm, edges_m: Any) -> None:
    """Draw how many trials had a path of which length; the highest bar of each algorithm is as high as its place."""
    counts = {name: np.histogram(_paths_m(rows), edges_m)[0] for name, rows in paths.items()}
    foots = [layout.at[name] + FOOT for name, count in counts.items() for _ in count]
    highs = [HISTOGRAM * each / max(count.max(), 1) for count in counts.values() for each in count]
    bars = source(
        left=np.tile(edges_m[:-1], len(counts)), right=np.tile(edges_m[1:], len(counts)),
        bottom=foots, top=np.subtract(foots, highs), count=[each for count in counts.values() for each in count],
        algorithm=[name for name, count in counts.items() for _ in count],
    )  # fmt: skip
    drawn = made.quad(
        "left", "right", "top", "bottom", source=bars, color=palette.BLUE, alpha=0.45, line_width=0, name="histogram"
    )
    rows = (("algorithm", "@algorithm"), ("path", "@left{0.0} to @right{0.0} m"), ("trials", "@count"))
    made.add_tools(hover([drawn], *rows))


def _boxes(made: Figure, layout: Rows, boxes: Mapping[str, Box]) -> None:
    """Draw the boxes with their whiskers, and every path beyond."""
    box = source(
        algorithm=list(boxes), y=[layout.at[name] + BOX for name in boxes], low=[each.low_m for each in boxes.values()],
        first=[each.first_m for each in boxes.values()], median=[each.median_m for each in boxes.values()],
        third=[each.third_m for each in boxes.values()], high=[each.high_m for each in boxes.values()],
    )  # fmt: skip
    made.segment("low", "y", "high", "y", source=box, line_color=palette.BLUE)
    drawn = made.hbar(
        "y", BOX_HIGH, "third", "first", source=box, name="boxes", line_color=palette.BLUE, fill_color=palette.BLUE,
        fill_alpha=0.25,
    )  # fmt: skip
    made.scatter("median", "y", source=box, marker="dash", angle=np.pi / 2, size=13, line_width=3, color=palette.BLUE)
    rows_told = (
        ("algorithm", "@algorithm"), ("median", "@median{0.0} m"), ("quartiles", "@first{0.0} to @third{0.0} m"),
        ("whiskers", "@low{0.0} to @high{0.0} m"),
    )  # fmt: skip
    made.add_tools(hover([drawn], *rows_told))
    _outliers(made, layout, [row for each in boxes.values() for row in each.beyond])


def _outliers(made: Figure, layout: Rows, rows: Sequence[TrialRow]) -> None:
    points = source(
        x=[row.path_m for row in rows], y=[layout.at[row.algorithm] + BOX for row in rows],
        algorithm=[row.algorithm for row in rows], trial=[row.trial for row in rows],
        forest=[row.forest for row in rows], noise=[row.noise for row in rows],
    )  # fmt: skip
    look: Any = {"fill_color": None, "line_color": palette.GREY, "line_width": 0.7}
    drawn = made.scatter("x", "y", source=points, size=4, name="outliers", **look)
    trial = ("trial", "@trial (forest @forest, noise @noise)")
    made.add_tools(hover([drawn], ("algorithm", "@algorithm"), trial, ("path", "@x{0.0} m")))


def _means(
    made: Figure, layout: Rows, means: Mapping[str, tuple[float | None, float | None]], below: float, whose: str,
    colour: str, low_m: float,
) -> None:  # fmt: skip
    """Draw means with one standard deviation to each side, as far as the axis goes."""
    known = [(name, mean, sd or 0.0, mean_and_sd(mean, sd)) for name, (mean, sd) in means.items() if mean is not None]
    points = source(
        algorithm=[name for name, *_ in known], y=[layout.at[name] + below for name, *_ in known],
        mean=[mean for _, mean, _, _ in known], low=[max(low_m, mean - sd) for _, mean, sd, _ in known],
        high=[mean + sd for _, mean, sd, _ in known], text=[text for *_, text in known],
    )  # fmt: skip
    line = made.segment("low", "y", "high", "y", source=points, line_color=colour, line_width=2, name=f"SD, {whose}")
    mean = made.scatter("mean", "y", source=points, marker="diamond", size=9, color=colour, name=f"mean, {whose}")
    made.add_tools(hover([line, mean], ("algorithm", "@algorithm"), (f"mean ± SD, {whose}", "@text m")))
