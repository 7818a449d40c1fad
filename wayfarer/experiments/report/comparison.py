"""The paired comparison of a campaign's algorithms: forest plots, table and words of ``wayfarer compare``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from bokeh.models.annotations import Span

from wayfarer.errors import BadInput
from wayfarer.experiments.paired_statistics import Comparison, Difference, compare
from wayfarer.experiments.paired_table import COLUMNS, LEGEND, sentences
from wayfarer.experiments.report.algorithm_rows import grouped, lay_out, rows_plot
from wayfarer.experiments.report.load_results import CampaignResults
from wayfarer.views import palette
from wayfarer.views.page import html
from wayfarer.views.page.plots import Figure, Plots, hover, source
from wayfarer.views.text.terminal_table import known

ROW_PX = 34
ROOM = 0.06  # of the axis, beside the first and the last interval
CAPTION = (
    "Mean difference over the pairs of trials in the same forest with the same noise, with its 95 % interval. "
    "An interval without 0 is a difference that chance alone would seldom make."
)


class Gain(NamedTuple):
    """A difference that can be drawn: its name, what its axis says, its decimals, and where it is in a comparison."""

    name: str
    label: str
    decimals: int
    of: Callable[[Comparison], Difference | None]

    def known(self, others: Sequence[Comparison]) -> dict[str, Difference]:
        """Return the difference of each algorithm that has one."""
        return {one.algorithm: gain for one in others if (gain := self.of(one))}


GAINS = (
    Gain("success", "success, %-points (right: more)", 1, lambda one: one.success_gain),
    Gain("path", "path, m (left: shorter)", 1, lambda one: one.path_gain_m),
    Gain("SPL", "SPL (right: better)", 3, lambda one: one.spl_gain),
)


def comparison_section(results: CampaignResults, plots: Plots) -> Iterator[str]:
    """Yield how the algorithms, at least two, differ from one of them; or why they cannot be compared."""
    try:
        base, *others = compare(results.rows)
    except BadInput as reason:
        yield html.paragraph(f"The trials cannot be compared: {reason}.")
        return
    yield html.paragraph(f"Against {base.algorithm}. {CAPTION}")
    yield html.panels(
        html.figure(plots.place(gain_figure(gain, found)), alt=f"Difference to {base.algorithm}: {gain.label}")
        for gain in GAINS
        if (found := gain.known(others))
    )
    columns = known(COLUMNS, [base, *others])
    rows = [("", [str(column.cell(one)) for column in columns]) for one in (base, *others)]
    yield html.table("The table of wayfarer compare", [column.title for column in columns], rows)
    yield from map(html.paragraph, sentences([base, *others]))
    yield html.bullets(LEGEND.format(base.layouts).splitlines())


def gain_figure(gain: Gain, found: dict[str, Difference]) -> Figure:
    """Return a forest plot: an algorithm a row, its mean difference with the 95 % interval, and a line at 0."""
    layout = lay_out(grouped(found))
    low = min(0.0, *(each.estimate.low for each in found.values()))
    high = max(0.0, *(each.estimate.high for each in found.values()))
    room = ROOM * (high - low) or 1.0
    made = rows_plot(f"comparison, {gain.name}", layout, ROW_PX, gain.label, low - room, high + room)
    made.add_layout(Span(location=0.0, dimension="height", line_color=palette.GREY, line_dash=[5, 3]))
    points = source(
        algorithm=list(found), y=[layout.at[name] for name in found], pairs=[each.pairs for each in found.values()],
        mean=[each.estimate.value for each in found.values()], low=[each.estimate.low for each in found.values()],
        high=[each.estimate.high for each in found.values()], p=[f"{each.p:.4f}" for each in found.values()],
        text=[each.estimate.text(gain.decimals, "+") for each in found.values()],
    )  # fmt: skip
    line = made.segment("low", "y", "high", "y", source=points, line_color=palette.BLUE, line_width=3)
    mean = made.scatter("mean", "y", source=points, marker="square", size=9, color=palette.BLUE, name=gain.name)
    told = (("algorithm", "@algorithm"), ("difference [95 %]", "@text"), ("p", "@p"), ("pairs", "@pairs"))
    made.add_tools(hover([line, mean], *told))
    return made
