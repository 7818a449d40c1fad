from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import spread_of, summarise, wilson_interval

counts = st.integers(1, 5000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


def row(
    outcome: str, path_m: float | None = None, shortest_path_m: float | None = None, spl: float | None = None
) -> TrialRow:
    return TrialRow(0, "pledge", 0, 0, 1, outcome, path_m, shortest_path_m=shortest_path_m, spl=spl)


@given(counts)
def test_wilson_interval_agrees_with_scipy(count: tuple[int, int]) -> None:
    from scipy.stats import binomtest  # a second that each worker would need to collect this file

    expected = binomtest(*count).proportion_ci(0.95, method="wilson")
    low, high = wilson_interval(*count)
    assert (low, high) == pytest.approx((expected.low, expected.high), abs=1e-9)
    assert 0 <= low <= high <= 1


@pytest.mark.parametrize("count", [(0, 0), (3, 2), (-1, 5)])
def test_wilson_interval_refuses_impossible_counts(count: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="successes in"):
        wilson_interval(*count)


def test_spread_of_few_values_is_unknown_where_it_is() -> None:
    assert spread_of([]) == (None, None, None)
    assert spread_of([4.0]) == (4.0, None, 4.0)
    assert spread_of([1.0, 2.0, 6.0]) == pytest.approx((3.0, math.sqrt(7), 2.0))


def test_spl_counts_failures_as_zero_and_leaves_out_what_has_no_shortest_path() -> None:
    rows = [row("escaped", 80, 40, 0.5), row("entrapped", 1000, 40, 0.0), row("fault", None, 40), row("escaped", 9)]
    assert summarise("pledge", rows).spl == pytest.approx(0.5 / 3)
    assert summarise("pledge", [row("escaped", 9)]).spl is None


def test_summary_takes_paths_from_successes_alone() -> None:
    ended = {"escaped": 60, "left_bounds": 100, "entrapped": 1000, "tipped": 5, "fault": None}
    rows = [row(outcome, path_m) for outcome, path_m in ended.items()]
    summary = summarise("pledge", rows)
    assert (summary.path_mean_m, summary.path_median_m) == (80, 80)
    assert summary.success_percent == pytest.approx(40)
    assert (summary.escaped, summary.left_bounds, summary.entrapped, summary.tipped, summary.fault) == (1,) * 5


def test_summary_of_faults_alone_knows_only_that() -> None:
    summary = summarise("pledge", [row("fault")] * 3)
    assert summary.success_percent == 0
    assert (summary.path_mean_m, summary.path_sd_m, summary.spl, summary.time_mean_s) == (None,) * 4
