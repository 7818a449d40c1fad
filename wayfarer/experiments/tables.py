"""The result table of a campaign, with the paper's figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.console import Console
from rich.table import Table

from wayfarer.experiments.statistics import AlgorithmSummary
from wayfarer.logview.terminal_table import Column, add_row, known, print_in_full, table

if TYPE_CHECKING:
    from wayfarer.experiments.paired_statistics import Comparison


class PaperFigures(NamedTuple):
    """What the paper reports of an algorithm over its 1,000 trials; None if it does not."""

    path_mean_m: float
    path_sd_m: float
    success_percent: float | None = None


# The paper, section IV: path lengths as mean and SD of the successes, and the success of Forest-Pledge alone.
PAPER_FIGURES: Mapping[str, PaperFigures] = {
    "pledge": PaperFigures(82.5, 30.8),
    "forest-pledge": PaperFigures(81.3, 29.3, success_percent=99.7),
    "levy-pledge": PaperFigures(88.3, 46.3),
    "levy-walk": PaperFigures(247.5, 223.7),
}


@dataclass(frozen=True, slots=True)
class PaperColumn(Column[AlgorithmSummary]):
    """One column: how it reads for a summary, and for the paper's figures."""

    papers: Callable[[Any], str] = lambda _: ""


class Layout(NamedTuple):
    """What a table shows: its columns in two groups, and the paper's figures by algorithm."""

    outcomes: tuple[PaperColumn, ...]
    measures: tuple[PaperColumn, ...]
    paper: Mapping[str, Any]


def number_text(value: float | None, decimals: int = 1) -> str:
    """Return a number with so many decimals, nothing if it is not known."""
    return "" if value is None else f"{value:.{decimals}f}"


def mean_and_sd(mean: float | None, sd: float | None) -> str:
    """Return a mean with its standard deviation, as far as they are known."""
    return number_text(mean) if sd is None else f"{number_text(mean)} ± {sd:.1f}"


def success(summary: AlgorithmSummary) -> str:
    """Return the share of successes with its interval, in per cent."""
    low, high = summary.success_low_percent, summary.success_high_percent
    return f"{summary.success_percent:.1f} [{low:.1f}, {high:.1f}]"


NAME_COLUMN = PaperColumn("algorithm", lambda s: s.algorithm, left=True, papers=lambda _: "  paper")
OUTCOME_COLUMNS = (
    PaperColumn("trials", lambda s: str(s.trials)),
    PaperColumn("success %\n[95 %]", success, papers=lambda p: number_text(p.success_percent)),
    PaperColumn("entrapped", lambda s: str(s.entrapped)),
    PaperColumn("left\nthe map", lambda s: str(s.left_bounds)),
    PaperColumn("tipped", lambda s: str(s.tipped)),
)
FAULTS = PaperColumn("faults", lambda s: str(s.fault))
SPL_COLUMN = PaperColumn("SPL", lambda s: number_text(s.spl, 3), if_known=True)
PATH_COLUMNS = (
    PaperColumn(
        "path m\nmean ± SD",
        lambda s: mean_and_sd(s.path_mean_m, s.path_sd_m),
        papers=lambda p: mean_and_sd(p.path_mean_m, p.path_sd_m),
    ),
    PaperColumn("median\nm", lambda s: number_text(s.path_median_m)),
    SPL_COLUMN,
    PaperColumn("time\ns", lambda s: number_text(s.time_mean_s)),
    PaperColumn("anomalies", lambda s: number_text(s.anomalies_mean)),
)


FOREST_LAYOUT = Layout(OUTCOME_COLUMNS, PATH_COLUMNS, PAPER_FIGURES)


def print_table(console: Console, summaries: Sequence[AlgorithmSummary], layout: Layout = FOREST_LAYOUT) -> None:
    """Print one table, or where the console is too narrow for it outcomes and measures below each other."""
    outcomes = (*layout.outcomes, *fault_columns(summaries))
    measures = known(layout.measures, summaries)
    whole, *parts = (
        _table(summaries, (NAME_COLUMN, *columns), layout.paper)
        for columns in ((*outcomes, *measures), outcomes, measures)
    )
    print_in_full(console, whole, parts)


def spl_hint(rows: Iterable[AlgorithmSummary | Comparison]) -> str:
    """Return how to get an SPL where a table has none."""
    known_anywhere = any(row.spl is not None for row in rows)
    return "" if known_anywhere else "no SPL: the shortest paths are not known; run the trials with --spl"


def fault_columns(summaries: Iterable[AlgorithmSummary]) -> tuple[PaperColumn, ...]:
    """Return the column of faults where there are any."""
    return (FAULTS,) if any(summary.fault for summary in summaries) else ()


def lines_of(
    summary: AlgorithmSummary, columns: Sequence[PaperColumn], papers: Mapping[str, Any]
) -> Iterator[tuple[str, list[str]]]:
    """Yield an algorithm's line (``ours``), and below it the ``paper`` one where the paper has any of these columns."""
    yield "ours", [str(column.cell(summary)) for column in columns]
    if paper := papers.get(summary.algorithm):
        cells = [column.papers(paper) for column in columns]
        if any(cells[1:]):
            yield "paper", cells


def _table(summaries: Sequence[AlgorithmSummary], columns: Sequence[PaperColumn], papers: Mapping[str, Any]) -> Table:
    made = table(columns)
    for summary in summaries:
        for whose, cells in lines_of(summary, columns, papers):
            add_row(made, cells, style="dim" if whose == "paper" else "")
    return made
