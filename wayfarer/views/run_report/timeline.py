"""Time lines of a run: all measurements, decisions and events over one time axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import FixedLocator, FuncFormatter

from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.drawing import GREY, WIDTH_IN
from wayfarer.views.run_report.event_rows import ANOMALY, MOST, event_rows
from wayfarer.views.run_report.forest_map import STROKES
from wayfarer.views.run_report.marks import stroke_of
from wayfarer.views.run_report.panels import panels_of
from wayfarer.views.run_report.series import ValueSpan, spans

LEFT_IN, RIGHT_IN = 1.2, 1.15  # beside the panels: what they show, and their legends
ROOM_IN = WIDTH_IN - LEFT_IN - RIGHT_IN
TOP_IN, BOTTOM_IN, BETWEEN_IN = 0.08, 0.75, 0.12
MINUTES_FROM_S = 600.0  # a longer run is shown in minutes
STEPS_S = (1, 2, 5, 10, 20, 50, 100, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 36000, 86400)
STEPS_AT_MOST = 10
SHADE = 0.17  # of a phase's colour, behind the lines


def timeline_figure(data: RunData) -> tuple[Figure, int]:
    """Return the figure, and how many kinds of events found no room in it; there must be a panel to draw."""
    end_s = max(data.summary.lasted_s, 1.0)
    rows, panels, bands = event_rows(data), panels_of(data), _bands(data)
    figure, axes = _lay_out([panel.height_in for panel in panels])
    for each, panel in zip(axes, panels, strict=True):
        each.set_xlim(0.0, end_s)
        _shade(each, bands)
        _lead(each, [t_s for row in rows[:MOST] if row.rank != ANOMALY for t_s in row.times_s])
        panel.draw(each, data)
    _time_axis(axes, end_s)
    shown = {int(band.value) for band in bands}
    handles = [Patch(color=STROKES[at].colour, alpha=SHADE * 2, label=STROKES[at].text) for at in sorted(shown)]
    figure.legend(handles=handles, loc="lower center", ncols=4)
    return figure, max(0, len(rows) - MOST)


def _lay_out(heights_in: Sequence[float]) -> tuple[Figure, list[Axes]]:
    """Return axes of these heights, one below the other, all from the same left to the same right."""
    height_in = TOP_IN + BOTTOM_IN + sum(heights_in) + BETWEEN_IN * (len(heights_in) - 1)
    figure = Figure((WIDTH_IN, height_in))
    axes, top_in = [], height_in - TOP_IN
    for each_in in heights_in:
        top_in -= each_in
        box = (LEFT_IN / WIDTH_IN, top_in / height_in, ROOM_IN / WIDTH_IN, each_in / height_in)
        axes.append(figure.add_axes(box))
        top_in -= BETWEEN_IN
    return figure, axes


def _lead(axes: Axes, times_s: Sequence[float]) -> None:
    """Draw the lines of the events through a panel."""
    axes.vlines(times_s, 0, 1, colors=GREY, alpha=0.6, linewidths=0.4, transform=axes.get_xaxis_transform(), zorder=0.9)


def _bands(data: RunData) -> list[ValueSpan]:
    return spans(data.ticks["t_s"], stroke_of(data.ticks["phase"]))


def _shade(axes: Axes, bands: Sequence[ValueSpan]) -> None:
    """Draw the phases behind a panel: one path for each colour, however often it comes."""
    for at, stroke in enumerate(STROKES):
        boxes = [[(a, 0.0), (a, 1.0), (b, 1.0), (b, 0.0), (a, 0.0)] for a, b, value in bands if value == at]
        if boxes:
            path = Path.make_compound_path_from_polys(np.array(boxes))
            shade = PathPatch(path, facecolor=stroke.colour, alpha=SHADE, linewidth=0, zorder=0.5)
            shade.set_transform(axes.get_xaxis_transform())
            axes.add_artist(shade)


def _time_axis(axes: Sequence[Axes], end_s: float) -> None:
    """Give all panels the same ticks, and the last their names."""
    step_s = next((step_s for step_s in STEPS_S if end_s / step_s <= STEPS_AT_MOST), end_s / STEPS_AT_MOST)
    unit, divisor = ("min", 60.0) if end_s > MINUTES_FROM_S else ("s", 1.0)
    for each in axes:
        each.xaxis.set_major_locator(FixedLocator(np.arange(0.0, end_s * (1 + 1e-9), step_s).tolist()))
        each.xaxis.set_major_formatter(FuncFormatter(lambda t_s, _: f"{t_s / divisor:g}"))
        each.tick_params(axis="x", labelbottom=each is axes[-1], length=3 if each is axes[-1] else 0)
    axes[-1].set_xlabel(f"time since the beginning, {unit}")
