"""The page: whole, valid, the same each time, and with nothing fetched from elsewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from tests.experiments import fake_trials
from tests.reports.campaigns import ALGORITHMS, TRIALS, run_campaign
from tests.reports.outline import Outline
from wayfarer import __version__, cli
from wayfarer.experiments.provenance import RUNS
from wayfarer.experiments.results import TRIALS as TABLE
from wayfarer.experiments.results import Results
from wayfarer.reports.campaign import write_report
from wayfarer.reports.page.html import PAGE

GALLERY = 2


@pytest.fixture(scope="module")
def folder(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The finished campaign with the report that the command wrote."""
    folder = Path(shutil.copytree(finished, tmp_path_factory.mktemp("reported") / "out"))
    with redirect_stdout(StringIO()) as told:
        assert cli.run(["report", str(folder), "--gallery", str(GALLERY), "--jobs", "1"]) == 0
    assert told.getvalue() == f"the report is {folder / PAGE}\n"
    return folder


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def test_command_writes_the_page_and_nothing_else(folder: Path, finished: Path) -> None:
    assert {path.name for path in folder.iterdir()} - {path.name for path in finished.iterdir()} == {PAGE}


def test_page_is_well_formed_and_its_ids_are_unique(text: str) -> None:
    page = Outline(text)
    assert page.tags["h1"] == page.tags["main"] == page.tags["title"] == 1
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)


def test_page_links_to_nothing_elsewhere(text: str) -> None:
    page = Outline(text)
    assert not {"link", "img", "iframe", "object"} & page.tags.keys()
    assert page.links == []
    assert not re.search(r"@import|url\(", text.partition("</style>")[0])


def test_every_figure_has_its_place_and_is_described(text: str) -> None:
    page = Outline(text)
    assert page.tags["figure"] == 1 + 3 + 1 + GALLERY  # paths, three comparisons, escapes, maps
    assert sum(name.startswith("plot-") for name in page.ids) == page.tags["figure"]
    assert len(page.labels) == page.tags["figure"] - GALLERY, "a map has its caption"
    assert all(len(label) > 20 for label in page.labels)


def test_page_begins_with_the_result_and_ends_with_how_it_was_made(text: str) -> None:
    first = text[text.index("</h1>") : text.index("<section>")]
    said = re.findall(r"<p>(.*?)</p>", first.partition("</noscript>")[2])
    figures = r"[\w-]+ got out in [\d.]+ \[[\d., ]+\] % of \d+ trials, on paths of .* m, with an SPL of "
    assert re.match(figures, said[0])
    assert said[1].startswith("The 2 others ")
    assert text.index('<dl class="facts">') > text.rindex("</section>")
    rows = re.findall(r'<tr class="ours">(.*?)</tr>', text)
    assert len(rows) == len(ALGORITHMS)


def test_header_says_what_ran(text: str) -> None:
    facts = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", text))
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", facts["run"])
    assert facts["command"] == "wayfarer sim --out ~/results"
    assert facts["software"].startswith(f"wayfarer {__version__} (")
    assert " cores, " in facts["computer"]
    assert facts["trials of each algorithm"] == str(TRIALS)
    assert (facts["seed"], facts["mean distance between slips"], facts["path budget"]) == ("0", "10 m", "90 m")
    assert facts["rover"] == "sim"
    assert facts["forests"].startswith("given.jsonl, BLAKE2b ")
    assert facts["algorithms"] == ", ".join(ALGORITHMS)


def test_texts_name_the_trials(text: str, folder: Path) -> None:
    texts = re.findall(r"<figcaption>([^<]*, trial .*?)</figcaption>", text)
    assert len(texts) == GALLERY
    for each in texts:
        found = re.fullmatch(r"([\w-]+), trial (\d+) \(forest (\d+), noise \d+\): (\w+) after ([\d.]+) m.*", each)
        assert found, each
        name, trial, forest, outcome, path_m = found.groups()
        row = next(line for line in (folder / TABLE).read_text().splitlines() if line.startswith(f"{trial},{name},"))
        assert row.split(",")[2] == forest
        assert row.split(",")[5] == outcome
        assert f"{float(row.split(',')[6]):.1f}" == path_m


def test_another_process_writes_the_same_bytes_where_it_is_told(folder: Path, tmp_path: Path) -> None:
    """Python's hashes of strings, and with them the order of sets, differ from process to process."""
    code = (
        "import pathlib, sys; from wayfarer.reports.campaign import write_report;"
        "from wayfarer.experiments.results import Results;"
        f"write_report(Results.open(pathlib.Path(sys.argv[1])), pathlib.Path(sys.argv[2]), gallery={GALLERY}, jobs=1)"
    )
    out, before = tmp_path / "mine" / "page.html", sorted(folder.rglob("*"))
    environment = {**os.environ, "PYTHONHASHSEED": "1"}
    subprocess.run([sys.executable, "-c", code, str(folder), str(out)], env=environment, check=True)
    assert out.read_bytes() == (folder / PAGE).read_bytes()
    assert [path.name for path in out.parent.iterdir()] == ["page.html"]
    assert sorted(folder.rglob("*")) == before


def test_without_shortest_paths_the_page_says_how_to_get_them(tmp_path: Path) -> None:
    run_campaign(tmp_path / "out", algorithms=["pledge"])
    text = write_report(Results.open(tmp_path / "out"), gallery=0, jobs=1).read_text()
    assert "--spl" in text
    assert 'scope="col">SPL' not in text
    assert Outline(text).tags["figure"] == 2
    assert "No trial is drawn." in text


def test_trials_that_come_out_in_another_way_are_named_and_not_drawn(tmp_path: Path) -> None:
    run_campaign(tmp_path / "out", algorithms=["pledge"], run_trial=fake_trials.quick)
    text = write_report(Results.open(tmp_path / "out"), gallery=2, jobs=1).read_text()
    assert ", trial 0 (forest" not in text
    assert "the code or an algorithm has changed since" in text
    assert len(re.findall(r"<li>pledge, trial \d: .* in the table, .* now</li>", text)) == 2


def test_names_cannot_break_out_of_the_page(tmp_path: Path, finished: Path) -> None:
    folder = Path(shutil.copytree(finished, tmp_path / "out"))
    for name in ("campaign.json", TABLE):
        path = folder / name
        path.write_text(path.read_text().replace("cv-react", "<b>&$x$"))
    (folder / RUNS).unlink()  # an older version kept none
    text = write_report(Results.open(folder), gallery=0, jobs=1).read_text()
    assert f"<dt>software</dt><dd>wayfarer {__version__}</dd>" in text
    assert Outline(text).tags["b"] == 0
    assert "&lt;b&gt;&amp;$x$" in text
