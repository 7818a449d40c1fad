"""The figures of trials: what each is, over which trials it counts, and its estimate with a 95 % interval.

**Layouts are the sampling unit.** The forest file of the paper has two noises in each layout, and how two trials in one
layout go is correlated by 0.7 to 0.8: taken as independent, 1,000 trials would claim an interval a quarter too narrow.
So ``_by_layout`` is the only grouping, and every interval is made of its groups:

* a **mean** is a ratio of sums over layouts, with the t interval of the survey ratio estimator, which is also the
  cluster-robust error of a mean (W. G. Cochran, "Sampling Techniques", 1977, chapter 6; K.-Y. Liang, S. L. Zeger,
  Biometrika 73, 1986);
* a **share** has Wilson's interval with the number of trials divided by the design effect (C. Franco et al., Journal of
  Survey Statistics and Methodology 7, 2019): near 0 and 100 % neither t nor a bootstrap covers what it claims;
* a **difference** of two algorithms, or of two points of a sweep, is the mean over pairs of the same layout and noise;
* a **median** has a bootstrap of whole layouts (C. A. Field, A. H. Welsh, JRSS B 69, 2007), which needs 25 of them.

All but the last are closed forms. The bootstrap is seeded by the trials themselves, so the same rows give the same
interval anywhere. ``tests/experiments/test_measures.py`` has the coverage of each, by simulation.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final, Literal, NamedTuple

from wayfarer.errors import BadInput
from wayfarer.experiments.outcome import OUTCOMES, SUCCESSES
from wayfarer.experiments.rows import TrialRow

Kind = Literal["share", "mean", "median", "sd"]
Groups = Sequence[Sequence[float]]  # the values of each layout, none of them empty

Z_95: Final = statistics.NormalDist().inv_cdf(0.975)
T_95: Final = (12.70620, 4.30265, 3.18245, 2.77645, 2.57058, 2.44691)  # of 1 to 6 degrees of freedom
FEWEST_FOR_MEDIAN: Final = 25  # layouts; below, whole-layout bootstraps claim too much (Flynn and Peters 2004)
RESAMPLES: Final = 2000  # the ends of an interval then move by about 2 % of its width
MOST_DRAWN: Final = 1_000_000  # layouts at a time, for the memory's sake
USUAL_BASELINE: Final = "forest-pledge"  # the paper's best


# -- the table of measures ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Measure:
    """A figure of many trials.

    ``name`` is its key in JSON and in Python, with the unit in it; ``title`` and ``unit`` are what people read, with so
    many ``decimals``. ``better`` says which direction is the better one, None if neither is. ``of`` reads it from the
    row of a trial, None if this trial does not count; a share is 0 or 100.
    """

    name: str
    title: str
    unit: str
    decimals: int
    better: Literal["more", "less"] | None
    kind: Kind
    of: Callable[[TrialRow], float | None]

    @property
    def heading(self) -> str:
        """The title with its unit, as over a column."""
        return f"{self.title}, {self.unit}" if self.unit else self.title

    @property
    def points(self) -> str:
        """The unit of a change."""
        return "%-points" if self.unit == "%" else self.unit


def _share_of(*outcomes: str) -> Callable[[TrialRow], float]:
    return lambda row: 100.0 * (row.outcome in outcomes)


def _unless_fault(name: str) -> Callable[[TrialRow], float | None]:
    """Return what reads a column; a trial that a fault cut off says nothing of it."""
    return lambda row: None if row.outcome == "fault" else getattr(row, name)


MEASURES: Final = {
    each.name: each
    for each in (
        Measure("success_percent", "success", "%", 1, "more", "share", _share_of(*SUCCESSES)),
        Measure("left_bounds_percent", "left the map", "%", 1, None, "share", _share_of("left_bounds")),
        Measure("entrapped_percent", "entrapped", "%", 1, "less", "share", _share_of("entrapped")),
        Measure("tipped_percent", "tipped", "%", 1, "less", "share", _share_of("tipped")),
        Measure("fault_percent", "faults", "%", 1, "less", "share", _share_of("fault")),
        Measure("path_m", "path", "m", 1, "less", "mean", attrgetter("escape_path_m")),
        Measure("path_sd_m", "SD", "m", 1, None, "sd", attrgetter("escape_path_m")),
        Measure("path_median_m", "median path", "m", 1, "less", "median", attrgetter("escape_path_m")),
        Measure("spl", "SPL", "", 3, "more", "mean", attrgetter("counted_spl")),
        Measure("escape_s", "time to escape", "s", 1, "less", "mean", attrgetter("escape_s")),
        Measure("escape_sd_s", "SD", "s", 1, None, "sd", attrgetter("escape_s")),
        Measure("escape_median_s", "median time to escape", "s", 1, "less", "median", attrgetter("escape_s")),
        Measure("time_s", "time", "s", 1, None, "mean", _unless_fault("time_s")),
        Measure("anomalies", "anomalies", "", 1, None, "mean", _unless_fault("anomalies")),
        Measure("interventions", "interventions", "", 2, "less", "mean", _unless_fault("interventions")),
        Measure("overturned", "overturned", "", 2, "less", "mean", _unless_fault("overturned")),
        Measure("off_wheels", "off its wheels", "", 2, "less", "mean", _unless_fault("off_wheels")),
    )
}
COMPARED: Final = tuple(MEASURES[name] for name in ("success_percent", "path_m", "spl"))

WHAT_COUNTS = (
    "Success: escaped, or left the map. Path, and time to escape: of the successes. SPL: over all trials, a failure "
    "counting 0. Time, anomalies and interventions: per trial, without trials that ended in a fault."
)


# -- estimates ---------------------------------------------------------------------------------------------------------


class Estimate(NamedTuple):
    """A figure with its 95 % interval, in the measure's unit, and what it is made of.

    ``low`` and ``high`` are None if so few layouts, or values that are all equal, give no interval. ``trials`` is
    how many counted (of a difference: pairs), in how many ``layouts``; ``method`` is a key of ``METHODS``.
    """

    value: float
    low: float | None
    high: float | None
    layouts: int
    trials: int
    method: str

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the interval as they are drawn; of none the value itself."""
        return (self.value, self.value) if self.low is None or self.high is None else (self.low, self.high)

    def text(self, decimals: int, sign: str = "") -> str:
        """Return the value with its interval in brackets; with ``+`` for a sign each number has one."""
        if self.method == "no pair differs":
            return f"0, at most {self.high:.{decimals}f}"
        shown = f"{self.value:{sign}.{decimals}f}"
        if self.low is None or self.high is None:
            return shown
        return f"{shown} [{self.low:{sign}.{decimals}f}, {self.high:{sign}.{decimals}f}]"


