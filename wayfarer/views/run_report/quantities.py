"""What the time panels show: a table of quantities, and how each is got from the data of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.views import palette
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.series import Line, at_ticks, breaks, broken

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

    ``limits`` are values that shall not be reached. With a ``centre`` the lines are compass headings, drawn from -180
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


def _further(name: str) -> Callable[[RunData], Line | None]:
    return lambda data: at_ticks(data.ticks, data.further[name])


def _commanded(data: RunData) -> Line | None:
    speed_m_s = data.setting("vehicle", "max_speed_m_s") * (data.ticks["left"] + data.ticks["right"]) / 2.0
    return None if np.isnan(speed_m_s).all() else at_ticks(data.ticks, speed_m_s)


def _applied(name: str) -> Callable[[RunData], Line | None]:
    """Return the duty of a rover that drove at all: where a tick does not have it, it is taken to be none."""

    def line(data: RunData) -> Line | None:
        drove = data.ticks["left"].any() or data.ticks["right"].any()
        return at_ticks(data.ticks, data.ticks[name]) if drove else None

    return line


def _battery(data: RunData) -> Line | None:
    told = data.batteries
    if not told["t_s"].size:
        return None
    return broken(told["t_s"], told["battery_v"], breaks(told) | (told["period_s"][1:] > BOARD_SILENT_S))


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


def _tilt_limits(data: RunData) -> list[float]:
    return [sign * data.setting("detector", "tilt_deg") for sign in (-1.0, 1.0)]


def panels_of(data: RunData) -> list[Panel]:
    """Return all panels of a run: those of the table, and one for each further number of the log."""
    further = ((escape_control_chars(name), _further(name)) for name in data.further)
    return [*PANELS, *(Panel(title, "", 2, (Quantity(title, line),)) for title, line in further)]


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
        limits=_tilt_limits,
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
