"""Figures of a campaign: paths by algorithm and group, beside the paper's; escapes by path; paired differences."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import CustomJSTicker, FixedTicker, NumeralTickFormatter
from bokeh.models.annotations import Label, Legend, LegendItem, Span
from bokeh.plotting import ColumnDataSource

from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.measures import Estimate, Measure
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.paper import Reported
from wayfarer.experiments.rows import TrialRow
from wayfarer.logview import palette
from wayfarer.reports.page.plots import Figure, hover, plot, source

# -- escapes ---------------------------------------------------------------------------------------------------------
# Figure: cumulative escapes over distance, a curve for each algorithm.

CURVES_PX, LEGEND_ROW_PX = 320, 18  # the legend stands below zero, where no curve runs
AXIS_PX = 70
DASHES: tuple[tuple[int, ...], ...] = ((), (7, 2), (2, 2), (8, 2, 2, 2))  # not as many as colours: 20 looks


LEGEND: Mapping[str, Any] = {
    "location": "bottom_right",
    "click_policy": "hide",
    "background_fill_color": None,
    "border_line_color": None,
    "label_text_font_size": "11px",
    "glyph_width": 32,
    "spacing": -4,
    "padding": 0,
    # Bokeh reads --bk-label-text-color before the legend has a place in the page, and finds none.
    "stylesheets": [".bk-label { color: var(--ink) !important; }"],
}


class Curve(NamedTuple):
    """The paths of an algorithm's trials, metres, ascending: of those that escaped, and of those that failed."""

    escaped_m: list[float]
    failed_m: list[float]
    trials: int

    @property
    def escaped_percent(self) -> float:
        """The share of all trials that escaped."""
        return 100.0 * len(self.escaped_m) / self.trials

    def steps(self, first_m: float) -> tuple[list[float], list[float]]:
        """Return where the curve grows and to how many percent, from a path on up to the end of the longest trial."""
        percent = [100.0 * number / self.trials for number in range(len(self.escaped_m) + 1)]
        last_m = max([first_m, *self.escaped_m, *self.failed_m])
        return [first_m, *self.escaped_m, last_m], [*percent, percent[-1]]


def escape_curve(rows: Sequence[TrialRow]) -> Curve:
    """Return the cumulative incidence of escape: which share of all trials has escaped by a path of that length.

    A failure is an end like an escape, not a trial that was lost from sight: it counts as not escaped at any length.
    (Kaplan-Meier would let those under way make up for it, and ends above the share of successes: J. P. Fine, R. J.
    Gray, JASA 94, 1999, on competing risks.) So the curve ends at the success of the results' table.
    """
    escaped_m, failed_m = (
        sorted(row.path_m for row in rows if (row.outcome in SUCCESSES) is out and row.path_m is not None)
        for out in (True, False)
    )
    return Curve(escaped_m, failed_m, len(rows))


def escape_figure(by_algorithm: Mapping[str, Sequence[TrialRow]]) -> Figure:
    """Return the figure: escapes by path length."""
    names = [name for group in grouped(by_algorithm) for name in group.algorithms]
    curves = {name: escape_curve(by_algorithm[name]) for name in names}
    escaped_m = [path_m for curve in curves.values() for path_m in curve.escaped_m]
    span_m = span_of(escaped_m or [path_m for curve in curves.values() for path_m in curve.failed_m])
    legend_px = LEGEND_ROW_PX * (1 + len(curves))
    made = plot(
        "escape", CURVES_PX + legend_px + AXIS_PX, "both", x_axis_type="log", output_backend=SVG, x_range=span_m,
        y_range=(-102.0 * legend_px / CURVES_PX, 102.0),
    )  # fmt: skip
    made.yaxis.bounds = made.ygrid.bounds = (0.0, 100.0)
    plain_numbers(made)
    made.xaxis.axis_label, made.yaxis.axis_label = "path driven, m (logarithmic)", "escaped, % of all trials"
    places = {name: place for place, name in enumerate(by_algorithm)}
    items = [_curve(made, places[name], name, curve, span_m[0]) for name, curve in curves.items()]
    made.add_layout(Legend(items=items, **LEGEND))
    return made


def _stairs(curve: Curve, first_m: float) -> ColumnDataSource:
    """Return a curve as corners: a share holds until the next escape."""
    path_m, percent = curve.steps(first_m)
    return source(x=np.repeat(path_m, 2)[1:], y=np.repeat(percent, 2)[:-1])


def colour_of(place: int) -> str:
    """Return the colour of an algorithm, by its place in the campaign."""
    return palette.SERIES[place % len(palette.SERIES)]


def curve_look(place: int) -> dict[str, Any]:
    """Return the look of an algorithm's curve."""
    return {"line_color": colour_of(place), "line_width": 2, "line_dash": list(DASHES[place % len(DASHES)])}