METHODS: Final = {
    "t": "means and changes by t over layouts (ratio estimator)",
    "wilson": "shares by Wilson, with the trials divided by the design effect of layouts",
    "bootstrap": f"medians by a bootstrap of whole layouts, from {FEWEST_FOR_MEDIAN} on",
    "no pair differs": "if no pair differs, at most 3 in the number of layouts",
    "none": "",
}


def estimate(rows: Iterable[TrialRow], measure: Measure) -> Estimate | None:
    """Return a measure of these trials; None if none of them counts."""
    rows = list(rows)
    groups = _by_layout((row.forest, measure.of(row)) for row in rows)
    if not groups:
        return None
    if measure.kind == "share":
        return _share(groups)
    if measure.kind == "median":
        return _median(groups, min(row.seed for row in rows))
    if measure.kind == "sd":
        return _sd(groups)
    mean = _mean(groups)
    if mean.low is None or mean.high is None:
        return mean
    most = 1.0 if measure.name == "spl" else math.inf  # the others are lengths, times and counts
    return mean._replace(low=max(0.0, mean.low), high=min(most, mean.high))


def difference(rows: Iterable[TrialRow], others: Iterable[TrialRow], measure: Measure) -> Estimate | None:
    """Return by how much a share or a mean exceeds that of others, over pairs of the same layout and noise.

    A trial without a partner, or with one that does not count, is left out; None if no pair is left.
    """
    partners = {(row.forest, row.noise): measure.of(row) for row in others}

    def change(row: TrialRow) -> float | None:
        here, there = measure.of(row), partners.get((row.forest, row.noise))
        return None if here is None or there is None else here - there

    groups = _by_layout((row.forest, change(row)) for row in rows)
    if not groups:
        return None
    return _share_change(groups) if measure.kind == "share" else _mean(groups)


def _by_layout(values: Iterable[tuple[int, float | None]]) -> Groups:
    """Return the values that count, in groups of one layout, in the order of their numbers."""
    groups: dict[int, list[float]] = {}
    for layout, value in values:
        if value is not None:
            groups.setdefault(layout, []).append(value)
    return [groups[layout] for layout in sorted(groups)]


