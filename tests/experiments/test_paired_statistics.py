from __future__ import annotations

import math
import statistics
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.errors import BadInput
from wayfarer.experiments.paired_statistics import cluster_bootstrap, compare, exact_interval
from wayfarer.experiments.paired_table import sentences
from wayfarer.experiments.rows import TrialRow


def row(algorithm: str, forest: int, noise: int = 0, path_m: float = 80.0, outcome: str = "escaped") -> TrialRow:
    spl = 40.0 / path_m if outcome in ("escaped", "left_bounds") else 0.0
    return TrialRow(0, algorithm, forest, noise, 1, outcome, path_m, shortest_path_m=40.0, spl=spl)


def test_none_in_a_thousand_still_says_up_to_0_37_percent() -> None:
    assert exact_interval(0, 1000) == pytest.approx((0.0, 1 - 0.025 ** (1 / 1000)))
    assert exact_interval(1000, 1000) == pytest.approx((0.025 ** (1 / 1000), 1.0))


def test_bootstrap_draws_layouts_not_trials() -> None:
    rng = Random(1)
    levels = [rng.gauss(0.0, 1.0) for _ in range(100)]
    once = cluster_bootstrap([[level] for level in levels])
    ten_times = cluster_bootstrap([[level] * 10 for level in levels])
    assert ten_times.estimate == pytest.approx(once.estimate), (
        "ten noises of a layout that say the same are one piece of evidence"
    )
    assert once.estimate.high - once.estimate.low == pytest.approx(2 * 1.96 * 1.0 / 100**0.5, rel=0.25)


def test_bootstrap_weighs_every_value_alike() -> None:
    assert cluster_bootstrap([[1.0, 1.0, 1.0], [5.0]]).estimate.value == 2.0


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=30), st.floats(-3.0, 3.0))
def test_bootstrap_moves_with_the_values(values: list[float], shift: float) -> None:
    here = cluster_bootstrap([[value] for value in values], resamples=200).estimate
    there = cluster_bootstrap([[value + shift] for value in values], resamples=200).estimate
    assert there == pytest.approx([part + shift for part in here], abs=1e-9)
    assert here.low - 1e-9 <= here.value + 1e-9
    assert here.value <= max(values) + 1e-9


def test_p_is_small_exactly_where_the_interval_has_no_zero() -> None:
    rng = Random(2)
    for shift in (-1.0, -0.2, 0.0, 0.2, 1.0):
        found = cluster_bootstrap([[rng.gauss(shift, 1.0)] for _ in range(60)])
        assert 0.0 < found.p <= 1.0
        assert (found.p < 0.05) is (found.estimate.low > 0.0 or found.estimate.high < 0.0), found
    certain = cluster_bootstrap([[2.0, 2.0], [2.0]])
    assert certain.estimate == (2.0, 2.0, 2.0)
    assert certain.p == pytest.approx(2 / 4001)
    assert cluster_bootstrap([[0.0], [0.0]]).p == 1.0


def test_p_is_that_of_the_normal_test_where_there_are_many_pairs() -> None:
    rng = Random(3)
    for shift in (0.0, 0.1, 0.2):
        values = [rng.gauss(shift, 1.0) for _ in range(200)]
        z = statistics.fmean(values) / (statistics.stdev(values) / math.sqrt(len(values)))
        expected = 2 * (1 - statistics.NormalDist().cdf(abs(z)))
        tolerance = 3 * 2 * math.sqrt(expected / 2 * (1 - expected / 2) / 4000) + 0.005  # of the resamples' number
        assert cluster_bootstrap([[value] for value in values]).p == pytest.approx(expected, abs=tolerance)


def test_sentence_says_the_sign_in_words() -> None:
    rows = [row("base", forest, path_m=80.0) for forest in range(9)]
    rows += [row("short", forest, path_m=76.8) for forest in range(9)]
    rows += [row("long", forest, path_m=81.0) for forest in range(8)]
    rows += [row("lost", forest, path_m=1000.0, outcome="entrapped") for forest in range(9)]
    assert list(sentences(compare(rows, "base"))) == [
        "short against base: path 3.2 m shorter [3.2, 3.2], p < 0.001 (9 pairs); "
        "SPL 0.021 higher [0.021, 0.021], p < 0.001 (9 pairs)",
        "long against base: path 1.0 m longer [1.0, 1.0], p < 0.001 (8 pairs); "
        "SPL 0.006 lower [0.006, 0.006], p < 0.001 (8 pairs)",
        "lost against base: success 100.0 %-points lower [100.0, 100.0], p < 0.001 (9 pairs); "
        "SPL 0.500 lower [0.500, 0.500], p < 0.001 (9 pairs)",
    ]


def test_trials_are_paired_by_forest_and_noise_whatever_their_order() -> None:
    rows = [row("base", 1, path_m=80.0), row("base", 2, path_m=100.0), row("new", 2, path_m=90.0), row("new", 1)]
    base, new = compare(rows, "base")
    assert (base.algorithm, base.spl_gain, base.path_gain_m) == ("base", None, None)
    assert new.path_gain_m is not None
    assert new.path_gain_m.estimate.value == -5.0
    assert new.spl_gain is not None
    assert new.spl_gain.estimate.value == pytest.approx((40 / 90 - 40 / 100) / 2)


def test_path_is_compared_where_both_got_out_and_spl_everywhere() -> None:
    rows = [
        row("base", 1), row("base", 2), row("new", 1, path_m=70.0), row("new", 2, path_m=1000.0, outcome="entrapped"),
    ]  # fmt: skip
    _, new = compare(rows, "base")
    assert new.path_gain_m is not None
    assert new.path_gain_m.estimate.value == -10.0
    assert new.spl_gain is not None
    assert new.spl_gain.estimate.value == pytest.approx((40 / 70 - 0.5 - 0.5) / 2)
    assert new.entrapped.value == 0.5
    assert new.worst.forest == 2


def test_worst_case_is_a_failure_before_any_long_path() -> None:
    rows = [row("base", 1), row("new", 1, path_m=900.0), row("new", 2, path_m=30.0, outcome="tipped")]
    _, new = compare(rows, "base")
    assert new.worst.outcome == "tipped"
    assert (new.trials, new.layouts) == (2, 2)


def test_gain_without_any_pair_is_unknown() -> None:
    _, new = compare([row("base", 1), row("new", 2)], "base")
    assert (new.spl_gain, new.path_gain_m) == (None, None)


def test_comparison_refuses_what_it_cannot_pair() -> None:
    with pytest.raises(BadInput, match="--against takes one of base, new"):
        compare([row("base", 1), row("new", 1)], "other")
    with pytest.raises(BadInput, match="is alone"):
        compare([row("base", 1)], "base")
    with pytest.raises(BadInput, match="two trials in forest 1 with noise 0"):
        compare([row("base", 1), row("new", 1), row("new", 1)], "base")