def _curve(made: Figure, place: int, name: str, curve: Curve, first_m: float) -> LegendItem:
    """Draw a curve, with a mark where its longest failure ended, and return its line of the legend."""
    line: Any = made.line("x", "y", source=_stairs(curve, first_m), name=name, **curve_look(place))
    last_m = curve.failed_m[-1:]
    ended: Any = {"marker": "dash", "angle": np.pi / 2, "size": 11, "line_width": 2, "color": colour_of(place)}
    mark: Any = made.scatter(last_m, [curve.escaped_percent] * len(last_m), **ended)
    made.add_tools(hover([line], ("algorithm", "$name"), ("by", "@x{0.0} m"), ("escaped", "@y{0.0} %")))
    return LegendItem(label=f"{short(name)}, {curve.escaped_percent:.1f} %", renderers=[line, mark])


# -- rows of a figure ------------------------------------------------------------------------------------------------
# Figures with one row per algorithm over a logarithmic axis or over percent, sorted by groups.
#
# The groups are the paper's three, and a fourth for all others.

TITLES = {"pledge": "Pledge-inspired", "stochastic": "Stochastic", "reactive": "Reactive"}  # as in the paper's figure
OTHERS = "Others"
LONGEST_NAME = 18  # letters; a longer name would take the place of the data

HEADING = 0.55  # rows that a group's name takes
MARGINS_PX = 90  # the axis below, and the buttons above: beside few rows there is no place for all of them
EDGE = 1.08  # room beside the first and the last value on a logarithmic axis
SVG = "svg"  # what the save button writes: for papers

BOLD: Mapping[str, Any] = {"text_font_style": "bold", "text_font_size": "11px", "text_baseline": "middle"}
# 1, 2, 5, 10, ... in view, or where it is zoomed too close for two of these, round steps.
ROUND_TICKS = """
const { start, end } = cb_data, powers = [-3, -2, -1, 0, 1, 2, 3, 4, 5];
const steps = powers.flatMap((power) => [1, 2, 5].map((factor) => factor * 10 ** power));
const within = (ticks) => ticks.filter((tick) => start <= tick && tick <= end);
if (end > 5 * start) return within(steps);
const step = steps.find((each) => (end - start) / each <= 7);
return within([...Array(9).keys()].map((at) => (Math.floor(start / step) + at) * step));
"""


class Group(NamedTuple):
    """Algorithms of one kind."""

    title: str
    algorithms: list[str]


def grouped(algorithms: Iterable[str]) -> list[Group]:
    """Return the groups that occur, in the paper's order."""
    members: dict[str, list[str]] = {title: [] for title in (*TITLES.values(), OTHERS)}
    for name in algorithms:
        members[TITLES[CATALOGUE[name].family] if name in CATALOGUE else OTHERS].append(name)
    return [Group(title, names) for title, names in members.items() if names]


def short(name: str) -> str:
    """Return a name that fits beside an axis: of ``package.module:attribute`` the end says the most."""
    return name if len(name) <= LONGEST_NAME else "…" + name[1 - LONGEST_NAME :]


@dataclass
class Rows:
    """Where each algorithm and each heading is, in rows from the top."""

    at: dict[str, float] = field(default_factory=dict)
    headings: list[tuple[float, str]] = field(default_factory=list)
    rows: float = 0.0


def lay_out(groups: Iterable[Group]) -> Rows:
    """Return the rows for these groups; an algorithm is in the middle of its row."""
    layout = Rows()
    for group in groups:
        layout.headings.append((layout.rows + HEADING / 2, group.title))
        layout.rows += HEADING
        for name in group.algorithms:
            layout.at[name] = layout.rows + 0.5
            layout.rows += 1.0
    return layout


def rows_plot(name: str, layout: Rows, row_px: int, label: str, low: float, high: float, **settings: Any) -> Figure:
    """Return an empty figure with the algorithms' names at the left, and ``label`` under x from ``low`` to ``high``."""
    made = plot(
        name,
        round(layout.rows * row_px) + MARGINS_PX,
        "width",
        x_range=(low, high),
        y_range=(layout.rows, 0.0),
        output_backend=SVG,
        toolbar_location="above",
        **settings,
    )
    made.yaxis.ticker = FixedTicker(ticks=list(layout.at.values()))
    made.yaxis.major_label_overrides = {y: short(name) for name, y in layout.at.items()}
    made.yaxis.axis_line_width = made.yaxis.major_tick_in = made.yaxis.major_tick_out = 0
    made.ygrid.visible = False
    made.xaxis.axis_label = label
    for y, title in layout.headings:
        made.add_layout(Label(x=4, y=y, x_units="screen", text=title, **BOLD))
    for y, _ in layout.headings[1:]:
        made.add_layout(Span(location=y - HEADING / 2, dimension="width", line_color=palette.GREY, line_width=0.5))
    return made


def span_of(values: Iterable[float]) -> tuple[float, float]:
    """Return the ends of a logarithmic axis with room for these values; those above 0 have a place on it."""
    shown = [value for value in values if value > 0.0] or [10.0, 100.0]
    return min(shown) / EDGE, max(shown) * EDGE