def _mean(groups: Groups) -> Estimate:
    count, trials = len(groups), sum(map(len, groups))
    mean, error = _ratio(groups)
    if not error:
        return Estimate(mean, None, None, count, trials, "none")
    half = t_95(count - 1) * error
    return Estimate(mean, mean - half, mean + half, count, trials, "t")


def _ratio(groups: Groups) -> tuple[float, float]:
    """Return the mean of all values, and its standard error over layouts; 0 of one, or of equal ones."""
    count, trials = len(groups), sum(map(len, groups))
    mean = math.fsum(map(math.fsum, groups)) / trials
    if count < 2:
        return mean, 0.0
    squares = math.fsum((math.fsum(values) - mean * len(values)) ** 2 for values in groups)
    return mean, math.sqrt(count / (count - 1) * squares) / trials


def _share(groups: Groups) -> Estimate:
    """Return a share in per cent. Its design effect is between none, and that only layouts count (L. Kish, 1965)."""
    trials = sum(map(len, groups))
    percent, error = _ratio(groups)
    share = percent / 100.0
    most = sum(len(values) ** 2 for values in groups) / trials
    independent = share * (1.0 - share) / trials
    effect = min(most, max(1.0, (error / 100.0) ** 2 / independent)) if error else most
    low, high = wilson_interval(share, trials / effect)
    return Estimate(percent, 100.0 * low, 100.0 * high, len(groups), trials, "wilson")


def _share_change(groups: Groups) -> Estimate:
    """Return a change in percentage points.

    If few pairs differ, t claims too much: the interval, not the value, has one layout more in which this one was
    better, and one in which the other was (D. G. Bonett, R. M. Price, J. Educ. Behav. Statistics 37, 2012).
    """
    count, trials = len(groups), sum(map(len, groups))
    if not any(map(any, groups)):  # the rule of three, for what never happened
        most = 100.0 * min(1.0, 3.0 / count)
        return Estimate(0.0, -most, most, count, trials, "no pair differs")
    each = round(trials / count)
    low, high = _mean([*groups, [100.0] * each, [-100.0] * each])[1:3]
    return Estimate(_ratio(groups)[0], low, high, count, trials, "t")


def _sd(groups: Groups) -> Estimate | None:
    values = [value for group in groups for value in group]
    return Estimate(statistics.stdev(values), None, None, len(groups), len(values), "none") if len(values) > 1 else None


