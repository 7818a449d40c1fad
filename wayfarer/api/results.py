"""Results of campaigns and sweeps: run them, open their folders, and compare algorithms in pairs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from wayfarer.api.rows import Rows, typed_rows
from wayfarer.errors import BadInput
from wayfarer.experiments.results_folder import swept_values
from wayfarer.experiments.rows import TrialRow, columns_of, types_of
from wayfarer.experiments.statistics import AlgorithmSummary, Estimate, summarise
from wayfarer.extras import require
from wayfarer.fieldlog.wording import plural

if TYPE_CHECKING:
    from wayfarer.experiments.paired_statistics import Comparison, Difference

# The types of the columns of a comparison; the others are numbers with a fraction.
COMPARED = {
    "algorithm": str,
    **dict.fromkeys(("trials", "layouts", "worst_trial"), int),
    **dict.fromkeys(("success_gain_pairs", "spl_gain_pairs", "path_gain_pairs"), int),
}


@dataclass(frozen=True, repr=False)
class Results:
    """The results of a campaign or a sweep.

    ``settings`` are all that decided them, as in ``campaign.json`` or ``sweep.json``: the same settings give the same
    rows, on any computer and with any number of processes. ``rows`` are named tuples, as ``Trial.row``.

    >>> results = run_campaign("pledge", trials=1)
    >>> frame = results.trials.to_pandas()
    >>> frame.groupby("algorithm").size().to_dict()
    {'pledge': 1}
    >>> [row["success_percent"] for row in results.summary]
    [100.0]
    """

    settings: Mapping[str, Any]
    rows: Sequence[TrialRow]

    def __repr__(self) -> str:
        campaign = self.settings.get("campaign", self.settings)
        return f"<Results: {plural(len(self.rows), 'trial')} of {', '.join(campaign['algorithms'])}>"

    @property
    def trials(self) -> Rows:
        """A row for each trial, with the columns of ``trials.csv``; those of a sweep begin with the swept values.

        Paths are in metres, times in simulated seconds, ``spl`` is 0 to 1, and ``outcome`` is ``escaped``,
        ``left_bounds``, ``entrapped``, ``tipped`` or ``fault``. What is not known is None.
        """
        points, types = self._points()
        columns = columns_of(self.settings)

        def read() -> Iterator[dict[str, Any]]:
            for row in self.rows:
                values = row._asdict() | points[row.point]
                yield {name: values[name] for name in columns}

        return typed_rows({name: types[name] for name in columns}, read)

    @property
    def summary(self) -> Rows:
        """A row for each algorithm, of a sweep for each at each point: success with its 95 % interval, path, SPL, time.

        The columns are those of ``summary.json``, in per cent, metres and seconds.
        """
        points, types = self._points()

        def read() -> Iterator[dict[str, Any]]:
            for (point, name), rows in groupby(self.rows, lambda row: (row.point, row.algorithm)):
                yield points[point] | asdict(summarise(name, rows))

        return typed_rows({key: types[key] for key in points[0]} | _types_in(AlgorithmSummary), read)

    def _points(self) -> tuple[list[dict[str, Any]], dict[str, type]]:
        """Return the swept values at each point, of one type for each key, and the types of all columns."""
        points = swept_values(self.settings)
        types = types_of(points)
        return [{key: types[key](value) for key, value in point.items()} for point in points], types


def compare(results: Results, against: str | None = None) -> Rows:
    """Compare the algorithms of a campaign in pairs: each met the same forests with the same noise.

    All are compared with ``against``: without it with Forest-Pledge, or the first one where that is not among them.
    Gives a row for each algorithm, the one that the others are compared with first; its own gains are None.
    ``path_gain_m`` is the mean difference of the paths over the pairs in which both got out, metres, negative where
    this algorithm's path is shorter; ``success_gain`` is that of the success over all pairs, percentage points;
    ``spl_gain`` is that of the SPL, where shortest paths are known. ``_low`` and ``_high`` are the ends of the 95 %
    interval, ``_p`` is the two-sided p-value (both by bootstrap over layouts), and ``_pairs`` how many pairs there
    were. ``entrapped`` and ``left_bounds`` are shares of the trials, 0 to 1. ``worst_trial`` is the number of a trial
    that failed, else of the longest path.

    Raises:
        BadInput: no trial of ``against``, or of no other algorithm; or the results are those of a sweep.

    >>> results = run_campaign(["forest-pledge", "pledge"], trials=2)
    >>> [(row["algorithm"], row["path_gain_pairs"]) for row in compare(results)]
    [('forest-pledge', 0), ('pledge', 2)]
    """
    require("comparing")
    from wayfarer.experiments.paired_statistics import compare as compared

    if "axes" in results.settings:
        raise BadInput("the results of a sweep have a campaign at each point; compare those of one campaign")
    rows = [_paired_row(one) for one in compared(results.rows, against)]
    return typed_rows({name: COMPARED.get(name, float) for name in rows[0]}, lambda: rows)


def _paired_row(one: Comparison) -> dict[str, Any]:
    return {
        "algorithm": one.algorithm,
        "trials": one.trials,
        "layouts": one.layouts,
        "spl": one.spl,
        **_gain("success_gain", one.success_gain),
        **_gain("spl_gain", one.spl_gain),
        **_gain("path_gain", one.path_gain_m, "_m"),
        **_interval("entrapped", one.entrapped),
        **_interval("left_bounds", one.left_bounds),
        "worst_trial": one.worst.trial,
    }


def _gain(name: str, gain: Difference | None, unit: str = "") -> dict[str, float | None]:
    pairs = {f"{name}_p": gain.p if gain else None, f"{name}_pairs": gain.pairs if gain else 0}
    return _interval(name, gain.estimate if gain else None, unit) | pairs


def _interval(name: str, estimate: Estimate | None, unit: str = "") -> dict[str, float | None]:
    value, low, high = estimate or (None, None, None)
    return {f"{name}{unit}": value, f"{name}_low{unit}": low, f"{name}_high{unit}": high}


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
    return Results(found.settings.model_dump(mode="json"), found.rows)


def _types_in(kind: type) -> dict[str, type]:
    """Return the type of each field of a class: that beside None, where a value may be unknown."""
    hints = get_type_hints(kind)
    return {
        name: next((each for each in get_args(hint) if each is not type(None)), hint) for name, hint in hints.items()
    }
