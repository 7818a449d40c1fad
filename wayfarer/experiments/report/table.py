"""The tables of a campaign as HTML, with the columns that ``wayfarer sim`` prints and the paper's figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wayfarer.experiments.report.groups import grouped
from wayfarer.experiments.report.load_results import CampaignResults
from wayfarer.experiments.report.ratio_figure import TIMES, WITHIN, quantile, ratios, times, within_percent
from wayfarer.experiments.tables import (
    NAME_COLUMN,
    OUTCOME_COLUMNS,
    PAPER_FIGURES,
    PATH_COLUMNS,
    PaperColumn,
    fault_columns,
    lines_of,
)
from wayfarer.views.page import html

CAPTION = "Success with its 95 % interval; path: of the successes; time and anomalies: mean a trial."


def results_table(results: CampaignResults) -> str:
    """Return a row for each algorithm, under its group, with a row of the paper's below where the paper has one."""
    columns = (NAME_COLUMN, *OUTCOME_COLUMNS, *fault_columns(results.summaries.values()), *PATH_COLUMNS)
    return html.table(CAPTION, [column.title for column in columns], _rows(results, columns))


def ratios_table(results: CampaignResults) -> str:
    """Return the median ratio of each algorithm, and the shares of its trials within some multiples."""
    known = {name: found for name, rows in results.by_algorithm.items() if (found := ratios(rows))}
    rows = [
        ("", [name, times(quantile(found, 0.5)), *(f"{within_percent(found, m):.1f} %" for m in WITHIN)])
        for name, found in known.items()
    ]
    head = ["algorithm", "median", *(f"within {multiple:g} {TIMES}" for multiple in WITHIN)]
    return html.table("Share of the trials that got out within a multiple of the shortest path.", head, rows)


def _rows(results: CampaignResults, columns: Sequence[PaperColumn]) -> Iterator[tuple[str, list[str]]]:
    for group in grouped(results.settings.algorithms):
        yield "group", [group.title, *[""] * (len(columns) - 1)]
        for name in group.algorithms:
            for whose, cells in lines_of(results.summaries[name], columns, PAPER_FIGURES):
                yield whose, [cell.strip() for cell in cells]
