"""The time panels of one run or of two: they share the range of time, the cursor and the background."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isnan
from typing import Any, Literal, NamedTuple

import numpy as np
from bokeh.models import CustomJSTickFormatter, DataRange1d, Range1d
from bokeh.models.annotations import Span
from markupsafe import Markup

from wayfarer.views import palette
from wayfarer.views.page import html
from wayfarer.views.page.plots import Figure, Plots, hover, source
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.quantities import Panel, panels_of
from wayfarer.views.run_report.series import Line, around, thinned
from wayfarer.views.run_report.time_axis import (
    PanelBackground,
    background,
    events_panel,
    panel_background,
    time_panel,
    time_range,
)

HEIGHT_PX = 120
LOG_FROM = 8.0  # times the usual period: then the axis is logarithmic


class PanelLine(NamedTuple):
    """A line of a panel, of the run with this index."""

    run: int
    name: str
    line: Line
    look: Mapping[str, Any]


def draw_panels(runs: Sequence[RunData], plots: Plots) -> Iterator[Markup]:
    """Yield the HTML of all panels for which there is something in a log, the first from the top."""
    found = [(panel, lines) for panel in panels_of(runs) if (lines := list(_lines_of(panel, runs)))]
    if not found:
        return
    time, shared = time_range(runs), [panel_background(data) for data in runs]
    yield html.key("events", []) + plots.place(events_panel(runs, time, shared))
    for panel, lines in found:
        key = [(each.name, each.look["line_color"]) for each in lines if len(runs) == 1]
        title = f"{panel.title}, {panel.unit}" if panel.unit else panel.title
        yield html.key(title, key) + plots.place(_draw(panel, lines, runs, time, shared))


def _lines_of(panel: Panel, runs: Sequence[RunData]) -> Iterator[PanelLine]:
    for run, data in enumerate(runs):
        for quantity in panel.quantities:
            if (line := quantity.line(data)) is not None:
                colour = quantity.colour if len(runs) == 1 else palette.RUNS[run]
                look = {"line_width": 1.5, **quantity.look, "line_color": colour}
                yield PanelLine(run, quantity.name, line, look)


def _draw(
    panel: Panel, lines: Sequence[PanelLine], runs: Sequence[RunData], time: Range1d, shared: Sequence[PanelBackground]
) -> Figure:
    made = time_panel(panel.title, HEIGHT_PX, time, y_axis_type=_axis_type(panel, lines))
    background(made, shared)
    centre = panel.centre(runs[0]) if panel.centre else None
    renderers = []
    for run, name, line, look in lines:
        t_s, values = thinned(line if centre is None else around(line, centre))
        drawn = source(x=t_s, y=values)
        if centre is not None:
            whole_deg = np.round(values + centre, panel.decimals) % 360.0  # rounded first: 359.7 is 0, not 360
            drawn = source(x=t_s, y=values, value=whole_deg)
        renderers.append(made.line("x", "y", source=drawn, name=name, **look))
        renderers[-1].tags = [{"run": run, "name": name, "unit": panel.unit, "decimals": panel.decimals}]
    decimals = f"0.{'0' * panel.decimals}" if panel.decimals else "0"
    value = f"@{'y' if centre is None else 'value'}{{{decimals}}} {panel.unit}"
    made.add_tools(hover(renderers, ("", "$name"), ("value", value), ("time", "@x{0.0} s"), line_policy="nearest"))
    made.y_range = DataRange1d(renderers=[*renderers], only_visible=True)
    if centre is not None:
        made.y_range = Range1d(start=-180.0, end=180.0)
        made.yaxis.ticker = [-180, -90, 0, 90, 180]
        made.yaxis.formatter = CustomJSTickFormatter(code=f"return ((tick + {centre:g}) % 360 + 360) % 360")
    for limit in panel.limits(runs[0]):
        if not isnan(limit):
            made.add_layout(Span(location=limit, dimension="width", line_color=palette.LIMIT, line_dash=[2, 3]))
    return made


def _axis_type(panel: Panel, lines: Sequence[PanelLine]) -> Literal["linear", "log"]:
    values = np.concatenate([each.line[1] for each in lines])
    return "log" if panel.unit == "ms" and np.nanmax(values) > LOG_FROM * np.nanmedian(values) else "linear"
