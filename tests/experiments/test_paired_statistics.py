from __future__ import annotations

import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.errors import BadInput
from wayfarer.experiments.paired_statistics import cluster_bootstrap, compare, exact_interval
from wayfarer.experiments.rows import TrialRow


def row(algorithm: str, forest: int, noise: int = 0, path_m: float = 80.0, outcome: str = "escaped") -> TrialRow:
    spl = 40.0 / path_m if outcome in ("escaped", "left_bounds") else 0.0
    return TrialRow(0, algorithm, forest, noise, 1, outcome, path_m, shortest_path_m=40.0, spl=spl)


def chance(successes: range, trials: int, p: float) -> float:
    """The chance of one of these numbers of successes, where each trial has the chance ``p``."""
    return sum(math.comb(trials, k) * p**k * (1.0 - p) ** (trials - k) for k in successes)


@pytest.mark.parametrize(("successes", "trials"), [(1, 2), (3, 10), (12, 500), (499, 500)])
def test_at_the_ends_of_the_exact_interval_so_many_or_so_few_have_a_chance_of_2_5_percent(
    successes: int, trials: int
) -> None:
    low, high = exact_interval(successes, trials)
    assert chance(range(successes, trials + 1), trials, low) == pytest.approx(0.025)
    assert chance(range(successes + 1), trials, high) == pytest.approx(0.025)


def test_none_in_a_thousand_still_says_up_to_0_37_percent() -> None:
    assert exact_interval(0, 1000) == pytest.approx((0.0, 1 - 0.025 ** (1 / 1000)))
    assert exact_interval(1000, 1000) == pytest.approx((0.025 ** (1 / 1000), 1.0))


def test_bootstrap_of_equal_values_is_certain() -> None:
    assert cluster_bootstrap([[2.0, 2.0], [2.0]]) == (2.0, 2.0, 2.0)


def test_bootstrap_draws_layouts_not_trials() -> None:
    chance = Random(1)
    levels = [chance.gauss(0.0, 1.0) for _ in range(100)]
    once = cluster_bootstrap([[level] for level in levels])
    ten_times = cluster_bootstrap([[level] * 10 for level in levels])
    assert ten_times == pytest.approx(once), "ten noises of a layout that say the same are one piece of evidence"
    assert once.high - once.low == pytest.approx(2 * 1.96 * 1.0 / 100**0.5, rel=0.25)


def test_bootstrap_weighs_every_value_alike() -> None:
    assert cluster_bootstrap([[1.0, 1.0, 1.0], [5.0]]).value == 2.0


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=30), st.floats(-3.0, 3.0))
def test_bootstrap_moves_with_the_values(values: list[float], shift: float) -> None:
    here = cluster_bootstrap([[value] for value in values], resamples=200)
    there = cluster_bootstrap([[value + shift] for value in values], resamples=200)
    assert there == pytest.approx([part + shift for part in here], abs=1e-9)
    assert here.low - 1e-9 <= here.value + 1e-9
    assert here.value <= max(values) + 1e-9


def test_trials_are_paired_by_forest_and_noise_whatever_their_order() -> None:
    rows = [row("base", 1, path_m=80.0), row("base", 2, path_m=100.0), row("new", 2, path_m=90.0), row("new", 1)]
    base, new = compare(rows, "base")
    assert (base.algorithm, base.spl_gain, base.path_gain_m) == ("base", None, None)
    assert new.path_gain_m is not None
    assert new.path_gain_m.value == -5.0
    assert new.spl_gain is not None
    assert new.spl_gain.value == pytest.approx((40 / 90 - 40 / 100) / 2)


def test_path_is_compared_where_both_got_out_and_spl_everywhere() -> None:
    rows = [
        row("base", 1), row("base", 2), row("new", 1, path_m=70.0), row("new", 2, path_m=1000.0, outcome="entrapped"),
    ]  # fmt: skip
    _, new = compare(rows, "base")
    assert new.path_gain_m is not None
    assert new.path_gain_m.value == -10.0
    assert new.spl_gain is not None
    assert new.spl_gain.value == pytest.approx((40 / 70 - 0.5 - 0.5) / 2)
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
