"""What a folder must hold to be reported on, and what is said if it does not."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.experiments import fake_trials
from tests.reports.campaigns import ALGORITHMS, BUDGET_M, TRIALS, campaign_of, run_campaign, some_forests
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.recorded import FORESTS, SETTINGS
from wayfarer.experiments.results import TRIALS as TABLE
from wayfarer.experiments.results import Results
from wayfarer.reports.campaign import write_report


@pytest.fixture
def folder(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished campaign, to be spoilt."""
    return Path(shutil.copytree(finished, tmp_path / "copy"))


def edit_settings(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    settings = json.loads((folder / SETTINGS).read_text())
    change(settings)
    (folder / SETTINGS).write_text(json.dumps(settings))


def test_folder_reads_back_as_it_was_written(finished: Path) -> None:
    results = Results.open(finished)
    assert results.plan.base.budget_m == BUDGET_M
    assert [len(rows) for rows in results.by_algorithm.values()] == [TRIALS] * len(ALGORITHMS)


def test_campaign_is_rebuilt_with_the_same_settings(finished: Path) -> None:
    written = json.loads((finished / SETTINGS).read_text())
    rebuilt = json.loads(json.dumps(Results.open(finished).rebuild().settings()))
    assert rebuilt.pop("forests")["blake2b"] == written.pop("forests")["blake2b"]
    assert rebuilt == written


def test_no_folder_no_campaign_and_an_unfinished_one_are_told_apart(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(BadInput, match="no such folder"):
        Results.open(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match=r"holds no campaign: campaign\.json is missing"):
        Results.open(tmp_path / "empty")
    whole = (folder / TABLE).read_bytes()
    for length in (0, 5, len(whole) // 2, len(whole) - 1):
        (folder / TABLE).write_bytes(whole[:length])
        with pytest.raises(BadInput, match=r"not finished, .* add --resume to finish it first"):
            Results.open(folder)
    (folder / TABLE).unlink()
    with pytest.raises(BadInput, match=r"not finished, .* add --resume to finish it first"):
        Results.open(folder)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "Expecting value"),
        ("[1]", "the file: Input should be an object"),
        ("{}", "version is missing"),
        ('{"version": 3}', "algorithms is missing, as in results of another version"),
        ("\xff", "invalid start byte"),
        ("[" * 100_000, "recursion"),
    ],
)
def test_damaged_settings_are_named(folder: Path, text: str, says: str) -> None:
    (folder / SETTINGS).write_bytes(text.encode("latin-1"))
    with pytest.raises(BadInput, match=r"campaign\.json is damaged: ") as caught:
        Results.open(folder)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("trials", 10**12),
        ("trials", 10**30),
        ("trials", True),
        ("algorithms", ["pledge", "pledge"]),
        ("algorithms", ["\x1b[31mpledge"]),
        ("seed", -1),
        ("budget_m", math.inf),
        ("budget_m", 0),
        ("slip_mean_m", math.nan),
        ("set", {"sim.slope_deg": [0.5]}),
        ("set", {"sim.slope_deg": [0, 10**400]}),
        ("set", {"\x1b[2J": 1}),
        ("set", {"footprint_m": "wide"}),
        ("version", "\x1b[2J"),
        ("version", 3),
        ("rover", {}),
        ("rover", {"vehicle": 5}),
        ("rover", {"vehicle": {"length_m": "long", "width_m": 1}}),
        ("set", {"sim.slope_deg": [0.5, math.nan]}),
        ("set", {"senses": "\x1b[31mfield"}),
        ("faults", ["silent"]),
        ("site", "maze"),
    ],
)
def test_setting_that_no_campaign_has_is_named(folder: Path, key: str, value: Any) -> None:
    edit_settings(folder, lambda settings: settings.update({key: value}))
    with pytest.raises(BadInput, match=rf"campaign\.json is damaged: {key}\b") as caught:
        Results.open(folder)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("name", [SETTINGS, TABLE, FORESTS])
@pytest.mark.parametrize("kind", ["pipe", "endless"])
def test_what_is_no_ordinary_file_is_not_read(folder: Path, name: str, kind: str) -> None:
    (folder / name).unlink()
    if kind == "pipe":
        os.mkfifo(folder / name)
    else:
        (folder / name).symlink_to("/dev/zero")
    with pytest.raises(BadInput, match="no ordinary file"):
        Results.open(folder).rebuild()


def test_shortest_path_of_nothing_is_not_known(folder: Path) -> None:
    table = (folder / TABLE).read_text()
    (folder / TABLE).write_text(table.replace(",38.500,", ",0.000,").replace(",39.500,", ",0.000,"))
    page = write_report(Results.open(folder), gallery=0, jobs=1).read_text()
    assert "mean shortest path" not in page


