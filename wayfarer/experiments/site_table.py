"""The result table of a scenario, with the figures of the paper's field trials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from wayfarer.experiments.statistics import AlgorithmSummary
from wayfarer.experiments.tables import Layout, PaperColumn, mean_and_sd, number_text, success


class FieldTrials(NamedTuple):
    """What the paper reports of ten trials: successes, and the time to escape of the successes."""

    successes: int
    mean_s: float
    sd_s: float
    interventions: int  # in ten trials, a mean over both scenarios and both algorithms


# The paper, section IV-C: "Human interventions averaging 11 across all 10 trials for the ForestRover (6 for MiniRover)"
BY_FOREST_ROVER, BY_MINI_ROVER = 11, 6
FIELD_TRIALS: Mapping[tuple[str, str, str], FieldTrials] = {
    ("extended-maze", "forestrover", "forest-pledge"): FieldTrials(10, 152.0, 21.0, BY_FOREST_ROVER),
    ("extended-maze", "forestrover", "levy-walk"): FieldTrials(1, 141.0, 0.0, BY_FOREST_ROVER),
    ("extended-maze", "minirover", "forest-pledge"): FieldTrials(10, 51.0, 15.0, BY_MINI_ROVER),
    ("extended-maze", "minirover", "levy-walk"): FieldTrials(6, 47.0, 25.0, BY_MINI_ROVER),
    ("dense-obstruction", "forestrover", "forest-pledge"): FieldTrials(10, 133.0, 32.0, BY_FOREST_ROVER),
    ("dense-obstruction", "forestrover", "levy-walk"): FieldTrials(6, 164.0, 70.0, BY_FOREST_ROVER),
    ("dense-obstruction", "minirover", "forest-pledge"): FieldTrials(10, 38.0, 16.0, BY_MINI_ROVER),
    ("dense-obstruction", "minirover", "levy-walk"): FieldTrials(5, 46.0, 43.0, BY_MINI_ROVER),
}


def _interventions(summary: AlgorithmSummary) -> str:
    """Return how many there were in ten trials, with those of each kind."""
    in_ten = [
        number_text(10.0 * mean)
        for mean in (summary.interventions_mean, summary.overturned_mean, summary.off_wheels_mean)
        if mean is not None
    ]
    return "{} ({}/{})".format(*in_ten) if in_ten else ""


OUTCOME_COLUMNS = (
    PaperColumn("trials", lambda s: str(s.trials), papers=lambda _: "10"),
    PaperColumn("success %\n[95 %]", success, papers=lambda p: number_text(10.0 * p.successes)),
    PaperColumn("entrapped", lambda s: str(s.entrapped), papers=lambda p: str(10 - p.successes)),
    PaperColumn("left\nthe map", lambda s: str(s.left_bounds)),
)
MEASURE_COLUMNS = (
    PaperColumn(
        "time s\nmean ± SD",
        lambda s: mean_and_sd(s.escape_mean_s, s.escape_sd_s),
        papers=lambda p: mean_and_sd(p.mean_s, p.sd_s),
    ),
    PaperColumn("median\ns", lambda s: number_text(s.escape_median_s)),
    PaperColumn(
        "interventions\nin ten trials",
        _interventions,
        papers=lambda p: number_text(float(p.interventions)),
    ),
    PaperColumn("path m\nmean ± SD", lambda s: mean_and_sd(s.path_mean_m, s.path_sd_m)),
    PaperColumn("SPL", lambda s: number_text(s.spl, 3)),
    PaperColumn("anomalies", lambda s: number_text(s.anomalies_mean)),
)


def layout_of(scenario: str, rover: str) -> Layout:
    """Return what the table of a scenario shows; the paper has figures of two scenarios and two rovers."""
    paper = {
        algorithm: trials for (site, who, algorithm), trials in FIELD_TRIALS.items() if (site, who) == (scenario, rover)
    }
    return Layout(OUTCOME_COLUMNS, MEASURE_COLUMNS, paper)
