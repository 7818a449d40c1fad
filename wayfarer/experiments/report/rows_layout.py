"""Layout of a figure with one row per algorithm, sorted by groups."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from matplotlib.axes import Axes

from wayfarer.experiments.report.drawing import GREY
from wayfarer.experiments.report.groups import Group, short

ROW_IN = 0.235  # height of a row
HEADING = 0.95  # rows that a group's name takes


@dataclass
class Rows:
    """Where each algorithm and each heading is, in rows from the top."""

    at: dict[str, float] = field(default_factory=dict)
    headings: list[tuple[float, str]] = field(default_factory=list)
    rows: float = 0.0

    @property
    def height_in(self) -> float:
        """Height of the rows, inches."""
        return self.rows * ROW_IN


def lay_out(groups: Iterable[Group]) -> Rows:
    """Return the rows for these groups."""
    layout = Rows()
    for group in groups:
        layout.headings.append((layout.rows + HEADING / 2, group.title))
        layout.rows += HEADING
        for name in group.algorithms:
            layout.at[name] = layout.rows + 0.5
            layout.rows += 1.0
    return layout


def label_rows(axes: Axes, layout: Rows) -> None:
    """Write the names beside the left axis, and part the groups by lines."""
    names = [*((y, short(name)) for name, y in layout.at.items()), *layout.headings]
    axes.set_yticks([y for y, _ in names], [text for _, text in names])
    for label in axes.get_yticklabels()[len(layout.at) :]:
        label.set_fontweight("bold")
    axes.set_ylim(layout.rows, 0.0)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=True, axis="x")
    axes.set_axisbelow(True)
    for y, _ in layout.headings[1:]:
        axes.axhline(y - HEADING / 2, color=GREY, linewidth=0.6, linestyle=(0, (4, 3)))
