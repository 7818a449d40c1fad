"""Figure and table: path length over the shortest path; a failed trial counts as infinite."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import FixedTicker, NumeralTickFormatter

from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.report.algorithm_rows import EDGE, grouped, lay_out, rows_plot
from wayfarer.experiments.rows import TrialRow
from wayfarer.views import palette
from wayfarer.views.page import html
from wayfarer.views.page.plots import Figure, hover, source

ROW_PX = 28
TIMES = "\N{MULTIPLICATION SIGN}"
WITHIN = (2.0, 4.0)  # multiples of the shortest path
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def ratios(rows: Sequence[TrialRow]) -> list[float]:
    """Return path over shortest path of each trial where that is known, ascending; infinite for failures."""
    return sorted(
        row.path_m / row.shortest_path_m if row.outcome in SUCCESSES and row.path_m else math.inf
        for row in rows
        if row.shortest_path_m
    )


def quantile(values: Sequence[float], share: float) -> float:
    """Return the smallest value that at least this share, above 0 and up to 1, of the values does not exceed.

    It is one of them, never between two: between a path and a failure, which is infinite, there is nothing.
    """
    return float(np.quantile(values, share, method="inverted_cdf"))


def times(ratio: float) -> str:
    """Return a ratio as text."""
    return "a failure" if ratio == math.inf else f"{ratio:.1f} {TIMES}"


def within_percent(found: Sequence[float], multiple: float) -> float:
    """Return the share of the ratios up to a multiple."""
    return 100.0 * sum(ratio <= multiple for ratio in found) / len(found)


def ratio_figure(by_algorithm: Mapping[str, Sequence[TrialRow]]) -> Figure:
    """Return quantiles of path over shortest path by algorithm; shortest paths are known for some trial at least."""
    layout = lay_out(grouped(by_algorithm))
    known = {name: found for name, rows in by_algorithm.items() if (found := ratios(rows))}
    quantiles = {name: [quantile(found, share) for share in QUANTILES] for name, found in known.items()}
    drawn = [value for values in quantiles.values() for value in values]
    ticks = _doublings(max((ratio for ratio in drawn if ratio < math.inf), default=1.0))
    edge = ticks[-1]
    # Over the edge of the map a path may be shorter than the shortest.
    low, label = min(1.0, *drawn) / EDGE, "path over shortest path (logarithmic)"
    made = rows_plot("ratio", layout, ROW_PX, label, low, edge * EDGE, x_axis_type="log")
    made.xaxis.ticker = made.xgrid.ticker = FixedTicker(ticks=ticks)
    made.xaxis.formatter = NumeralTickFormatter(format="0.[00]")
    columns = {f"p{100 * share:.0f}": [each[at] for each in quantiles.values()] for at, share in enumerate(QUANTILES)}
    rows = source(
        algorithm=list(known), y=[layout.at[name] for name in known],
        **{name: np.minimum(values, edge) for name, values in columns.items()},
        **{f"{name}_text": [times(value) for value in values] for name, values in columns.items()},
        **{f"within{m:g}": [within_percent(found, m) for found in known.values()] for m in WITHIN},
        arrow=[edge if each[-1] == math.inf else math.nan for each in quantiles.values()],
    )  # fmt: skip
    outer = made.segment("p5", "y", "p95", "y", source=rows, line_color=palette.BLUE, line_width=2)
    inner = made.segment("p25", "y", "p75", "y", source=rows, line_color=palette.BLUE, line_width=8, name="ratio")
    look: Any = {"fill_color": palette.PAPER, "line_color": palette.EDGE, "line_width": 1.5}
    median = made.scatter("p50", "y", source=rows, size=9, **look)
    made.scatter("arrow", "y", source=rows, marker="triangle", angle=-np.pi / 2, size=9, color=palette.BLUE)
    told = (
        ("algorithm", "@algorithm"), ("median", "@p50_text"), ("middle half", "@p25_text to @p75_text"),
        ("5th to 95th percentile", "@p5_text to @p95_text"),
        *((f"within {m:g} {TIMES}", f"@within{m:g}{{0}} %") for m in WITHIN),
    )  # fmt: skip
    made.add_tools(hover([outer, inner, median], *told))
    return made


def _doublings(high: float) -> list[float]:
    """Return 1, 2, 4, ... up to the first at or above ``high``, and to 8 at least."""
    return [2.0**power for power in range(max(4, math.ceil(math.log2(high)) + 1))]


def ratios_table(by_algorithm: Mapping[str, Sequence[TrialRow]]) -> str:
    """Return the median ratio of each algorithm, and the shares of its trials within some multiples."""
    known = {name: found for name, rows in by_algorithm.items() if (found := ratios(rows))}
    rows = [
        ("", [name, times(quantile(found, 0.5)), *(f"{within_percent(found, m):.1f} %" for m in WITHIN)])
        for name, found in known.items()
    ]
    head = ["algorithm", "median", *(f"within {multiple:g} {TIMES}" for multiple in WITHIN)]
    return html.table("Share of the trials that got out within a multiple of the shortest path.", head, rows)
