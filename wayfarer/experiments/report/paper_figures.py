"""Figures of a campaign for papers, as SVG and PDF for one column and for two, drawn by Matplotlib.

They show what the page shows, from the same numbers. Text stays text: PDF embeds its font, SVG names it. A reader's
``matplotlibrc`` has no effect, and no date is kept: the same results and the same Matplotlib give the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from wayfarer.errors import BadInput
from wayfarer.experiments.paired_statistics import Comparison
from wayfarer.experiments.report.algorithm_rows import grouped, short, span_of
from wayfarer.experiments.report.comparison import GAINS, compared, span_of_gains
from wayfarer.experiments.report.escape_figure import (
    DASHES,
    ESCAPED_LABEL,
    PATH_LABEL,
    colour_of,
    curve_label,
    escape_curves,
    span_of_curves,
)
from wayfarer.experiments.report.load_results import CampaignResults
from wayfarer.experiments.report.paths_figure import BOX_LABEL, boxes_of
from wayfarer.files import write_atomically
from wayfarer.views import palette

WIDTHS_IN: Mapping[str, float] = {"1col": 3.5, "2col": 7.16}  # of IEEE's columns, 88.9 and 181.9 mm
NO_DATE: Mapping[str, dict[str, None]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
STYLE: Mapping[Any, Any] = {
    "svg.fonttype": "none", "svg.hashsalt": "wayfarer", "pdf.fonttype": 42,  # TrueType: publishers refuse Type 3
    "font.family": "DejaVu Sans", "font.size": 7.0, "axes.linewidth": 0.6, "axes.spines.top": False,
    "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True, "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5, "xtick.major.width": 0.6, "ytick.major.width": 0.6, "lines.linewidth": 1.1,
    "legend.frameon": False, "legend.handlelength": 3.0, "figure.constrained_layout.use": True,
    "text.parse_math": False,  # the name of an algorithm is no formula
}  # fmt: skip
ROW_IN, AXIS_IN, CURVES_IN, LEGEND_LINE_IN = 0.24, 0.5, 2.0, 0.15
ROUND = [factor * 10.0**power for power in range(-2, 6) for factor in (1, 2, 5)]


def write_figures(results: CampaignResults, folder: Path) -> list[Path]:
    """Draw the figures of a campaign into a folder, and return their paths.

    Raises:
        BadInput: they cannot be written there.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        drawn = {folder / name: content for name, content in _drawn(results)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, content in drawn.items():
            write_atomically(path, content)
    except OSError as error:
        raise BadInput(
            f"{folder}: the figures cannot be written there: {error.strerror or error}; name another folder"
        ) from error
    return list(drawn)


def _drawn(results: CampaignResults) -> Iterator[tuple[str, bytes]]:
    draws: dict[str, Callable[[float], Figure]] = {
        "escape-curves": partial(escape_curves_figure, results),
        "paths": partial(paths_figure, results),
    }
    with suppress(BadInput):  # one algorithm, or trials that are no pairs: the page says so
        draws["comparison"] = partial(comparison_figure, compared(results))
    for name, draw in draws.items():
        for columns, width_in in WIDTHS_IN.items():
            figure = draw(width_in)
            for form, metadata in NO_DATE.items():
                file = BytesIO()
                figure.savefig(file, format=form, metadata=metadata)
                yield f"{name}-{columns}.{form}", file.getvalue()


def escape_curves_figure(results: CampaignResults, width_in: float) -> Figure:
    """Return the share of trials that has escaped by a path of which length, for each algorithm."""
    curves = escape_curves(results.by_algorithm)
    span_m = span_of_curves(curves.values())
    columns = 2 if width_in < WIDTHS_IN["2col"] else 4
    height_in = CURVES_IN + LEGEND_LINE_IN * math.ceil(len(curves) / columns)
    figure = Figure(figsize=(width_in, height_in))
    axes = figure.add_subplot(xlabel=PATH_LABEL, ylabel=ESCAPED_LABEL, ylim=(0.0, 102.0))
    lines: list[Line2D] = []
    for place, (name, curve) in enumerate(curves.items()):
        dash = DASHES[place % len(DASHES)]
        path_m, percent = curve.steps(span_m[0])
        lines += axes.step(
            path_m, percent, where="post", color=colour_of(place), linestyle=(0, dash) if dash else "-",
            label=curve_label(name, curve),
        )  # fmt: skip
        if curve.failed_m:
            axes.plot(curve.failed_m[-1], percent[-1], marker="|", color=colour_of(place))
    _logarithmic(axes, span_m)
    # Named, because a legend that looks for its lines leaves out those whose name begins with an underscore.
    figure.legend(handles=lines, loc="outside lower center", ncols=columns)
    return figure


def paths_figure(results: CampaignResults, width_in: float) -> Figure:
    """Return box plots of the successes' paths, with mean and standard deviation beside the paper's."""
    boxes = boxes_of(results.by_algorithm)
    papers = {name: paper for name, paper in results.papers_paths.items() if name in results.by_algorithm}
    figure = Figure(figsize=(width_in, AXIS_IN + LEGEND_LINE_IN + 1.4 * ROW_IN * len(results.by_algorithm)))
    axes, at = _rows(figure.add_subplot(xlabel=BOX_LABEL), list(results.by_algorithm))
    stats = [
        {"whislo": box.low_m, "q1": box.first_m, "med": box.median_m, "q3": box.third_m, "whishi": box.high_m,
         "fliers": [row.path_m for row in box.beyond]}
        for box in boxes.values()
    ]  # fmt: skip
    line = {"color": palette.BLUE, "linewidth": 0.8}
    rings = {"marker": "o", "markersize": 2.0, "markerfacecolor": "none", "markeredgecolor": palette.GREY}
    axes.bxp(
        stats, [at[name] for name in boxes], orientation="horizontal", widths=0.3, manage_ticks=False, boxprops=line,
        whiskerprops=line, capprops=line, medianprops=line | {"linewidth": 1.6},
        flierprops=rings | {"markeredgewidth": 0.4},
    )  # fmt: skip
    for name in boxes:
        summary = results.summaries[name]
        _mean(axes, at[name] + 0.27, summary.path_mean_m or 0.0, summary.path_sd_m or 0.0, palette.BLUE)
    for name, paper in papers.items():
        _mean(axes, at[name] + 0.4, paper.path_mean_m, paper.path_sd_m, palette.VERMILION)
    whose = {"mean and SD": palette.BLUE} | ({"arXiv 2503.07492": palette.VERMILION} if papers else {})
    handles = [Line2D([], [], color=colour, marker="D", markersize=2.5, label=text) for text, colour in whose.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    paths_m = [row.path_m or 0.0 for rows in boxes.values() for row in rows.successes]
    _logarithmic(axes, span_of([*paths_m, *(paper.path_mean_m for paper in papers.values())]))
    return figure


def comparison_figure(algorithms: Sequence[Comparison], width_in: float) -> Figure:
    """Return a forest plot of each known difference to the algorithm that the others are compared with."""
    base, *others = algorithms
    drawn = [(gain, found) for gain in GAINS if (found := gain.known(others))]
    beside = width_in >= WIDTHS_IN["2col"]
    height_in = AXIS_IN + ROW_IN * len(others)
    figure = Figure(figsize=(width_in, height_in if beside else height_in * len(drawn)))
    each = figure.subplots(1 if beside else len(drawn), len(drawn) if beside else 1, squeeze=False).flat
    for axes, (gain, found) in zip(each, drawn, strict=True):
        _, at = _rows(axes, list(found))
        axes.set(xlabel=gain.label, xlim=span_of_gains(found))
        axes.axvline(0.0, color=palette.GREY, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.hlines(
            list(at.values()), [one.estimate.low for one in found.values()],
            [one.estimate.high for one in found.values()], color=palette.BLUE,
        )  # fmt: skip
        means = [one.estimate.value for one in found.values()]
        axes.plot(means, [at[name] for name in found], "s", markersize=3.5, color=palette.BLUE)
    figure.suptitle(f"difference to {base.algorithm}, mean of pairs with its 95 % interval", fontsize=7.0)
    return figure


def _rows(axes: Axes, names: Sequence[str]) -> tuple[Axes, dict[str, float]]:
    """Name the rows of axes by algorithms, group by group from the top, and return where each is."""
    ordered = [name for group in grouped(names) for name in group.algorithms]
    at = {name: float(place) for place, name in enumerate(ordered)}
    axes.set(yticks=list(at.values()), yticklabels=list(map(short, ordered)), ylim=(len(ordered) - 0.5, -0.5))
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    return axes, at


def _mean(axes: Axes, y: float, mean_m: float, sd_m: float, colour: str) -> None:
    axes.hlines(y, max(mean_m - sd_m, 1e-3), mean_m + sd_m, color=colour, linewidth=0.8)
    axes.plot(mean_m, y, "D", markersize=2.5, color=colour)


def _logarithmic(axes: Axes, span_m: tuple[float, float]) -> None:
    """Label a logarithmic x with 10, 20, 50, ... instead of powers."""
    axes.set_xscale("log")
    axes.set_xlim(span_m)
    axes.xaxis.set_major_locator(FixedLocator(ROUND))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
