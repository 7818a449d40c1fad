"""The tables of results in the pages, and the command that measures them again."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

import click
import pytest

from docs import measure
from docs.measured_tables import KINDS, PLACE, Measured, write_pages
from tests.conftest import Run
from tests.docs.pages import ROOT
from tests.docs.test_commands import command_of
from tests.experiments import fake_trials
from wayfarer.experiments.trial import TrialResult
from wayfarer.simhal.world.forest_file import REFERENCE, content_of, forests_in

PLACES = [place for page in (ROOT / "docs").rglob("*.md") for place in PLACE.finditer(page.read_text(encoding="utf-8"))]
CAPTION = re.compile(r"^`(wayfarer [^`]+)`, version (\S+) ", re.MULTILINE)
PAGE = "# Results\n\n<!-- measured {} -->\n\n| old | 1 |\n\n<!-- end of measured -->\n\nWhat it means.\n"


def test_every_campaign_has_a_place_that_fits_it() -> None:
    kinds = {name: place["kind"] for place in PLACES for name in place["names"].split()}
    assert set(kinds) == set(measure.CAMPAIGNS)
    for name, kind in kinds.items():
        assert kind in KINDS
        assert (kind == "points") == measure.CAMPAIGNS[name].startswith("sweep ")


def test_all_tables_in_the_pages_are_of_one_version_and_of_these_campaigns() -> None:
    captions = [(place, *found) for place in PLACES for found in CAPTION.findall(place["content"])]
    assert len({version for _, _, version in captions}) <= 1
    for place, command, _ in captions:
        trials = int(command.split("--trials ")[1].split()[0])
        assert command in [Measured(ROOT, n, measure.CAMPAIGNS[n], trials).command for n in place["names"].split()]


@pytest.mark.parametrize("name", measure.CAMPAIGNS)
def test_the_command_line_understands_every_campaign(name: str) -> None:
    command, arguments = command_of([*measure.CAMPAIGNS[name].split(), "--out", "x"])
    try:
        command.make_context(command.name, arguments)
    except click.UsageError as error:
        pytest.fail(error.format_message())


def test_held_out_forests_are_those_of_odd_layouts() -> None:
    numbers = {forest.forest for forest in forests_in("odd", measure.held_out(content_of(REFERENCE)))}
    assert numbers == {forest.forest for forest in forests_in(REFERENCE, content_of(REFERENCE)) if forest.forest % 2}


def out_after_minutes(*arguments: object) -> TrialResult:
    """Trial 0 is out after a minute, trial 1 after two."""
    result = fake_trials.quick(*arguments)  # type: ignore[arg-type]
    return result._replace(outcome="escaped", time_s=60.0 * (result.trial + 1), path_m=50.0, spl=0.75)


@pytest.fixture
def installed(run: Run, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Run the command in this process, with trials that end at once; gives the arguments that it got."""
    asked: list[list[str]] = []

    def in_this_process(folder: Path, arguments: Iterable[str]) -> str:
        asked.append([*arguments])
        monkeypatch.chdir(folder)
        code, out, _ = run(*asked[-1])
        if code:
            raise subprocess.CalledProcessError(code, "wayfarer")
        return out

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", out_after_minutes)
    monkeypatch.setattr(measure, "_wayfarer", in_this_process)
    return asked


@pytest.mark.parametrize(
    ("kind", "arguments", "row"),
    [
        (
            "outcomes",
            "sim --algorithm pledge --trials 9",
            "| pledge | 100.0 [51.0, 100.0] | 0.0 | 0.0 |",
        ),
        ("limits", "sim --algorithm pledge,levy-walk --trials 9", "| levy-walk | 25 | 50 | 75 | 100 |"),
        ("gains", "sim --algorithm forest-pledge,pledge --trials 9", "| pledge | 0, at most 75.0 | +0.0 |"),
        ("points", "sweep slip_mean_m=2,10 --trials 9", "| 10 | 100.0 [51.0, 100.0] | 0.750"),
    ],
)
def test_place_gets_the_whole_table_with_command_and_version(
    tmp_path: Path, installed: list[list[str]], kind: str, arguments: str, row: str
) -> None:
    page, place = tmp_path / "page.md", f"{kind}: one"
    page.write_text(PAGE.format(place), encoding="utf-8")
    campaign = Measured(tmp_path, "one", arguments, other_trials=4)
    for _ in range(2):
        measure.run(campaign, jobs=1)
        assert len(installed) == 1, "what is finished is not run again"
    assert [*write_pages(tmp_path, {"one": campaign})] == [page]
    text = page.read_text(encoding="utf-8")
    assert f"\n`wayfarer {arguments.replace('9', '4')}`, version 0." in text
    assert f"\n{row}" in text
    assert "| old |" not in text
    assert text.startswith(f"# Results\n\n<!-- measured {place} -->\n\n`wayfarer")
    assert text.endswith("|\n\n<!-- end of measured -->\n\nWhat it means.\n")
    assert [*write_pages(tmp_path, {"one": campaign})] == [], "the same again"
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len({line.replace("\\|", "").count("|") for line in lines}) == 1, "each row has all columns"