def _median(groups: Groups, seed: int) -> Estimate:
    """Return the median; layouts are drawn with replacement, each with all of its values."""
    flat = sorted((value, layout) for layout, values in enumerate(groups) for value in values)
    median, count = statistics.median([value for value, _ in flat]), len(groups)
    if count < FEWEST_FOR_MEDIAN:
        return Estimate(median, None, None, count, len(flat), "none")
    import numpy as np

    values, layouts = np.array([value for value, _ in flat]), np.array([layout for _, layout in flat])
    random = np.random.Generator(np.random.PCG64(seed)).random  # the same numbers in any version of numpy
    medians = np.empty(RESAMPLES)
    together = max(1, MOST_DRAWN // count)
    for first in range(0, RESAMPLES, together):
        part = medians[first : first + together]
        own = np.arange(len(part))[:, np.newaxis]
        drawn = (random((len(part), count)) * count).astype(np.intp) + own * count
        times = np.bincount(drawn.ravel(), minlength=len(part) * count).reshape(len(part), count).astype(np.int32)
        below = 2 * times[:, layouts].cumsum(axis=1, dtype=np.int32)
        middle = below[:, -1:] // 2
        lower, upper = (below >= middle).argmax(axis=1), (below > middle).argmax(axis=1)
        part[:] = (values[lower] + values[upper]) / 2.0
    low, high = np.quantile(medians, (0.025, 0.975)).tolist()
    return Estimate(median, low, high, count, len(flat), "bootstrap")


def wilson_interval(share: float, trials: float) -> tuple[float, float]:
    """Return the 95 % score interval of a share, within 0..1 (E. B. Wilson, JASA 22, 1927)."""
    spread = Z_95**2 / trials
    centre = share + spread / 2
    half = math.sqrt(spread * (share * (1 - share) + spread / 4))
    return max(0.0, (centre - half) / (1 + spread)), min(1.0, (centre + half) / (1 + spread))


def t_95(freedom: int) -> float:
    """Return the 97.5 % quantile of Student's t, right to 1e-4 (Abramowitz and Stegun, 26.7.5; a table up to 6).

    ``scipy.stats`` has it, and takes a second to import.
    """
    if freedom <= len(T_95):
        return T_95[freedom - 1]
    z, series = Z_95, Z_95
    for power, (divisor, coefficients) in enumerate(_EXPANSION, start=1):
        series += sum(factor * z**exponent for exponent, factor in coefficients.items()) / divisor / freedom**power
    return series


_EXPANSION: Final = (
    (4, {3: 1, 1: 1}),
    (96, {5: 5, 3: 16, 1: 3}),
    (384, {7: 3, 5: 19, 3: 17, 1: -15}),
    (92160, {9: 79, 7: 776, 5: 1482, 3: -1920, 1: -945}),
)


# -- algorithms --------------------------------------------------------------------------------------------------------


def summarise(algorithm: str, rows: Sequence[TrialRow]) -> dict[str, Any]:
    """Return all figures of an algorithm's trials, as JSON and the Python API have them.

    ``low`` and ``high`` after a measure's name are the ends of its interval.
    """
    outcomes = Counter(row.outcome for row in rows)
    figures: dict[str, Any] = {"algorithm": algorithm, "trials": len(rows), "layouts": len({r.forest for r in rows})}
    figures |= {outcome: outcomes[outcome] for outcome in OUTCOMES}
    for measure in MEASURES.values():
        figures |= fields_of(measure.name, estimate(rows, measure), interval=measure.kind != "sd")
    return figures


def fields_of(name: str, found: Estimate | None, *, interval: bool = True) -> dict[str, float | None]:
    """Return an estimate as fields: its value, and the ends of its interval."""
    value, low, high = found[:3] if found else (None, None, None)
    return {name: value} | ({f"{name}_low": low, f"{name}_high": high} if interval else {})


@dataclass(frozen=True, slots=True)
class Comparison:
    """One algorithm, and how it differs from the one that all are compared with.

    ``changes`` has a difference for each of ``COMPARED``, None without a pair, and nothing for the baseline itself.
    ``worst`` is a trial that did not get out, else the longest path.
    """

    algorithm: str
    rows: Sequence[TrialRow]
    changes: dict[str, Estimate | None]
    worst: TrialRow

    def as_json(self) -> dict[str, Any]:
        """Return all of it as JSON and the Python API have it."""
        layouts = len({row.forest for row in self.rows})
        fields: dict[str, Any] = {"algorithm": self.algorithm, "trials": len(self.rows), "layouts": layouts}
        for measure in COMPARED:
            change = self.changes.get(measure.name)
            fields |= fields_of(measure.name, estimate(self.rows, measure))
            fields |= fields_of(f"{measure.name}_change", change)
            fields[f"{measure.name}_change_pairs"] = change.trials if change else 0
        return fields | {"worst_trial": self.worst.trial}


def compare(rows: Iterable[TrialRow], against: str | None = None) -> list[Comparison]:
    """Compare every algorithm of a campaign with one of them, which comes first.

    If none is named that is Forest-Pledge, else the campaign's first one.

    Raises:
        BadInput: that one is not there, is alone, or two trials have the same algorithm, forest and noise; or the rows
            are those of a sweep.
    """
    trials: dict[str, dict[tuple[int, int], TrialRow]] = {}
    for row in rows:
        if row.point:
            raise BadInput("the results of a sweep have a campaign at each point; compare those of one campaign")
        if trials.setdefault(row.algorithm, {}).setdefault((row.forest, row.noise), row) is not row:
            raise BadInput(
                f"{row.algorithm} has two trials in forest {row.forest} with noise {row.noise}, so its trials cannot "
                "be paired; give each line of the forest file its own forest and noise"
            )
    if against is None:
        against = USUAL_BASELINE if USUAL_BASELINE in trials else next(iter(trials))
    if against not in trials:
        raise BadInput(f"no trial of '{against}' to compare with; --against takes one of {', '.join(trials)}")
    if len(trials) == 1:
        raise BadInput(f"{against} is alone; run it with others: wayfarer sim --algorithm {against},pledge")
    base = list(trials.pop(against).values())
    others = {name: list(own.values()) for name, own in trials.items()}
    return [
        Comparison(against, base, {}, _worst(base)),
        *(
            Comparison(name, own, {each.name: difference(own, base, each) for each in COMPARED}, _worst(own))
            for name, own in others.items()
        ),
    ]


def _worst(rows: Iterable[TrialRow]) -> TrialRow:
    return max(rows, key=lambda row: (row.outcome not in SUCCESSES, row.path_m or 0.0))
