"""Results of campaigns and sweeps: run them, open their folders, and compare algorithms in pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from wayfarer.errors import BadInput
from wayfarer.experiments.measures import compare as compared
from wayfarer.experiments.measures import summarise
from wayfarer.experiments.results_folder import swept_values
from wayfarer.experiments.rows import TrialRow, columns_of
from wayfarer.fieldlog.wording import plural


@dataclass(frozen=True, repr=False)
class Results:
    """The results of a campaign or a sweep.

    ``settings`` are all that decided them, as in ``campaign.json`` or ``sweep.json``: the same settings give the same
    rows, on any computer and with any number of processes. ``rows`` are named tuples, as ``Trial.row``.

    >>> results = run_campaign("pledge", trials=1)
    >>> [(row["algorithm"], row["outcome"]) for row in results.trials]
    [('pledge', 'escaped')]
    >>> [row["success_percent"] for row in results.summary]
    [100.0]
    """

    settings: Mapping[str, Any]
    rows: Sequence[TrialRow]

    def __repr__(self) -> str:
        campaign = self.settings.get("campaign", self.settings)
        return f"<Results: {plural(len(self.rows), 'trial')} of {', '.join(campaign['algorithms'])}>"

    @property
    def trials(self) -> list[dict[str, Any]]:
        """A row for each trial, with the columns of ``trials.csv``; those of a sweep begin with the swept values.

        Paths are in metres, times in simulated seconds, ``spl`` is 0 to 1, and ``outcome`` is ``escaped``,
        ``left_bounds``, ``entrapped``, ``tipped`` or ``fault``. What is not known is None.
        """
        points, columns = swept_values(self.settings), columns_of(self.settings)
        all_values = (row.cells() | points[row.point] for row in self.rows)
        return [{name: values[name] for name in columns} for values in all_values]

    @property
    def summary(self) -> list[dict[str, Any]]:
        """A row for each algorithm, of a sweep for each at each point: success, path, SPL, time and others.

        The columns are those that ``wayfarer sim --json`` prints, with their units in their names. Beside a value are
        the ends of its 95 % interval: ``path_m``, ``path_m_low``, ``path_m_high``. Layouts are the sampling unit.
        """
        points, cells = swept_values(self.settings), groupby(self.rows, lambda row: (row.point, row.algorithm))
        return [points[point] | summarise(name, list(rows)) for (point, name), rows in cells]


def compare(results: Results, against: str | None = None) -> list[dict[str, Any]]:
    """Compare the algorithms of a campaign in pairs: each met the same forests with the same noise.

    All are compared with ``against``: without it with Forest-Pledge, or the first one if that is not among them.
    Gives a row for each algorithm, the one that the others are compared with first; its own changes are None.
    ``path_m_change`` is the mean difference of the paths over the pairs in which both got out, metres, negative if
    this algorithm's path is shorter; ``success_percent_change`` is that of the success over all pairs, percentage
    points; ``spl_change`` is that of the SPL, if shortest paths are known. ``_low`` and ``_high`` are the ends of the
    95 % interval, over layouts, and ``_pairs`` is the number of pairs. ``path_m``, ``success_percent`` and ``spl`` are
    the algorithm's own. ``worst_trial`` is the number of a trial that failed, else of the longest path.

    Raises:
        BadInput: no trial of ``against``, or of no other algorithm; or the results are those of a sweep.

    >>> results = run_campaign(["forest-pledge", "pledge"], trials=2)
    >>> [(row["algorithm"], row["path_m_change_pairs"]) for row in compare(results)]
    [('forest-pledge', 0), ('pledge', 2)]
    """
    if "axes" in results.settings:
        raise BadInput("the results of a sweep have a campaign at each point; compare those of one campaign")
    return [one.as_json() for one in compared(results.rows, against)]


def open_results(folder: str | Path) -> Results:
    """Open the results folder of a campaign or a sweep: of ``run_campaign``, ``wayfarer sim --out`` and others.

    Raises:
        BadInput: no such folder, no campaign or sweep in it, not finished, or damaged; the text says what to do.

    >>> run_campaign("pledge", trials=1, out="results")
    <Results: 1 trial of pledge>
    >>> open_results("results")
    <Results: 1 trial of pledge>
    """
    from wayfarer.experiments.report.load_results import read_results
    from wayfarer.experiments.report.sweep_results import is_sweep, read_sweep

    path = Path(folder)
    found = read_sweep(path) if is_sweep(path) else read_results(path)
    return Results(found.settings.settings(), found.rows)
