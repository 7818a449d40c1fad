"""Figure of a sweep over two keys: a page of heat maps per algorithm."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from wayfarer.experiments.report.drawing import PALE, WIDTH_IN
from wayfarer.experiments.report.reading import SweepResults, SweptAxis
from wayfarer.experiments.sweep.measures import MEASURES, Measure

PANEL_IN = 2.3
COLOURS = "cividis"  # read alike by colour-blind readers
DARK_BELOW = 0.5  # of the scale: white numbers
MOST_COLUMNS, MOST_ROWS = 8, 14  # with more there is no room for a number in each cell

Grid = np.ndarray[tuple[int, int], np.dtype[np.float64]]  # [first key, second key]


def maps_figure(results: SweepResults, algorithm: str) -> Figure:
    """Return a map for each measure: the first key upwards, the second to the right; colours mean the same for all."""
    figure = Figure((WIDTH_IN, 2 * PANEL_IN))
    for axes, measure in zip(figure.subplots(2, 2).flat, MEASURES, strict=True):
        values = _values(results, algorithm, measure)
        every = np.concatenate([_values(results, name, measure).ravel() for name in results.algorithms])
        known = every[np.isfinite(every)]
        low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
        scale = Normalize(low, high if high > low else low + 1.0)
        axes.set_facecolor(PALE)
        image = axes.imshow(values, cmap=COLOURS, norm=scale, origin="lower", aspect="auto")
        _ticks(axes, results.axes)
        if values.shape[0] <= MOST_ROWS and values.shape[1] <= MOST_COLUMNS:
            _numbers(axes, values, scale, measure.decimals)
        axes.set_title(measure.title, fontsize="medium", loc="left")
        figure.colorbar(image, ax=axes, fraction=0.05)
    up, right = results.axes
    figure.supxlabel(right.key, fontsize="medium")
    figure.supylabel(up.key, fontsize="medium")
    return figure


def _values(results: SweepResults, algorithm: str, measure: Measure) -> Grid:
    """Return a measure at each point, NaN where it is not known."""
    estimates = [measure.of(results.cells[point, algorithm]) for point in range(len(results.points))]
    flat = [math.nan if estimate is None else estimate.value for estimate in estimates]
    up, right = results.axes
    return np.array(flat).reshape(len(up.values), len(right.values))


def _ticks(axes: Axes, keys: list[SweptAxis]) -> None:
    up, right = keys
    axes.set_xticks(*_named(right))
    axes.set_yticks(*_named(up))
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _named(axis: SweptAxis) -> tuple[list[int], list[str]]:
    """Return places and names of an axis's values; of many, every so manieth."""
    step = -(-len(axis.values) // MOST_COLUMNS)
    places = list(range(0, len(axis.values), step))
    return places, [str(axis.values[place]) for place in places]


def _numbers(axes: Axes, values: Grid, scale: Normalize, decimals: int) -> None:
    for (row, column), value in np.ndenumerate(values):
        if math.isfinite(value):
            colour = "white" if scale(value) < DARK_BELOW else "black"
            axes.text(column, row, f"{value:.{decimals}f}", color=colour, fontsize=6.5, ha="center", va="center")
