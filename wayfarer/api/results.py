"""Results of campaigns and sweeps: their tables and plots, open their folders, and compare algorithms in pairs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wayfarer.errors import BadInput
from wayfarer.experiments import results as stored
from wayfarer.experiments.measures import compare as compared
from wayfarer.experiments.measures import summarise
from wayfarer.extras import require

if TYPE_CHECKING:
    from wayfarer.logview.terminal_table import TextTable
    from wayfarer.reports.page.html import Plot


class Results(stored.Results):
    """The results of a campaign or a sweep; a notebook shows them as a table with 95 % intervals.

    ``rows`` are named tuples, as ``Trial.row``; ``trials`` are the same as dicts. ``settings`` are those of
    ``campaign.json``: the same settings give the same rows, on any computer and with any number of processes. ``swept``
    has the values of the swept keys at each point, the last key varying fastest; a campaign is one point.

    >>> results = run_campaign("pledge", trials=1)
    >>> [(row["algorithm"], row["outcome"]) for row in results.trials]
    [('pledge', 'escaped')]
    >>> [row["success_percent"] for row in results.summary]
    [100.0]
    """

    @property
    def summary(self) -> list[dict[str, Any]]:
        """A row for each algorithm, in a sweep for each algorithm at each point: success, path, SPL, time and others.

        The columns are those that ``wayfarer sim --json`` prints, with their units in their names. Beside a value are
        the ends of its 95 % interval: ``path_m``, ``path_m_low``, ``path_m_high``. Layouts are the sampling unit.
        A notebook shows the table of the report.
        """
        rows = (self.swept[point] | summarise(name, own) for (point, name), own in self.cells.items())
        return Shown(rows, self._table)

    def plot(self) -> Plot:
        """Return the figures of the report, which a notebook shows and ``save`` writes.

        A campaign has the figure of the paths, a sweep over one key a curve for each measure with its 95 % intervals,
        and over two keys maps. ``figures`` are Bokeh's figures. Trials that have not ended are left out.

        Raises:
            BadInput: no trial has ended yet.
            MissingPackage: Bokeh, of the extra ``sim``, is not installed.
        """
        require("a plot")
        if not self.rows:
            raise BadInput(f"none of the {self.total} trials has ended yet; plot them later")
        if self.plan.axes:
            from wayfarer.reports.sweep import sweep_plot

            return sweep_plot(self)
        from wayfarer.reports.campaign import campaign_plot

        return campaign_plot(self)

    def _table(self) -> TextTable:
        from wayfarer.experiments.tables import table_of

        return table_of(self, full=True)

    def _repr_html_(self) -> str | None:
        if not (self.rows and find_spec("jinja2")):
            return None  # it is printed then
        from wayfarer.experiments.tables import result_sentences, unfinished
        from wayfarer.reports.page import html

        result = "" if self.plan.axes else html.result(result_sentences(self))
        return "".join([html.paragraph(unfinished(self)), result, as_html(self._table())])


class Shown(list[dict[str, Any]]):
    """Rows as dicts, which a notebook shows as a table of texts."""

    def __init__(self, rows: Iterable[dict[str, Any]], table: Callable[[], TextTable]) -> None:
        super().__init__(rows)
        self._table = table

    def _repr_html_(self) -> str | None:
        """Return the table; None, so that the rows are printed, if there is none or nothing to make HTML with."""
        return as_html(self._table()) if self and find_spec("jinja2") else None


def as_html(table: TextTable) -> str:
    """Return a table with its notes."""
    from wayfarer.reports.page import html

    # Notebooks break lines in cells, also within an interval.
    rows = [(kind, [cell.replace(", ", ",\N{NO-BREAK SPACE}") for cell in cells]) for kind, cells in table.rows]
    return html.table("Value [95 % interval]", table.titles, html.below(rows)) + html.bullets(table.notes)


def compare(results: Results, against: str | None = None) -> list[dict[str, Any]]:
    """Compare the algorithms of a campaign in pairs: each met the same forests with the same noise.

    All are compared with ``against``: without it with Forest-Pledge, or the first one if that is not among them.
    Returns a row for each algorithm; the first is the one that the others are compared with, and its changes are None.
    ``path_m_change`` is the mean difference of the paths over the pairs in which both got out, metres, negative if
    this algorithm's path is shorter; ``success_percent_change`` is that of the success over all pairs, percentage
    points; ``spl_change`` is that of the SPL, if shortest paths are known. ``_low`` and ``_high`` are the ends of the
    95 % interval, over layouts, and ``_pairs`` is the number of pairs. ``path_m``, ``success_percent`` and ``spl`` are
    the algorithm's own. ``worst_trial`` is the number of a trial that failed, else of the longest path. A notebook
    shows the table of ``wayfarer compare``.

    Raises:
        BadInput: no trial of ``against``, or of no other algorithm; or the results are those of a sweep.

    >>> results = run_campaign(["forest-pledge", "pledge"], trials=2)
    >>> [(row["algorithm"], row["path_m_change_pairs"]) for row in compare(results)]
    [('forest-pledge', 0), ('pledge', 2)]
    """
    from wayfarer.experiments.tables import comparison_table

    found = compared(results.rows, against)
    return Shown((one.as_json() for one in found), partial(comparison_table, found))


def open_results(folder: str | Path, *, unfinished: bool = False) -> Results:
    """Open the results folder of a campaign or a sweep: of ``run_campaign``, ``wayfarer sim --out`` and others.

    Args:
        folder: of the results.
        unfinished: open it also if trials are missing, as while it runs; ``Results.finished`` says whether any are.

    Raises:
        BadInput: no such folder, no campaign or sweep in it, not finished, or damaged; the text says what to do.

    >>> run_campaign("pledge", trials=1, out="results")
    <Results: 1 trial of pledge>
    >>> open_results("results")
    <Results: 1 trial of pledge>
    """
    return Results.open(Path(folder), unfinished=unfinished)
