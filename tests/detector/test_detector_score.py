"""Claims compared with what is really there."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.detector import CASES, HEADER, DetectorCase, delay_s, measure, rows
from benchmarks.detector_score import NOTHING, Score, Timeline, TimeSpan, score
from wayfarer.config.rover_file import load_rover
from wayfarer.escape.api import Anomaly

WAITS_S = 0.4

spans = st.lists(st.integers(0, 1000), min_size=0, max_size=20, unique=True).map(
    lambda times: [TimeSpan(a / 10, b / 10) for a, b in zip(sorted(times)[::2], sorted(times)[1::2], strict=False)]
)


def test_claim_within_an_episode_is_right_and_its_delay_is_counted() -> None:
    found = score([TimeSpan(1.0, 3.0)], [TimeSpan(1.3, 3.0)], WAITS_S)
    assert found[:4] == (1, 1, 1, 1)
    assert found.delays_s == pytest.approx((0.3,))


def test_delays_are_summed_up_as_median_and_95th_percentile_within_what_was_seen() -> None:
    some_s = tuple(n / 100 for n in range(1, 20))
    assert delay_s(NOTHING._replace(delays_s=some_s)) == pytest.approx((0.10, 0.19))
    assert delay_s(NOTHING._replace(delays_s=(0.2, 0.1))) == pytest.approx((0.15, 0.2))
    assert delay_s(NOTHING._replace(delays_s=(0.1,))) is None


def test_episode_without_a_claim_is_missed_and_a_claim_without_an_episode_wrong() -> None:
    assert score([TimeSpan(1.0, 3.0)], [TimeSpan(5.0, 6.0)], WAITS_S) == Score(1, 0, 1, 0, ())


def test_episode_that_ends_before_anything_can_be_known_counts_as_none() -> None:
    assert score([TimeSpan(1.0, 1.3)], [], WAITS_S) == NOTHING


def test_claim_right_after_the_end_is_late_and_not_wrong() -> None:
    assert score([TimeSpan(1.0, 2.0)], [TimeSpan(2.1, 2.5)], WAITS_S).right == 1
    assert score([TimeSpan(1.0, 2.0)], [TimeSpan(2.2, 2.5)], WAITS_S).right == 0


@given(spans)
def test_claims_that_are_the_truth_are_perfect(really: list[TimeSpan]) -> None:
    found = score(really, really, WAITS_S)
    assert found.episodes == found.found == found.claims == found.right == len(really)
    assert set(found.delays_s) <= {0.0}


@given(spans, spans)
def test_no_more_is_found_than_there_is(really: list[TimeSpan], claimed: list[TimeSpan]) -> None:
    found = score(really, claimed, WAITS_S)
    assert found.found <= found.episodes <= len(really)
    assert found.right <= found.claims == len(claimed)


def test_timeline_joins_samples_and_ends_a_span_with_the_last_that_held() -> None:
    timeline = Timeline()
    for t_s, keys in ((0.0, ["a"]), (0.1, ["a", "b"]), (0.2, ["b"]), (0.3, [])):
        timeline.sample(t_s, keys)
    timeline.end()
    assert timeline.spans == {"a": [TimeSpan(0.0, 0.1)], "b": [TimeSpan(0.1, 0.2)]}


def test_detector_that_waits_too_long_finds_less() -> None:
    """The measurement can fail: a detector that needs ten seconds of standing still is blind to slips."""
    rover, cell = load_rover("sim"), DetectorCase("motion", 2.0, 1.0)
    blind = rover.model_copy(update={"detector": replace(rover.detector, immobilised_s=10.0)})
    good, bad = (measure(config, cell, 0)[Anomaly.IMMOBILISED] for config in (rover, blind))
    assert good.found == good.episodes > 5
    assert bad.found < good.found


def test_more_noise_makes_more_claims_of_tilt_wrong_or_late() -> None:
    calm, rough = (measure(load_rover("sim"), DetectorCase("motion", 10.0, noise), 1) for noise in (1.0, 20.0))
    assert rough[Anomaly.NOSE_UP].claims > calm[Anomaly.NOSE_UP].claims


@pytest.mark.process
def test_table_has_each_anomaly_once_in_each_of_its_cases() -> None:
    lines = [dict(zip(HEADER, line, strict=True)) for line in rows(load_rover("sim"), CASES[::4], 1)]
    assert [(line["anomaly"].strip("`"), line["noise"]) for line in lines] == [(each.value, "1x") for each in Anomaly]
    immobilised = lines[0]
    assert int(immobilised["episodes"]) > 5
    assert float(immobilised["recall"]) > 0.9
    assert float(immobilised["precision"]) > 0.9
    assert 0.2 < float(immobilised["delay s"]) <= float(immobilised["p95 s"])
