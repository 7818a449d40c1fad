"""The Kaplan-Meier estimate, against scipy's and against what it must be where nothing is censored."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import CensoredData, ecdf

from tests.report.campaigns import row
from wayfarer.report.survival import escape_curve, kaplan_meier

# Few different values, so that many are equal; a multiple of 0.25 is exact.
paths_m = st.lists(st.integers(1, 40).map(lambda quarter: quarter / 4), max_size=60)


@given(paths_m.filter(bool), paths_m)
def test_estimate_is_scipys(escaped_m: list[float], censored_m: list[float]) -> None:
    curve = kaplan_meier(escaped_m, censored_m)
    theirs = ecdf(CensoredData(uncensored=np.array(escaped_m), right=np.array(censored_m))).cdf
    assert [step.path_m for step in curve.steps] == sorted(set(escaped_m))
    expected = theirs.evaluate([step.path_m for step in curve.steps])
    assert [step.escaped for step in curve.steps] == pytest.approx(list(expected), abs=1e-12)


@given(paths_m.filter(bool))
def test_without_failures_it_is_the_share_that_has_escaped(escaped_m: list[float]) -> None:
    curve = kaplan_meier(escaped_m, [])
    for step in curve.steps:
        assert step.escaped == pytest.approx(sum(path_m <= step.path_m for path_m in escaped_m) / len(escaped_m))
    assert curve.escaped == pytest.approx(1.0)


def test_failures_weigh_only_up_to_where_they_were_last_seen() -> None:
    early = kaplan_meier([50.0, 100.0], [10.0, 10.0])
    late = kaplan_meier([50.0, 100.0], [200.0, 200.0])
    assert early.escaped == pytest.approx(1.0)
    assert late.escaped == pytest.approx(0.5)


def test_trials_are_sorted_by_outcome_and_those_of_unknown_path_left_out() -> None:
    outcomes = ("escaped", "left_bounds", "entrapped", "tipped", "fault")
    rows = [row("pledge", n, outcome, 10.0 * (n + 1)) for n, outcome in enumerate(outcomes)]
    curve = escape_curve([*rows, row("pledge", 9, "fault", None)])
    assert [step.path_m for step in curve.steps] == [10.0, 20.0]
    assert curve.censored_m == [30.0, 40.0, 50.0]
    assert curve.escaped == pytest.approx(2 / 5)


def test_nobody_escaped() -> None:
    curve = escape_curve([row("levy-walk", 0, "entrapped", 1000.0)])
    assert (curve.steps, curve.censored_m, curve.escaped) == ([], [1000.0], 0.0)
