"""Results of campaigns and sweeps: open their folders, and compare algorithms in pairs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wayfarer.errors import BadInput
from wayfarer.experiments.measures import compare as compared
from wayfarer.experiments.results import Results


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
    if results.plan.axes:
        raise BadInput("the results of a sweep have a campaign at each point; compare those of one campaign")
    return [one.as_json() for one in compared(results.rows, against)]


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
