"""The tables of results in the pages, and the command that measures them again."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

import click
import pytest

from docs import measure
from docs.measured_tables import KINDS, PLACE, TOGETHER, Measured, write_pages
from docs.trial_code import NOT_RUN, code_of
from tests.conftest import Run
from tests.docs.pages import ROOT
from tests.docs.test_commands import command_of
from tests.experiments import fake_trials
from wayfarer.experiments.trial import TrialResult
from wayfarer.simhal.world.forest_file import REFERENCE, content_of, forests_in

PLACES = [place for page in (ROOT / "docs").rglob("*.md") for place in PLACE.finditer(page.read_text(encoding="utf-8"))]
CAPTION = re.compile(r"^`(wayfarer [^`]+)`[^\n]* \(code (\w+), [^\n]+\):$", re.MULTILINE)
PAGE = "# Results\n\n<!-- measured {} -->\n\n| old | 1 |\n\n<!-- end of measured -->\n\nWhat it means.\n"


def test_every_campaign_has_a_place_that_fits_it_and_its_time_beside_its_name() -> None:
    kinds = {(name, place["kind"]) for place in PLACES for name in place["names"].split()}
    assert {name for name, kind in kinds if kind == "times"} == set(measure.CAMPAIGNS)
    assert {name for name, kind in kinds if kind in KINDS} == set(measure.CAMPAIGNS)
    for name, kind in kinds:
        assert kind in {**KINDS, **TOGETHER}
        assert kind == "times" or (kind == "points") == measure.CAMPAIGNS[name].startswith("sweep ")


def test_all_tables_in_the_pages_are_measured_of_one_version_and_of_these_campaigns() -> None:
    versions: set[str] = set()
    for place in PLACES:
        if place["kind"] in KINDS:
            found, names = CAPTION.findall(place["content"]), place["names"].split()
            commands = [f"wayfarer {' '.join(Measured(ROOT, n, measure.CAMPAIGNS[n]).parts[0].words)}" for n in names]
            assert [command for command, _ in found] == commands, "none is missing, none is another one"
        else:
            assert place["content"].count("(code ") == 1
        versions |= {*re.findall(r"\(code (\w+)", place["content"])}
    assert len(versions) == 1


@pytest.mark.parametrize("name", measure.CAMPAIGNS)
def test_the_command_line_understands_every_campaign(name: str) -> None:
    for part in Measured(ROOT, name, measure.CAMPAIGNS[name]).parts:
        command, arguments = command_of([*part.words, "--out", "x"])
        try:
            command.make_context(command.name, arguments)
        except click.UsageError as error:
            pytest.fail(error.format_message())


def test_version_of_a_table_changes_with_code_and_not_with_words_about_it(tmp_path: Path) -> None:
    package = tmp_path / "wayfarer"
    (package / "escape").mkdir(parents=True)
    module = package / "escape" / "phases.py"

    def version(text: str) -> str:
        module.write_text(text, encoding="utf-8")
        return code_of(package)

    plain = version('def f(a: int) -> str:\n    return f"#{a}"\n')
    said = '"""About."""\n\n\ndef f(a: int) -> str:  # why\n    """Two\n\n    lines."""\n    return f"#{a}"\n'
    assert version(said) == plain
    assert version(said.replace("#{a}", "#{a}!")) != plain
    assert version(said.replace("return", "return  # no more\n    yield")) != plain


def test_everything_that_is_left_out_of_the_version_is_there() -> None:
    assert [name for name in NOT_RUN if not (ROOT / "wayfarer" / name).exists()] == ["skeletons"]


@pytest.mark.parametrize("left_out", ["daemon/daemon.py", "files.py", "simhal/chips/pmw3901.py"])
@pytest.mark.parametrize("counted", ["drivers/pmw3901.py", "experiments/rows.py", "simhal/faults/world.py", "new.py"])
def test_version_counts_all_but_what_decides_nothing(tmp_path: Path, left_out: str, counted: str) -> None:
    versions = [code_of(tmp_path)]
    for name in (left_out, counted):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1\n", encoding="utf-8")
        versions.append(code_of(tmp_path))
    assert versions[0] == versions[1] != versions[2]


def test_held_out_forests_are_those_of_odd_layouts(tmp_path: Path) -> None:
    measure.write_held_out(tmp_path)
    numbers = {forest.forest for forest in forests_in("odd", (tmp_path / measure.HELD_OUT).read_bytes())}
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
        code, out, _ = run(*asked[-1], *([] if "--jobs" in asked[-1] else ["--jobs", "1"]))
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
        ("outcomes", "sim --algorithm pledge --trials 9 --seed 1,2", "| pledge | 100.0 [67.6, 100.0] | 0.0 | 0.0 |"),
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
        assert len(installed) == len(campaign.parts), "what is finished is not run again"
    assert [*write_pages(tmp_path, {"one": campaign})] == [page]
    text = page.read_text(encoding="utf-8")
    first = arguments.replace("9", "4").replace("1,2", "1")
    assert f"\n`wayfarer {first}`" in text
    assert f"(code {tmp_path.name}, 0.0 min of CPU):\n" in text
    assert f"\n{row}" in text
    assert "| old |" not in text
    assert text.startswith(f"# Results\n\n<!-- measured {place} -->\n\n`wayfarer")
    assert text.endswith("|\n\n<!-- end of measured -->\n\nWhat it means.\n")
    assert [*write_pages(tmp_path, {"one": campaign})] == [], "the same again"
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len({line.replace("\\|", "").count("|") for line in lines}) == 1, "each row has all columns"


@pytest.mark.parametrize(
    ("kind", "rows"),
    [
        ("seeds", "| one | pledge | 100.0 | 100.0 |\n| two | pledge | 100.0 | 100.0 |"),
        ("limits", "| one | pledge | 25 | 50 | 75 | 100 |\n| two | pledge | 25 | 50 | 75 | 100 |"),
        ("times", "| one | `sim --algorithm pledge --trials 4 --seed 1,2` | 0.0 min of CPU |\n| two | "),
    ],
)
def test_place_gets_one_table_of_all_its_campaigns(
    tmp_path: Path, installed: list[list[str]], kind: str, rows: str
) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE.format(f"{kind}: one two"), encoding="utf-8")
    campaigns = {
        name: Measured(tmp_path, name, "sim --algorithm pledge --trials 4 --seed 1,2") for name in ("one", "two")
    }
    for campaign in campaigns.values():
        measure.run(campaign, jobs=1)
    assert len(installed) == 4
    assert [*write_pages(tmp_path, campaigns)] == [page]
    text = page.read_text(encoding="utf-8")
    assert f"|\n{rows}" in text
    assert text.count(f"(code {tmp_path.name})") == 1


@pytest.fixture
def measured(tmp_path: Path, installed: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    """Two campaigns of which one is measured, with two seeds."""
    arguments = "sim --algorithm pledge,levy-walk --trials 4 --seed 1,2"
    monkeypatch.setattr(measure, "CAMPAIGNS", {"one": arguments, "new": arguments})
    monkeypatch.setattr(measure, "KEPT", tmp_path / "measured.json")
    campaign = Measured(tmp_path, "one", arguments)
    measure.run(campaign, jobs=1)
    measure.keep_first_rows({"one": campaign})


@pytest.mark.usefixtures("measured")
def test_check_of_a_table_whose_first_rows_are_the_same_passes(capsys: pytest.CaptureFixture[str]) -> None:
    assert measure.check(["one"], "abc") == 0
    assert "one: the same bytes\n" in capsys.readouterr().out
    assert measure.check(["new"], "abc") == 1
    assert "new: NEVER MEASURED\n" in capsys.readouterr().out


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize(
    ("trial", "algorithm", "changed"), [(2, "levy-walk", True), (0, "pledge", True), (3, "pledge", False)]
)
def test_check_finds_one_number_that_has_changed_in_the_first_three_trials_of_any_row(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], trial: int, algorithm: str, changed: bool
) -> None:
    def otherwise(*arguments: object) -> TrialResult:
        result = out_after_minutes(*arguments)
        is_it = (result.trial, result.algorithm) == (trial, algorithm)
        return result._replace(path_m=50.001) if is_it else result

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", otherwise)
    assert measure.check(["one"], "abc") == changed
    assert ("CHANGED" in capsys.readouterr().out) is changed


def test_table_of_another_mujoco_is_left_out(
    installed: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(measure, "CAMPAIGNS", {"one": "sim --physics mujoco --trials 3"})
    monkeypatch.setattr(measure, "KEPT", tmp_path / "measured.json")
    kept = '{"one": {"columns": "trial", "digest": "0", "engine": "MuJoCo 1.2 on vax"}}'
    measure.KEPT.write_text(kept, encoding="utf-8")
    assert measure.check(["one"], "abc") == 0
    assert "one: left out: measured with MuJoCo 1.2 on vax, here is " in capsys.readouterr().out
    assert installed == []
