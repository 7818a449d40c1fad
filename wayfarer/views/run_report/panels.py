"""Panels of the time lines: each draws one quantity, if the log has it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from wayfarer.views.run_report.data import LEVELS, Floats, RunData
from wayfarer.views.run_report.drawing import BLACK, BLUE, GREY, VERMILION
from wayfarer.views.run_report.event_rows import MOST, event_rows
from wayfarer.views.run_report.marks import LEVEL_COLOURS
from wayfarer.views.run_report.series import around, broken_at_gaps, broken_beside, spans, without_unknown

ROW_IN = 0.16
BOARD_SILENT_S = 10.0  # a board is asked each second or so
EVEN_S = 1e-4  # a loop whose periods differ by less runs on virtual time
LOG_FROM = 8.0  # times the usual period: then the axis is logarithmic
TICK: Mapping[str, Any] = {"linestyle": "none", "marker": "|", "markersize": 8, "markeredgewidth": 0.8}
LINE: Mapping[str, Any] = {"linewidth": 1.0}


class Panel(NamedTuple):
    """A panel of the figure; ``draw`` is given axes whose time is set."""

    height_in: float
    draw: Callable[[Axes, RunData], None]


def panels_of(data: RunData) -> list[Panel]:
    """Return the panels for which there is something in the log, the first from the top."""
    ticks = data.ticks
    rows = len(event_rows(data)[:MOST]) + _was_held(data)
    panels = [
        (rows > 0, Panel(rows * ROW_IN, _events)),
        (_is_known(ticks["heading_deg"]), Panel(1.05, _heading)),
        (_is_known(ticks["counter_deg"]), Panel(0.8, _counter)),
        (_is_known(ticks["pitch_deg"]), Panel(0.65, _pitch)),
        (_is_known(ticks["roll_deg"]), Panel(0.65, _roll)),
        (_is_known(ticks["commanded_m_s"]) or _is_known(ticks["measured_m_s"]), Panel(0.9, _speed)),
        (bool(data.batteries), Panel(0.75, _battery)),
        (_is_uneven(ticks["period_s"]), Panel(0.75, _period)),
    ]
    return [panel for there, panel in panels if there]


def _is_known(values: Floats) -> bool:
    return bool(values.size) and not bool(np.isnan(values).all())


def _is_uneven(periods_s: Floats) -> bool:
    known = periods_s[~np.isnan(periods_s)]
    return bool(known.size) and bool(known.max() - known.min() > EVEN_S)


# -- panels ------------------------------------------------------------------------------------------------------


def _events(axes: Axes, data: RunData) -> None:
    """Draw a row of marks for each kind of anomaly and event, and last when the wheels were held."""
    rows = event_rows(data)[:MOST]
    for at, row in enumerate(rows):
        axes.plot(row.times_s, [at] * len(row.times_s), color=row.colour, clip_on=False, **TICK)
    texts = [row.text for row in rows]
    if _was_held(data):
        _levels(axes, data, len(rows))
        texts.append("held")
    axes.set_ylim(len(texts) - 0.4, -0.6)
    axes.set_yticks(range(len(texts)), texts, fontsize=7)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _was_held(data: RunData) -> bool:
    return bool((data.ticks["level"] >= LEVELS["degrade"]).any())


def _levels(axes: Axes, data: RunData, row: int) -> None:
    """Draw when the rover's own condition made the gate hold the wheels, or do with less."""
    held = spans(data.ticks["t_s"], data.ticks["level"])
    for level, colour in LEVEL_COLOURS.items():
        bars = [(start_s, end_s - start_s) for start_s, end_s, value in held if value == LEVELS[level]]
        if bars:
            axes.broken_barh(bars, (row - 0.32, 0.64), color=colour, edgecolor=BLACK, linewidth=0.4, label=level)
    _legend(axes)


def _heading(axes: Axes, data: RunData) -> None:
    t_s, heading_deg, goal_deg = data.ticks["t_s"], data.ticks["heading_deg"], data.ticks["goal_heading_deg"]
    goals_deg = goal_deg[~np.isnan(goal_deg)]
    centre_deg = round(float(goals_deg[0])) % 360 if goals_deg.size else 0
    axes.plot(*around(*broken_at_gaps(t_s, heading_deg), centre_deg), color=BLUE, label="heading", **LINE)
    axes.plot(
        *around(*broken_at_gaps(t_s, goal_deg), centre_deg),
        color=BLACK,
        linestyle=(0, (4, 2)),
        label="goal",
        **LINE,
    )
    axes.set_ylim(-185.0, 185.0)
    quarters_deg = (-180, -90, 0, 90, 180)
    axes.set_yticks(quarters_deg, [f"{(centre_deg + quarter_deg) % 360}" for quarter_deg in quarters_deg])
    _finish(axes, "heading, °")


