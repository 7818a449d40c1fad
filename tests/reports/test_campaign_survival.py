"""The curve of escapes over distance: it ends where the table says, and no failure is forgotten."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.reports.campaigns import row
from tests.reports.reading_plots import columns, legend
from wayfarer.experiments.measures import summarise
from wayfarer.experiments.outcome import OUTCOMES, SUCCESSES
from wayfarer.experiments.rows import TrialRow
from wayfarer.reports.figures import escape_curve, escape_figure

# Few different values, so that many are equal; a multiple of 0.25 is exact.
PATHS_M = st.integers(1, 40).map(lambda quarter: quarter / 4)
SUCCESS, FAILURE = st.sampled_from(sorted(SUCCESSES)), st.sampled_from(sorted(set(OUTCOMES) - set(SUCCESSES)))
ENDS = st.tuples(SUCCESS, PATHS_M) | st.tuples(FAILURE, PATHS_M | st.none())
TRIALS = st.lists(ENDS, min_size=1, max_size=60).map(
    lambda ends: [row("levy-walk", trial, outcome, path_m) for trial, (outcome, path_m) in enumerate(ends)]
)


@given(TRIALS)
def test_curve_is_the_share_of_all_trials_that_has_escaped(rows: list[TrialRow]) -> None:
    escaped_m = [each.path_m for each in rows if each.outcome in ("escaped", "left_bounds")]
    steps = dict(zip(*escape_curve(rows).steps(0.1), strict=True))  # of equal paths the last, highest one
    assert max(steps) == max([0.1, *(each.path_m for each in rows if each.path_m)])
    for reached_m, percent in steps.items():
        escaped = sum(path_m <= reached_m for path_m in escaped_m if path_m)
        assert percent == pytest.approx(100 * escaped / len(rows))


@given(TRIALS)
def test_legend_and_last_corner_say_the_success_of_the_table(rows: list[TrialRow]) -> None:
    success = summarise("levy-walk", rows)["success_percent"]
    figure = escape_figure({"levy-walk": rows})
    assert legend(figure) == [f"levy-walk, {success:.1f} %"]
    assert columns(figure, "levy-walk")["y"][-1] == pytest.approx(success, rel=1e-6)


def test_curve_is_drawn_as_stairs() -> None:
    rows = [row("pledge", 0, path_m=50.0), row("pledge", 1, path_m=80.0), row("pledge", 2, "entrapped", 400.0)]
    figure = escape_figure({"pledge": rows})
    drawn = columns(figure, "pledge")
    assert drawn["x"][1:] == [50, 50, 80, 80, 400, 400]
    assert drawn["y"] == pytest.approx([0, 0, 100 / 3, 100 / 3, 200 / 3, 200 / 3, 200 / 3])