@pytest.mark.parametrize("key", ["site", "physics", "ground", "set", "depth"])
def test_folder_of_a_version_with_fewer_settings_is_refused(folder: Path, key: str) -> None:
    edit_settings(folder, lambda settings: settings.pop(key))
    with pytest.raises(BadInput, match=rf"is damaged: {key} is missing, as in .*; the campaign must be run"):
        Results.open(folder)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text.replace("trial,algorithm", "trial,name"),
        lambda text: text.replace("levy-walk", "pledge"),
    ],
    ids=["other columns", "another algorithm"],
)
def test_damaged_table_is_refused(folder: Path, spoil: Callable[[str], str]) -> None:
    (folder / TABLE).write_text(spoil((folder / TABLE).read_text()))
    with pytest.raises(BadInput, match=r"trials\.csv(, line 5)? is damaged"):
        Results.open(folder)


# --- the copy of the forests


def test_campaigns_folder_keeps_its_forest_file_byte_by_byte(finished: Path) -> None:
    assert (finished / FORESTS).read_bytes() == (finished.parent / "given.jsonl").read_bytes()


def test_resuming_adds_a_copy_that_is_missing(finished: Path, folder: Path) -> None:
    (folder / FORESTS).unlink()
    campaign = campaign_of(finished.parent / "given.jsonl")
    with Results.kept(campaign, folder, resume=True, forests=(finished.parent / "given.jsonl").read_bytes()):
        pass
    assert (folder / FORESTS).read_bytes() == (finished / FORESTS).read_bytes()


def test_generated_forests_need_no_copy(tmp_path: Path) -> None:
    run_campaign(tmp_path / "out", algorithms=["pledge"], run_trial=fake_trials.quick)
    assert not (tmp_path / "out" / FORESTS).exists()
    assert Results.open(tmp_path / "out").rebuild() == campaign_of(algorithms=["pledge"])


def test_copy_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    given = some_forests(tmp_path / "given.jsonl")
    with Results.kept(campaign_of(given), tmp_path / "out"):
        pass
    monkeypatch.setattr("os.fsync", fail)
    with (
        pytest.raises(WayfarerError, match="No space left"),
        Results.kept(campaign_of(given), tmp_path / "out", resume=True, forests=given.read_bytes()),
    ):
        pass
    assert not list((tmp_path / "out").glob(f"{FORESTS}*"))


def test_without_the_forests_the_page_says_how_to_get_the_drawings(folder: Path) -> None:
    (folder / FORESTS).unlink()
    text = write_report(Results.open(folder), gallery=1, jobs=1).read_text()
    assert "<p>No trial is drawn: the folder has no copy of the campaign&#39;s forests; put given.jsonl there" in text


def test_other_forests_are_refused(folder: Path) -> None:
    with (folder / FORESTS).open("a") as file:
        file.write("\n")
    with pytest.raises(BadInput, match="is not the file that the campaign used"):
        Results.open(folder).rebuild()


def test_damaged_forests_are_refused(folder: Path) -> None:
    (folder / FORESTS).write_text("{}\n")
    with pytest.raises(BadInput, match=r"forests\.jsonl, line 1: key 'forest' is missing"):
        Results.open(folder).rebuild()


def test_rover_that_this_version_does_not_know_is_refused(folder: Path) -> None:
    edit_settings(folder, lambda settings: settings["rover"].update(wings=2))
    with pytest.raises(BadInput, match="does not understand the rover"):
        Results.open(folder).rebuild()


def _driver(settings: dict[str, Any]) -> None:
    settings["rover"]["parts"] = {"motors": {"driver": "antigravity:x"}}


def _buses(settings: dict[str, Any]) -> None:
    settings["rover"]["buses"] = "antigravity:x"


def _set_buses(settings: dict[str, Any]) -> None:
    settings["set"]["buses"] = "antigravity:x"


def _file(settings: dict[str, Any]) -> None:
    settings["files"] = {"forest-pledge": {"path": "antigravity", "blake2b": ""}}


@pytest.mark.parametrize("change", [_driver, _buses, _set_buses, _file])
def test_code_that_a_folder_names_is_imported_only_if_a_person_allows_it(
    folder: Path, change: Callable[[dict[str, Any]], object]
) -> None:
    """``antigravity`` opens a browser when it is imported; a folder of somebody else may name any module."""
    edit_settings(folder, change)
    with pytest.raises(BadInput, match="names code to run, 'antigravity:"):
        Results.open(folder).rebuild()
    assert "antigravity" not in sys.modules


def test_algorithm_of_a_module_is_run_again_only_if_a_person_allows_it(finished: Path) -> None:
    results = Results.open(finished)
    named = ("tests.somewhere:ALGORITHM", *results.plan.base.algorithms[1:])
    results = Results(replace(results.plan.base, algorithms=named), results.rows, finished)
    with pytest.raises(BadInput, match=r"names code to run, 'tests\.somewhere:ALGORITHM'"):
        results.rebuild()
    assert results.rebuild(allow_code=True).algorithms[0] == "tests.somewhere:ALGORITHM"
