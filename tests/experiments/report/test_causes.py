"""Causes are counted over all failures of a campaign, from its rows alone."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from tests.experiments.report.campaigns import row
from wayfarer.experiments.report.causes import (
    CAUSES,
    DISARMED,
    ERROR,
    GAVE_UP,
    PATH,
    TIME,
    TIPPED,
    cause_of,
    failures_section,
    time_limit_s,
)
from wayfarer.experiments.report.load_results import CampaignResults, read_results
from wayfarer.experiments.rows import TrialRow

ENTRAPPED = row("pledge", 0, "entrapped", 20.0)


@pytest.fixture(scope="module")
def results(finished: Path) -> CampaignResults:
    """The path budget of this campaign is 90 m, so its time is 360 s."""
    return read_results(finished)


@pytest.mark.parametrize(
    ("trial", "cause"),
    [
        (row("pledge", 0), None),
        (row("pledge", 0, "left_bounds"), None),
        (row("pledge", 0, "entrapped", 90.0), PATH),
        (row("pledge", 0, "entrapped", 90.004), PATH),
        (ENTRAPPED._replace(time_s=360.0), TIME),
        (ENTRAPPED._replace(time_s=359.9), GAVE_UP),
        (row("pledge", 0, "tipped", 20.0), TIPPED),
        (row("pledge", 0, "fault", 20.0), DISARMED),
        (row("pledge", 0, "fault", None), ERROR),
    ],
)
def test_cause_follows_from_the_row(results: CampaignResults, trial: TrialRow, cause: str | None) -> None:
    assert cause_of(trial, results.settings) == cause


def test_site_has_a_time_limit_of_its_own(results: CampaignResults) -> None:
    at_site = results.settings.model_copy(update={"scenario": "extended-maze", "budget_m": 1000.0})
    assert time_limit_s(at_site) < 4 * 1000.0


def test_every_failure_is_counted_once_and_layouts_with_most_come_first(results: CampaignResults) -> None:
    rows = [
        row("forest-pledge", 0, "entrapped", 90.0), row("forest-pledge", 2, "tipped", 10.0), row("forest-pledge", 4),
        *(row("levy-walk", n, "entrapped", 90.0) for n in (0, 1)), row("levy-walk", 4),
        row("cv-react", 2, "fault", None),
    ]  # fmt: skip
    text = "".join(failures_section(replace(results, rows=rows)))
    assert "5 failures of 7 trials: all" in text
    causes, layouts = ([re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", line) for line in part.split("<tr")[2:]]
                       for part in text.split("<table>")[1:])  # fmt: skip
    assert causes == [
        ["forest-pledge", "2", "1", "1", ""], ["levy-walk", "2", "2", "", ""], ["cv-react", "1", "", "", "1"],
        ["all", "5", "3", "1", "1"],
    ]  # fmt: skip
    assert layouts == [
        ["forest 0", "3 of 3", "levy-walk (2), forest-pledge"], ["forest 1", "2 of 2", "forest-pledge, cv-react"],
    ]  # fmt: skip
    assert GAVE_UP in CAUSES
    assert GAVE_UP.replace("\n", "<br>") not in text, "nothing failed so"


def test_campaign_without_failures_says_so(results: CampaignResults) -> None:
    assert "None of 2 trials failed" in "".join(
        failures_section(replace(results, rows=[row("cv-react", n) for n in (0, 1)]))
    )
