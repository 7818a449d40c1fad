"""The time panels of a run: they share the range of time, the cursor and the background.

Behind the lines are the phases as bands and the events as lines; the first panel is that of the events.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import AdaptiveTicker, CustomJSTickFormatter, DataRange1d, Range1d
from bokeh.models.annotations import Span
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import ColumnDataSource
from markupsafe import Markup

from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.logview import palette
from wayfarer.reports.data import (
    LAYERS,
    LEVEL_NUMBERS,
    LOOK,
    PHASES,
    Floats,
    Line,
    RunData,
    around,
    at_ticks,
    breaks,
    broken,
    columns,
    event_marks,
    spans,
    thinned,
)
from wayfarer.reports.page import html
from wayfarer.reports.page.plots import Figure, Plots, hover, layer, plot, source
from wayfarer.vocabulary import LEVEL_TEXTS, in_words

BOARD_SILENT_S = 10.0  # a board is asked each second or so
EVEN_S = 1e-4  # a loop whose periods differ by less runs on virtual time


class Quantity(NamedTuple):
    """A line of a panel: its name, how it is got from the data, and its look. ``None``: the log does not have it."""

    name: str
    line: Callable[[RunData], Line | None]
    colour: str = palette.MEASURED
    look: Mapping[str, Any] = {}


class Panel(NamedTuple):
    """What one panel shows, its unit and the decimals of its values.

    ``limits`` are values that must not be reached. With a ``centre`` the lines are compass headings, drawn from -180
    to 180 degrees about it.
    """

    title: str
    unit: str
    decimals: int
    quantities: tuple[Quantity, ...]
    limits: Callable[[RunData], Iterable[float]] = lambda _: ()
    centre: Callable[[RunData], float] | None = None


def _tick(name: str, factor: float = 1.0) -> Callable[[RunData], Line | None]:
    def line(data: RunData) -> Line | None:
        values = data.ticks[name]
        return None if np.isnan(values).all() else at_ticks(data.ticks, factor * values)

    return line


def _commanded(data: RunData) -> Line | None:
    speed_m_s = data.setting("vehicle", "max_speed_m_s") * (data.ticks["left"] + data.ticks["right"]) / 2.0
    return None if np.isnan(speed_m_s).all() else at_ticks(data.ticks, speed_m_s)


def _applied(name: str) -> Callable[[RunData], Line | None]:
    """Return the duty of a rover that drove at all: if a tick does not have it, it is taken to be none."""

    def line(data: RunData) -> Line | None:
        drove = data.ticks["left"].any() or data.ticks["right"].any()
        return at_ticks(data.ticks, data.ticks[name]) if drove else None

    return line


def _battery(data: RunData) -> Line | None:
    battery = data.batteries
    if not battery["t_s"].size:
        return None
    return broken(battery["t_s"], battery["battery_v"], breaks(battery) | (battery["period_s"][1:] > BOARD_SILENT_S))


def _period(data: RunData) -> Line | None:
    periods_s = data.ticks["period_s"]
    known = periods_s[~np.isnan(periods_s)]
    return _tick("period_s", 1e3)(data) if known.size and np.ptp(known) > EVEN_S else None


def _goal_centre(data: RunData) -> float:
    """Return the first goal, around which headings are drawn, so that nothing jumps at north."""
    goals_deg = data.ticks["goal_heading_deg"]
    goals_deg = goals_deg[~np.isnan(goals_deg)]
    return float(round(float(goals_deg[0])) % 360) if goals_deg.size else 0.0


def _settings(*keys: tuple[str, str], factor: float = 1.0) -> Callable[[RunData], list[float]]:
    return lambda data: [factor * data.setting(*key) for key in keys]


def panels_of(data: RunData) -> list[Panel]:
    """Return all panels of a run: those of the table, and one for each further number of the log."""

    def panel(title: str, values: Floats) -> Panel:
        return Panel(title, "", 2, (Quantity(title, lambda _: at_ticks(data.ticks, values)),))

    return [*PANELS, *(panel(escape_control_chars(name), values) for name, values in data.further.items())]


DASHED: Mapping[str, Any] = {"line_dash": [5, 3]}
BENEATH: Mapping[str, Any] = {"line_width": 3, "line_alpha": 0.6}  # what was asked for, behind what became of it
PANELS = (
    Panel(
        "heading about the goal", "°", 0,
        (Quantity("heading", _tick("heading_deg")), Quantity("goal", _tick("goal_heading_deg"), palette.GREY, DASHED)),
        centre=_goal_centre,
    ),
    Panel("counter C", "°", 0, (Quantity("counter", _tick("counter_deg")),)),
    Panel(
        "tilt", "°", 1,
        (Quantity("pitch", _tick("pitch_deg")), Quantity("roll", _tick("roll_deg"), palette.GREEN, DASHED)),
        limits=lambda data: [sign * data.setting("detector", "tilt_deg") for sign in (-1.0, 1.0)],
    ),
    Panel(
        "speed", "m/s", 2,
        (Quantity("commanded", _commanded, palette.GREY, BENEATH),
         Quantity("measured", _tick("measured_m_s"))),
    ),
    *(
        Panel(
            f"{side} wheel's duty", "", 2,
            (Quantity(f"{side} wanted", _tick(f"wanted_{side}"), palette.GREY, BENEATH),
             Quantity(f"{side} applied", _applied(side))),
        )
        for side in ("left", "right")
    ),
    Panel(
        "battery", "V", 2, (Quantity("battery", _battery),),
        limits=_settings(("board", "battery_low_v"), ("board", "battery_critical_v")),
    ),
    Panel(
        "control period", "ms", 0, (Quantity("period", _period),),
        limits=_settings(("safety", "tick_late_s"), factor=1e3),
    ),
)  # fmt: skip


HEIGHT_PX = 120
LOG_FROM = 8.0  # times the usual period: then the axis is logarithmic
SHADE = 0.16  # of a phase's colour, behind the lines
FEW_EVENTS = 20  # of one kind
ROW_PX, AXIS_PX = 18, 26
NARROWEST_S = 1.0  # of what can be zoomed to: ticks are whole seconds
CLOCK = """
const two = (part) => String(part).padStart(2, "0");
const minutes = Math.floor(tick / 60), seconds = two(tick % 60);
return minutes < 60 ? `${minutes}:${seconds}` : `${Math.floor(minutes / 60)}:${two(minutes % 60)}:${seconds}`;
"""


class PanelLine(NamedTuple):
    """A line of a panel."""

    name: str
    line: Line
    look: Mapping[str, Any]


def draw_panels(data: RunData, plots: Plots) -> Iterator[Markup]:
    """Yield the HTML of all panels for which there is something in the log, the first from the top."""
    filled: list[tuple[Panel, list[PanelLine]]] = []
    for panel in panels_of(data):
        lines = [
            PanelLine(quantity.name, line, {"line_width": 1.5, **quantity.look, "line_color": quantity.colour})
            for quantity in panel.quantities
            if (line := quantity.line(data)) is not None
        ]
        filled += [(panel, lines)] if lines else []
    if not filled:
        return
    end_s = max(1.0, data.summary.lasted_s)
    time = Range1d(start=0.0, end=end_s, bounds=(0.0, end_s), min_interval=min(end_s, NARROWEST_S))
    behind = _panel_background(data)
    yield html.key("events", []) + plots.place(_events_panel(data, time, behind))
    for panel, lines in filled:
        key = [(each.name, each.look["line_color"]) for each in lines]
        title = f"{panel.title}, {panel.unit}" if panel.unit else panel.title
        yield html.key(title, key) + plots.place(_draw(panel, lines, data, time, behind))


def _draw(panel: Panel, lines: Sequence[PanelLine], data: RunData, time: Range1d, behind: PanelBackground) -> Figure:
    all_values = np.concatenate([line for _, (_, line), _ in lines])
    is_log = panel.unit == "ms" and np.nanmax(all_values) > LOG_FROM * np.nanmedian(all_values)
    made = _time_panel(panel.title, HEIGHT_PX, time, y_axis_type="log" if is_log else "linear")
    _background(made, behind)
    renderers = []
    for name, line, look in lines:
        if panel.centre is None:
            t_s, values = thinned(line)
            drawn = source(x=t_s, y=values)
        else:
            centre_deg = panel.centre(data)
            t_s, values = thinned(around(line, centre_deg))
            whole_deg = np.round(values + centre_deg, panel.decimals) % 360.0  # rounded first: 359.7 is 0, not 360
            drawn = source(x=t_s, y=values, value=whole_deg)
        renderers.append(made.line("x", "y", source=drawn, name=name, **look))
        renderers[-1].tags = [{"name": name, "unit": panel.unit, "decimals": panel.decimals}]
    decimals = f"0.{'0' * panel.decimals}" if panel.decimals else "0"
    value = f"@{'value' if panel.centre else 'y'}{{{decimals}}} {panel.unit}"
    made.add_tools(hover(renderers, ("", "$name"), ("value", value), ("time", "@x{0.0} s"), line_policy="nearest"))
    made.y_range = DataRange1d(renderers=[*renderers], only_visible=True)
    if panel.centre is not None:
        made.y_range = Range1d(start=-190.0, end=190.0)  # a line at the edge is seen too
        made.yaxis.ticker = [-180, -90, 0, 90, 180]
    for limit in panel.limits(data):
        if not isnan(limit):
            made.add_layout(Span(location=limit, dimension="width", line_color=palette.LIMIT, line_dash=[2, 3]))
    return made


# -- what all panels have, and the panel of events ------------------------------------------------------------------


def _time_panel(name: str, height_px: int, time: Range1d, **settings: Any) -> Figure:
    """Return an empty panel with the cursor in it."""
    made = plot(name, height_px, "width", x_range=time, toolbar_location=None, **settings)
    made.min_border_left, made.min_border_right = 72, 8  # the same in all, so that times stand below each other
    made.xaxis.ticker = AdaptiveTicker(base=60, mantissas=[1, 2, 5, 10, 15, 30], min_interval=1.0, desired_num_ticks=5)
    made.xaxis.formatter = CustomJSTickFormatter(code=CLOCK)
    made.xgrid.grid_line_color = None
    made.tags = ["time"]
    made.add_layout(Span(location=np.nan, dimension="height", line_color=palette.TROUBLE, tags=["cursor"]))
    return made


class PanelBackground(NamedTuple):
    """The phases of the run by name, and its events by layer, for all panels."""

    phases: Mapping[str, ColumnDataSource]
    events: Mapping[str, ColumnDataSource]


def _panel_background(data: RunData) -> PanelBackground:
    """Return what all panels show behind their lines."""
    bands = spans(data.ticks, data.ticks["phase"])
    inside = {phase: [each for each in bands if PHASES[int(each.value)] == phase] for phase in palette.PHASE_COLOURS}
    marks = event_marks(data)
    by_layer = {layer.name: [mark for mark in marks if mark.layer == layer.name] for layer in LAYERS}
    return PanelBackground(
        {phase: source(x0=[each.start_s for each in spans_], x1=[each.end_s for each in spans_])
         for phase, spans_ in inside.items() if spans_},
        {layer: source(**columns(each)) for layer, each in by_layer.items() if each},
    )  # fmt: skip


def _background(made: Figure, behind: PanelBackground) -> None:
    """Draw the phases of the run, and its events but anomalies, behind a panel."""
    for phase, bands in behind.phases.items():
        colour = palette.PHASE_COLOURS[phase]
        layer(phase, made.vstrip("x0", "x1", source=bands, fill_color=colour, fill_alpha=SHADE, line_color=None))
    for each in LAYERS:
        if each.name != "anomaly" and each.name in behind.events:
            colour = palette.TROUBLE if each.name == "trouble" else palette.GREY  # the first panel has those of all
            events = behind.events[each.name]
            faint = min(0.6, FEW_EVENTS * 0.6 / len(events.data["t"]))  # many lines would hide the curves
            layer(each.name, made.vspan("t", source=events, line_color=colour, line_alpha=faint, line_dash=[3, 3]))


def _events_panel(data: RunData, time: Range1d, behind: PanelBackground) -> Figure:
    """Return the panel of all events: a row for each layer that has any, and for when the wheels were held."""
    layers = [layer_ for layer_ in LAYERS if layer_.name in behind.events]
    was_held = bool((data.ticks["level"] >= LEVEL_NUMBERS["degrade"]).any())
    names = [*(each.text for each in layers), *["held"] * was_held]
    made = _time_panel(
        "events", ROW_PX * max(1, len(names)) + AXIS_PX, time, y_range=Range1d(start=len(names) - 0.5, end=-0.5)
    )
    _background(made, behind)
    made.ygrid.grid_line_color = None
    made.yaxis.ticker = list(range(len(names)))
    made.yaxis.major_label_overrides = dict(enumerate(names))
    drawn: list[GlyphRenderer[Any]] = []
    for at, each in enumerate(layers):
        events = behind.events[each.name]
        drawn.append(made.scatter("t", at, source=events, size=9, fill_color=each.colour, **LOOK))
        layer(each.name, drawn[-1])
    drawn += _held(made, data, len(layers))
    made.add_tools(hover(drawn, ("what", "@what"), ("time", "@t{0.0} s")))
    _states(made, data)
    return made


def _held(made: Figure, data: RunData, row: int) -> Iterator[GlyphRenderer[Any]]:
    """Draw when the rover's own condition made the gate hold the wheels, or do with less."""
    held = spans(data.ticks, data.ticks["level"])
    for level, colour in palette.LEVEL_COLOURS.items():
        bars = [each for each in held if each.value == LEVEL_NUMBERS[level]]
        if bars:
            words = [f"{LEVEL_TEXTS[level]}, for {each.end_s - each.start_s:.1f} s" for each in bars]
            begins_s = [each.start_s for each in bars]
            times = source(t=begins_s, right=[each.end_s for each in bars], what=words)
            yield made.hbar(y=row, left="t", right="right", height=0.6, source=times, color=colour)


def _states(made: Figure, data: RunData) -> None:
    """Put in, unseen, what the cursor reads of phase and level: where each changes."""
    phases = {index: in_words(phase) for index, phase in enumerate(PHASES)}
    levels = {int(value): LEVEL_TEXTS[level] for level, value in LEVEL_NUMBERS.items()}
    for name, words in (("phase", phases), ("level", levels)):
        bands = spans(data.ticks, data.ticks[name])
        changes = source(x=[band.start_s for band in bands], value=[words[int(band.value)] for band in bands])
        made.scatter("x", 0, source=changes, alpha=0.0).tags = [{"name": name, "unit": "", "decimals": 0}]
