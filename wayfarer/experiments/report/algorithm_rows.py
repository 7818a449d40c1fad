"""Figures with one row per algorithm over a logarithmic axis or over percent, sorted by groups.

The groups are the paper's three, and a fourth for all others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from bokeh.models import CustomJSTicker, FixedTicker, NumeralTickFormatter
from bokeh.models.annotations import Label, Span

from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, plot

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
