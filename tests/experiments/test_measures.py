"""The measures, and whether their 95 % intervals cover the truth: by simulated campaigns of 500 layouts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from statistics import NormalDist

import numpy as np
import pytest

from wayfarer.errors import BadInput
from wayfarer.experiments.measures import (
    COMPARED,
    MEASURES,
    Estimate,
    compare,
    difference,
    estimate,
    summarise,
    t_95,
    wilson_interval,
)
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.tables import sentences

SUCCESS, PATH, SPL = COMPARED
MEDIAN = MEASURES["path_median_m"]


def row(algorithm: str, forest: int, noise: int = 0, path_m: float = 80.0, outcome: str = "escaped") -> TrialRow:
    spl = min(1.0, 40.0 / path_m) if outcome in ("escaped", "left_bounds") else 0.0
    return TrialRow(0, algorithm, forest, noise, 1, outcome, path_m, None, None, None, None, 40.0, spl)


def known(found: Estimate | None) -> Estimate:
    assert found is not None
    return found


# -- closed forms ------------------------------------------------------------------------------------------------------


def test_t_is_that_of_scipy() -> None:
    from scipy.stats import t  # a second that each worker would need to collect this file

    assert [t_95(n) for n in range(1, 300)] == pytest.approx(t.ppf(0.975, range(1, 300)).tolist(), abs=1e-4)


@pytest.mark.parametrize(("successes", "trials"), [(0, 1), (0, 1000), (3, 7), (499, 500), (1000, 1000)])
def test_wilson_is_that_of_scipy(successes: int, trials: int) -> None:
    from scipy.stats import binomtest

    expected = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    assert wilson_interval(successes / trials, trials) == pytest.approx((expected.low, expected.high), abs=1e-9)
    independent = [row("x", n, outcome="escaped" if n < successes else "tipped") for n in range(trials)]
    assert known(estimate(independent, SUCCESS)).ends == pytest.approx((100 * expected.low, 100 * expected.high))


def test_mean_of_one_trial_per_layout_has_the_usual_t_interval() -> None:
    paths_m = [70.0, 85.0, 92.0, 110.0, 64.0]
    found = known(estimate([row("x", n, path_m=path_m) for n, path_m in enumerate(paths_m)], PATH))
    half = 2.77645 * np.std(paths_m, ddof=1) / math.sqrt(5)
    mean = np.mean(paths_m)
    assert found[:3] == pytest.approx((mean, mean - half, mean + half))
    assert found[3:] == (5, 5, "t")


@pytest.mark.parametrize("measure", [SUCCESS, PATH, MEDIAN], ids=lambda measure: measure.name)
def test_ten_noises_of_a_layout_that_say_the_same_are_one_piece_of_evidence(measure: object) -> None:
    ends = ["escaped", "entrapped", "left_bounds"]
    once = [row("x", n, path_m=50.0 + n * 7 % 60, outcome=ends[n % 3]) for n in range(60)]
    often = [each._replace(noise=noise) for each in once for noise in range(10)]
    assert known(estimate(often, measure))[:3] == pytest.approx(known(estimate(once, measure))[:3])  # type: ignore[arg-type]


def test_layouts_of_another_order_give_the_same_interval() -> None:
    rows = [row("x", n, path_m=50.0 + n * n % 71) for n in range(40)]
    assert [estimate(rows, each) for each in MEASURES.values()] == [
        estimate(rows[::-1], each) for each in MEASURES.values()
    ]


@pytest.mark.parametrize(("layouts", "has_one"), [(24, False), (25, True)])
def test_median_of_few_layouts_has_no_interval(layouts: int, *, has_one: bool) -> None:
    found = known(estimate([row("x", n, path_m=50.0 + n) for n in range(layouts)], MEDIAN))
    assert (found.low is not None) is has_one


def test_what_is_always_the_same_has_no_interval_and_what_nothing_counts_for_is_unknown() -> None:
    alike = [row("x", n) for n in range(50)]
    assert estimate(alike, PATH) == (80.0, None, None, 50, 50, "none")
    assert estimate(alike[:1], PATH) == (80.0, None, None, 1, 1, "none")
    assert estimate([row("x", 0, outcome="tipped")], PATH) is None
    assert estimate([TrialRow(0, "x", 0, 0, 1, "escaped", 40.0)], SPL) is None
    assert known(estimate(alike[:1], SUCCESS)).ends[0] < 25.0


# -- which trials count ------------------------------------------------------------------------------------------------


def test_paths_are_of_successes_spl_counts_failures_and_a_fault_is_in_no_mean_of_time() -> None:
    ended = {"escaped": 60.0, "left_bounds": 100.0, "entrapped": 1000.0, "tipped": 5.0, "fault": 4000.0}
    rows = [row("x", n, path_m=path, outcome=end)._replace(time_s=path) for n, (end, path) in enumerate(ended.items())]
    figures = summarise("x", rows)
    assert {name: figures[name] for name in ended} == dict.fromkeys(ended, 1)
    assert (figures["path_m"], figures["path_median_m"], figures["escape_s"]) == (80.0, 80.0, 80.0)
    assert (figures["success_percent"], figures["fault_percent"]) == (pytest.approx(40.0), pytest.approx(20.0))
    assert figures["spl"] == pytest.approx((40 / 60 + 40 / 100) / 5)
    assert figures["time_s"] == pytest.approx((60 + 100 + 1000 + 5) / 4)


def test_faults_alone_say_only_that() -> None:
    figures = summarise("x", [TrialRow(n, "x", n, 0, 1, "fault") for n in range(3)])
    assert (figures["success_percent"], figures["fault"]) == (0.0, 3)
    assert {figures[name] for name in ("path_m", "path_sd_m", "spl", "time_s", "anomalies")} == {None}


# -- pairs -------------------------------------------------------------------------------------------------------------


def test_trials_are_paired_by_forest_and_noise_whatever_their_order() -> None:
    rows = [row("base", 1, path_m=80.0), row("base", 2, path_m=100.0), row("new", 2, path_m=90.0), row("new", 1)]
    base, new = compare(rows, "base")
    assert (base.algorithm, base.changes) == ("base", {})
    assert known(new.changes["path_m"]).value == -5.0
    assert known(new.changes["spl"]).value == pytest.approx((40 / 90 - 40 / 100) / 2)


def test_path_is_compared_if_both_got_out_and_spl_always() -> None:
    lost = row("new", 2, path_m=1000.0, outcome="entrapped")
    _, new = compare([row("base", 1), row("base", 2), row("new", 1, path_m=70.0), lost], "base")
    assert known(new.changes["path_m"])[::4] == (-10.0, 1)
    assert known(new.changes["spl"]).value == pytest.approx((40 / 70 - 0.5 - 0.5) / 2)
    assert new.worst == lost


def test_no_pair_that_differs_is_at_most_three_in_the_number_of_layouts() -> None:
    rows = [row(name, n) for name in ("base", "new") for n in range(500)]
    change = known(compare(rows, "base")[1].changes["success_percent"])
    assert change[:3] == pytest.approx((0.0, -0.6, 0.6))
    assert change[3:] == (500, 500, "no pair differs")
    assert change.text(1, "+") == "0, at most 0.6"


def test_worst_is_a_failure_before_any_long_path() -> None:
    _, new = compare(
        [row("base", 1), row("new", 1, path_m=900.0), row("new", 2, path_m=30.0, outcome="tipped")], "base"
    )
    assert new.worst.outcome == "tipped"
    assert (new.as_json()["trials"], new.as_json()["layouts"]) == (2, 2)


def test_comparison_without_any_pair_is_unknown() -> None:
    _, new = compare([row("base", 1), row("new", 2)], "base")
    assert set(new.changes.values()) == {None}
    assert list(sentences(compare([row("base", 1), row("new", 2)]))) == ["new against base: no pair to compare"]


def test_comparison_refuses_what_it_cannot_pair() -> None:
    with pytest.raises(BadInput, match="--against takes one of base, new"):
        compare([row("base", 1), row("new", 1)], "other")
    with pytest.raises(BadInput, match="is alone"):
        compare([row("base", 1)], "base")
    with pytest.raises(BadInput, match="two trials in forest 1 with noise 0"):
        compare([row("base", 1), row("new", 1), row("new", 1)], "base")


def test_sentence_says_the_sign_in_words() -> None:
    rows = [row("base", n, path_m=80.0 + n) for n in range(9)]
    rows += [row("short", n, path_m=76.8 + n + n % 2) for n in range(9)]
    rows += [row("lost", n, path_m=1000.0, outcome="entrapped" if n else "escaped") for n in range(9)]
    short, lost = sentences(compare(rows, "base"))
    assert short.startswith(
        "short against base: success the same in 9 pairs (at most 33.3 %-points either way); path 2.8"
    )
    assert "path 2.8 m shorter [2.4, 3.2] (9 pairs); SPL 0.016 higher [0.014, 0.019] (9 pairs)" in short
    assert lost.startswith("lost against base: success 88.9 %-points lower [")


# -- coverage ----------------------------------------------------------------------------------------------------------

LAYOUTS, CAMPAIGNS, RHO = 500, 400, 0.7
LAYOUTS_OF_MEDIANS = 100  # bootstraps take long
Z = NormalDist()
Values = np.ndarray[tuple[int, int], np.dtype[np.float64]]
Two = tuple[Sequence[TrialRow], Sequence[TrialRow]]  # algorithms


@cache
def levels(noises: int, seed: int) -> list[Values]:
    """Return campaigns of standard normal numbers, a layout a row, with correlation ``RHO`` within a layout."""
    random = np.random.default_rng(seed).standard_normal
    within, between = math.sqrt(1.0 - RHO), math.sqrt(RHO)
    return [between * random((LAYOUTS, 1)) + within * random((LAYOUTS, noises)) for _ in range(CAMPAIGNS)]


def shares(percent: float, noises: int) -> Iterator[Two]:
    """Yield campaigns of two independent algorithms with this share of successes."""
    ends = [
        (row("x", n, noise), row("x", n, noise, outcome="entrapped")) for n in range(LAYOUTS) for noise in range(noises)
    ]

    def rows(of: Values) -> list[TrialRow]:
        fails = (of > Z.inv_cdf(percent / 100.0)).ravel().tolist()
        return [failed if fail else escaped for (escaped, failed), fail in zip(ends, fails, strict=True)]

    for own, other in zip(levels(noises, 1), levels(noises, 2), strict=True):
        yield rows(own), rows(other)


@cache
def paths(noises: int) -> list[Two]:
    """Return campaigns of two algorithms with log-normal paths, correlated in their layouts; 5 % fail in each."""
    random = np.random.default_rng(3)

    def rows(log_paths: Values) -> list[TrialRow]:
        paths_m = np.exp(4.3 + 0.5 * log_paths).ravel().tolist()
        fails = (random.random(log_paths.shape) < 0.05).ravel().tolist()
        return [
            row("x", n // noises, n % noises, path_m, "entrapped" if fail else "escaped")
            for n, (path_m, fail) in enumerate(zip(paths_m, fails, strict=True))
        ]

    return [(rows(own), rows(own + 0.4 * random.standard_normal(own.shape))) for own in levels(noises, 4)]


def coverage(intervals: Iterator[Estimate | None], truth: float) -> float:
    found = [known(each).ends for each in intervals]
    return 100.0 * sum(low <= truth <= high for low, high in found) / len(found)


def of_medians(own: Sequence[TrialRow], _other: Sequence[TrialRow]) -> Estimate | None:
    return estimate((row for row in own if row.forest < LAYOUTS_OF_MEDIANS), MEDIAN)


MEAN_M = math.exp(4.3 + 0.125)
CHANGE_M = MEAN_M * (math.exp((0.5 * 0.4) ** 2 / 2) - 1.0)


@pytest.mark.parametrize(("percent", "noises"), [(50, 2), (80, 2), (95, 2), (99, 2), (95, 1)])
def test_interval_of_a_share_covers_it(percent: int, noises: int) -> None:
    campaigns = list(shares(percent, noises))
    most = 97.0 if percent <= 98 else 100.0
    assert 93.0 <= coverage((estimate(own, SUCCESS) for own, _ in campaigns), percent) <= most
    assert 93.0 <= coverage((difference(own, other, SUCCESS) for own, other in campaigns), 0.0) <= most


@pytest.mark.parametrize("noises", [1, 2])
@pytest.mark.parametrize(
    ("truth", "of"),
    [
        (MEAN_M, lambda own, _: estimate(own, PATH)),
        (math.exp(4.3), of_medians),
        (None, lambda own, _: estimate(own, SPL)),
        (CHANGE_M, lambda own, other: difference(other, own, PATH)),
    ],
    ids=["mean path", "median path", "SPL", "paired difference of path"],
)
def test_interval_of_a_mean_or_a_median_covers_it(
    truth: float | None, of: Callable[[Sequence[TrialRow], Sequence[TrialRow]], Estimate | None], noises: int
) -> None:
    if truth is None:
        grid = np.exp(4.3 + 0.5 * np.array([Z.inv_cdf((n + 0.5) / 100_000) for n in range(100_000)]))
        truth = 0.95 * float(np.minimum(1.0, 40.0 / grid).mean())
    assert 93.0 <= coverage((of(own, other) for own, other in paths(noises)), truth) <= 97.0
