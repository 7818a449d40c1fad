"""``wayfarer compare``: paired comparison of the algorithms of one campaign."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli.extras import require

if TYPE_CHECKING:
    from rich.table import Table

    from wayfarer.experiments.paired_statistics import Comparison, Estimate, Share

    Column = tuple[str, Callable[[Comparison], str]]

EXAMPLES = """Examples:

wayfarer sim --algorithm forest-pledge,pledge --trials 500 --spl --out results && wayfarer compare results

wayfarer compare results --against pledge
"""
LEGEND = """change: against the baseline, mean over pairs of the same forest and noise; 95 % by bootstrap of {} layouts
path: pairs in which both escaped; a shorter path is negative
shares: exact 95 % intervals; worst: a failed trial, else the longest path"""


def compare(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="A folder that `wayfarer sim --out` wrote.")],
    *,
    against: Annotated[
        str, typer.Option(metavar="ALGORITHM", help="The algorithm that the others are compared with.")
    ] = "forest-pledge",
) -> None:
    """Compare the algorithms of a campaign in pairs (same forest, same noise), with 95 % intervals."""
    require("simulating")
    from rich.console import Console

    from wayfarer.experiments.paired_statistics import compare as compared
    from wayfarer.experiments.report.reading import read_results

    algorithms = compared(read_results(results).rows, against)
    console = Console()
    whole = _table(algorithms, (*GAINS, *OUTCOMES))
    fits = console.measure(whole, options=console.options.update(max_width=1000)).maximum <= console.width
    for table in [whole] if fits else [_table(algorithms, columns) for columns in (GAINS, OUTCOMES)]:
        console.print(table)
        console.print()
    console.print(LEGEND.format(algorithms[0].layouts), highlight=False, soft_wrap=True)


def _table(algorithms: list[Comparison], columns: Sequence[Column]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 0, 0, 1))
    table.add_column("algorithm", no_wrap=True)
    for title, _ in columns:
        table.add_column(title, justify="right", no_wrap=True)
    for one in algorithms:
        table.add_row(one.algorithm, *(text(one) for _, text in columns))
    return table


def _gain(gain: Estimate | None, decimals: int) -> str:
    if gain is None:
        return ""
    return f"{gain.mean:+.{decimals}f} [{gain.low:+.{decimals}f}, {gain.high:+.{decimals}f}]"


def _share(share: Share, decimals: int) -> str:
    percent, low, high = (100 * part for part in share)
    return f"{percent:.{decimals}f} [{low:.{decimals}f}, {high:.{decimals}f}]"


def _worst(one: Comparison) -> str:
    from wayfarer.experiments.rows import SUCCESSES

    row = one.worst
    what = row.outcome if row.outcome not in SUCCESSES or row.path_m is None else f"{row.path_m:.0f} m"
    return f"{what}, {row.forest}/{row.noise}"


GAINS: tuple[Column, ...] = (
    ("trials", lambda one: str(one.trials)),
    ("SPL", lambda one: "" if one.spl is None else f"{one.spl:.3f}"),
    ("SPL change\n[95 %]", lambda one: _gain(one.spl_gain, 3)),
    ("path change, m\n[95 %]", lambda one: _gain(one.path_gain_m, 1)),
)
OUTCOMES: tuple[Column, ...] = (
    ("entrapped %\n[95 %]", lambda one: _share(one.entrapped, 2)),
    ("left bounds %\n[95 %]", lambda one: _share(one.left_bounds, 1)),
    ("worst\nforest/noise", _worst),
)