def _counter(axes: Axes, data: RunData) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.plot(*_line(data, "counter_deg"), color=BLUE, label="counter C", **LINE)
    _finish(axes, "turned, °")


def _pitch(axes: Axes, data: RunData) -> None:
    _tilt(axes, data, "pitch")


def _roll(axes: Axes, data: RunData) -> None:
    _tilt(axes, data, "roll")


def _tilt(axes: Axes, data: RunData, name: str) -> None:
    limit_deg = data.setting("detector", "tilt_deg")
    axes.plot(*_line(data, f"{name}_deg"), color=BLUE, label=name, **LINE)
    if not isnan(limit_deg):
        for side, label in ((1.0, f"limit {limit_deg:g}°"), (-1.0, None)):
            axes.axhline(side * limit_deg, color=VERMILION, linestyle=(0, (1, 1.5)), linewidth=1.0, label=label)
    _finish(axes, f"{name}, °")


def _speed(axes: Axes, data: RunData) -> None:
    measured = without_unknown(data.ticks["t_s"], data.ticks["measured_m_s"])
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.plot(*_line(data, "commanded_m_s"), color=GREY, alpha=0.6, label="commanded", linewidth=2.0)
    axes.plot(*broken_at_gaps(*measured), color=BLUE, label="measured", **LINE)
    _finish(axes, "speed, m/s")


def _battery(axes: Axes, data: RunData) -> None:
    t_s, battery_v = np.array(data.batteries).T
    duty = axes.twinx()
    duty.plot(*_line(data, "duty"), color=GREY, alpha=0.6, linewidth=0.8, label="duty (0 to 1)")
    duty.set_ylim(0.0, 1.0)
    duty.set_axis_off()
    axes.set_zorder(duty.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.plot(*broken_beside(data.ticks["t_s"], t_s, battery_v, BOARD_SILENT_S), color=BLUE, label="battery", **LINE)
    for name in ("low", "critical"):
        limit_v = data.setting("board", f"battery_{name}_v")
        if not isnan(limit_v):
            axes.axhline(limit_v, color=VERMILION, linestyle=(0, (1, 1.5)), linewidth=1.0, label=name)
    axes.set_ylim(*_room((min(battery_v), max(battery_v)), 0.5))
    _finish(axes, "battery, V", duty)


def _period(axes: Axes, data: RunData) -> None:
    t_s, period_ms = data.ticks["t_s"], 1e3 * data.ticks["period_s"]
    late_ms, control_hz = 1e3 * data.setting("safety", "tick_late_s"), data.setting("control_hz")
    if control_hz > 0.0:
        axes.axhline(1e3 / control_hz, color=GREY, linewidth=0.6, label=f"set {1e3 / control_hz:.0f} ms")
    axes.plot(*broken_at_gaps(t_s, period_ms), color=BLUE, label="period", linewidth=0.7)
    late = period_ms > late_ms
    if late.any():
        axes.plot(t_s[late], period_ms[late], color=VERMILION, linestyle="none", marker="x", markersize=4, label="late")
    if np.nanmax(period_ms) > LOG_FROM * np.nanmedian(period_ms):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))  # matplotlib's own writes 10^2 in TeX
        axes.yaxis.set_minor_formatter(NullFormatter())
    _finish(axes, "period, ms")


# -- parts of panels ---------------------------------------------------------------------------------------------


def _line(data: RunData, name: str) -> tuple[Floats, Floats]:
    return broken_at_gaps(data.ticks["t_s"], data.ticks[name])


def _room(span: tuple[float, float], least: float) -> tuple[float, float]:
    """Return limits of an axis around a span, so wide at least."""
    middle, half = (span[0] + span[1]) / 2.0, max(span[1] - span[0], least) * 0.55
    return middle - half, middle + half


def _finish(axes: Axes, label: str, *others: Axes) -> None:
    axes.set_ylabel(label)
    axes.yaxis.set_label_coords(-0.115, 0.5)
    axes.grid(visible=True, axis="y")
    axes.set_axisbelow(True)
    _legend(axes, *others)


def _legend(*axes: Axes) -> None:
    """Say beside a panel what is what in it."""
    handles = [handle for each in axes for handle in each.get_legend_handles_labels()[0]]
    axes[0].legend(
        handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, handlelength=1.3, labelspacing=0.25,
        borderaxespad=0.4,
    )  # fmt: skip