def plain_numbers(made: Figure) -> None:
    """Label a logarithmic x with 10, 20, 50, ... instead of powers."""
    made.xaxis.ticker = made.xgrid.ticker = CustomJSTicker(major_code=ROUND_TICKS)
    made.xaxis.formatter = NumeralTickFormatter(format="0.[00]")


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
    within_m = [path_m for path_m in _paths_m(rows) if first_m - room_m <= path_m <= third_m + room_m]
    beyond = [row for row in rows if not min(within_m) <= (row.path_m or 0.0) <= max(within_m)]
    return Box(min(within_m), first_m, median_m, third_m, max(within_m), beyond, rows)


def paths_figure(by_algorithm: ByAlgorithm, shortest_paths_m: Sequence[float], papers: Reported) -> Figure:
    """Return the successes' paths as histogram and box plot, with mean and standard deviation beside the paper's."""
    layout = lay_out(grouped(by_algorithm))
    boxes = boxes_of(by_algorithm)
    paths = {name: box.successes for name, box in boxes.items()}
    shortest_m = [statistics.fmean(shortest_paths_m)] if shortest_paths_m else []
    theirs = {
        name: (paper["path_m"], paper["path_sd_m"]) for name in layout.at if "path_m" in (paper := papers.get(name, {}))
    }
    seen_m = [row.path_m or 0.0 for rows in paths.values() for row in rows]
    low_m, high_m = span_of([*seen_m, *shortest_m, *(mean_m for mean_m, _ in theirs.values())])
    made = rows_plot(
        "paths", layout, ROW_PX, "path to the destination line, m (logarithmic)", low_m, high_m, x_axis_type="log"
    )
    plain_numbers(made)
    _histograms(made, layout, paths, np.geomspace(low_m, high_m, BINS + 1))
    _boxes(made, layout, boxes)
    ours = {
        name: (statistics.fmean(found_m), statistics.stdev(found_m) if len(found_m) > 1 else 0.0)
        for name, rows in paths.items()
        if (found_m := _paths_m(rows).tolist())
    }
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
    made: Figure, layout: Rows, means: Mapping[str, tuple[float, float]], below: float, whose: str, colour: str,
    low_m: float,
) -> None:  # fmt: skip
    """Draw means with one standard deviation to each side, as far as the axis goes."""
    known = [(name, mean, sd, f"{mean:.1f} ± {sd:.1f}") for name, (mean, sd) in means.items()]
    points = source(
        algorithm=[name for name, *_ in known], y=[layout.at[name] + below for name, *_ in known],
        mean=[mean for _, mean, _, _ in known], low=[max(low_m, mean - sd) for _, mean, sd, _ in known],
        high=[mean + sd for _, mean, sd, _ in known], text=[text for *_, text in known],
    )  # fmt: skip
    line = made.segment("low", "y", "high", "y", source=points, line_color=colour, line_width=2, name=f"SD, {whose}")
    mean = made.scatter("mean", "y", source=points, marker="diamond", size=9, color=colour, name=f"mean, {whose}")
    made.add_tools(hover([line, mean], ("algorithm", "@algorithm"), (f"mean ± SD, {whose}", "@text m")))


# -- paired comparison -----------------------------------------------------------------------------------------------

GAIN_ROW_PX = 34
GAIN_ROOM = 0.06  # of the axis, beside the first and the last interval


def gain_figure(measure: Measure, found: dict[str, Estimate]) -> Figure:
    """Return a forest plot: an algorithm a row, its mean difference with the 95 % interval, and a line at 0."""
    layout = lay_out(grouped(found))
    ends = {name: each.ends for name, each in found.items()}
    low, high = min(0.0, *(each[0] for each in ends.values())), max(0.0, *(each[1] for each in ends.values()))
    room = GAIN_ROOM * (high - low) or 1.0
    better = "right: better" if measure.better == "more" else "left: better"
    label = f"{measure.title}{measure.points and f', {measure.points}'} ({better})"
    made = rows_plot(f"comparison, {measure.title}", layout, GAIN_ROW_PX, label, low - room, high + room)
    made.add_layout(Span(location=0.0, dimension="height", line_color=palette.GREY, line_dash=[5, 3]))
    points = source(
        algorithm=list(found), y=[layout.at[name] for name in found], pairs=[each.trials for each in found.values()],
        mean=[each.value for each in found.values()], low=[each[0] for each in ends.values()],
        high=[each[1] for each in ends.values()],
        text=[each.text(measure.decimals, "+") for each in found.values()],
    )  # fmt: skip
    line = made.segment("low", "y", "high", "y", source=points, line_color=palette.BLUE, line_width=3)
    mean = made.scatter("mean", "y", source=points, marker="square", size=9, color=palette.BLUE, name=measure.name)
    told = (("algorithm", "@algorithm"), ("difference [95 %]", "@text"), ("pairs", "@pairs"))
    made.add_tools(hover([line, mean], *told))
    return made
