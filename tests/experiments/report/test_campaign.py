"""The page: whole, valid, the same each time, and with nothing fetched from elsewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import pytest

from tests.experiments import fake_trials
from tests.experiments.report.campaigns import ALGORITHMS, TRIALS, run_campaign
from wayfarer.cli import report as command
from wayfarer.errors import BadInput
from wayfarer.experiments.entrapment import Cause
from wayfarer.experiments.report.campaign import write_report
from wayfarer.experiments.report.reading import read_results
from wayfarer.experiments.report.worst_trials import choose
from wayfarer.experiments.results_folder import TRIALS as TABLE

GALLERY = 2
ENTRAPPED = 2  # of them
VOID = {"meta", "br"}
URL_ATTRIBUTES = {"href", "src", "srcset", "action", "data", "xlink:href"}


class Page(HTMLParser):
    """Reads a page strictly: what is opened is closed, in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.labels: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"{tag} has an attribute twice"
        values = dict(attrs)
        self.tags[tag] += 1
        self.ids += [value for name, value in attrs if name == "id" and value]
        self.links += [value for name, value in attrs if name in URL_ATTRIBUTES and value]
        if tag == "svg":
            assert values["role"] == "img"
            self.labels.append(values["aria-label"] or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert "svg" in self.open, f"<{tag}/> outside of a drawing"
        self.handle_starttag(tag, attrs)
        self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def folder(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The finished campaign with its report."""
    folder = Path(shutil.copytree(finished, tmp_path_factory.mktemp("reported") / "out"))
    write_report(folder, gallery=GALLERY, jobs=1)
    return folder


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def test_page_is_well_formed_and_its_ids_are_unique(text: str) -> None:
    page = Page(text)
    assert page.open == []
    assert page.tags["h1"] == page.tags["main"] == page.tags["title"] == 1
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    assert set(re.findall(r"url\(#([^)]*)\)", text)) <= set(page.ids)


def test_page_needs_nothing_from_elsewhere(text: str, folder: Path) -> None:
    page = Page(text)
    assert not {"script", "link", "img", "iframe", "object"} & page.tags.keys()
    assert not re.search(r"@import|url\((?!#)", text)
    outside = [link for link in page.links if not link.startswith("#")]
    assert outside
    for link in outside:
        assert (folder / link).is_file(), link


def test_every_figure_is_there_described_and_has_its_files(text: str, folder: Path) -> None:
    page = Page(text)
    assert page.tags["figure"] == page.tags["svg"] == page.tags["figcaption"] == 3 + 1 + GALLERY + ENTRAPPED
    assert all(len(label) > 20 for label in page.labels)
    names = {path.name for path in (folder / "figures").iterdir()}
    assert {f"{name}.{kind}" for name in ("paths", "escape", "ratio") for kind in ("png", "svg")} <= names
    assert len(names) == 2 * (3 + 1 + GALLERY + ENTRAPPED)


def test_table_stands_beside_the_papers_numbers(text: str) -> None:
    results = text.partition("Why trials were entrapped")[0]
    rows = re.findall(r'<tr class="(\w+)">(.*?)</tr>', results)
    assert [kind for kind, _ in rows].count("ours") == len(ALGORITHMS)
    papers = [row for kind, row in rows if kind == "paper"]
    assert ["81.3 ± 29.3" in papers[0], "99.7" in papers[0], "247.5 ± 223.7" in papers[1]] == [True] * 3
    assert all(row.count("<td>") == rows[0][1].count("<td>") for _, row in rows)


def test_header_says_what_ran(text: str) -> None:
    facts = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", text))
    assert facts["trials of each algorithm"] == str(TRIALS)
    assert (facts["seed"], facts["mean distance between slips"], facts["path budget"]) == ("0", "10 m", "90 m")
    assert facts["rover"] == "sim"
    assert facts["forests"].startswith("given.jsonl, BLAKE2b ")
    assert facts["algorithms"] == ", ".join(ALGORITHMS)


def test_terms_are_explained(text: str) -> None:
    for term in ("Success: ", "SPL, success weighted by path length: "):
        assert f"<p>{term}" in text


def test_captions_name_the_trials(text: str, folder: Path) -> None:
    gallery = text.partition("Why trials were entrapped")[0]
    captions = re.findall(r'<figure class="forest">.*?<figcaption>(.*?) <span', gallery, flags=re.DOTALL)
    assert len(captions) == GALLERY
    for caption in captions:
        found = re.fullmatch(r"([\w-]+), trial (\d+) \(forest (\d+), noise \d+\): (\w+) after ([\d.]+) m.*", caption)
        assert found, caption
        name, trial, forest, outcome, path_m = found.groups()
        row = next(line for line in (folder / TABLE).read_text().splitlines() if line.startswith(f"{trial},{name},"))
        assert row.split(",")[2] == forest
        assert row.split(",")[5] == outcome
        assert f"{float(row.split(',')[6]):.1f}" == path_m


def test_same_folder_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    again = Path(shutil.copytree(folder, tmp_path / "elsewhere"))
    written = [path.relative_to(folder) for path in folder.rglob("*.*")]
    shutil.rmtree(again / "figures")
    write_report(again, gallery=GALLERY, jobs=1)
    for path in written:
        assert (again / path).read_bytes() == (folder / path).read_bytes(), path


def test_another_process_writes_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    """Python's hashes of strings, and with them the order of sets, differ from process to process."""
    again = Path(shutil.copytree(folder, tmp_path / "again"))
    shutil.rmtree(again / "figures")
    code = (
        "import pathlib, sys; from wayfarer.experiments.report.campaign import write_report;"
        "write_report(pathlib.Path(sys.argv[1]), gallery=0, jobs=1)"
    )
    for seed in ("1", "2"):
        subprocess.run([sys.executable, "-c", code, str(again)], env={**os.environ, "PYTHONHASHSEED": seed}, check=True)
        for name in ("paths.svg", "escape.svg", "ratio.svg", "paths.png"):
            assert (again / "figures" / name).read_bytes() == (folder / "figures" / name).read_bytes(), (name, seed)


def test_style_of_the_user_changes_nothing(folder: Path, tmp_path: Path) -> None:
    again = Path(shutil.copytree(folder, tmp_path / "again"))
    with matplotlib.rc_context({"font.size": 20, "axes.facecolor": "black", "svg.fonttype": "path"}):
        write_report(again, gallery=0, jobs=1)
        assert matplotlib.rcParams["font.size"] == 20, "the user's settings are given back"
    for name in ("paths.svg", "paths.png"):
        assert (again / "figures" / name).read_bytes() == (folder / "figures" / name).read_bytes()


def test_page_says_why_trials_were_entrapped_with_a_close_up_of_each(finished: Path, text: str) -> None:
    rows = choose(read_results(finished).by_algorithm, GALLERY)
    entrapped = [row for row in rows if row.outcome == "entrapped"]
    assert len(entrapped) == ENTRAPPED
    section = text.partition("Why trials were entrapped")[2]
    assert section.count('class="forest"') == len(entrapped)
    for row in entrapped:
        assert re.search(rf"{row.algorithm}, trial {row.trial}: ({'|'.join(Cause)})\. It kept to", section)
    counts = re.search(r"<tbody>.*?</tbody>", section, re.DOTALL)
    assert counts is not None
    assert sum(map(int, re.findall(r"<td>(\d+)</td>", counts.group()))) == len(entrapped)


def test_without_shortest_paths_the_page_says_how_to_get_them(tmp_path: Path) -> None:
    run_campaign(tmp_path / "out", algorithms=["pledge"])
    text = write_report(tmp_path / "out", gallery=0, jobs=1).read_text()
    assert "--spl" in text
    assert Page(text).tags["svg"] == 2
    assert "No trial is drawn." in text


def test_trials_that_come_out_in_another_way_are_named_and_not_drawn(tmp_path: Path) -> None:
    run_campaign(tmp_path / "out", algorithms=["pledge"], run_trial=fake_trials.quick)
    text = write_report(tmp_path / "out", gallery=2, jobs=1).read_text()
    assert 'class="forest"' not in text
    assert "the code or an algorithm has changed since" in text
    assert len(re.findall(r"<li>pledge, trial \d: .* in the table, .* now</li>", text)) == 2


def test_names_cannot_break_out_of_the_page(tmp_path: Path, finished: Path) -> None:
    folder = Path(shutil.copytree(finished, tmp_path / "out"))
    for name in ("campaign.json", TABLE):
        path = folder / name
        path.write_text(path.read_text().replace("cv-react", "<b>&$x$"))
    text = write_report(folder, gallery=1, jobs=1).read_text()
    assert Page(text).open == []
    assert "<b>" not in text
    assert "&lt;b&gt;&amp;$x$" in text


def test_folder_that_cannot_be_written_is_refused(finished: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(finished, tmp_path / "out"))
    (folder / "figures").touch()
    with pytest.raises(BadInput, match=r"the report cannot be written there: .*; name another file with --out"):
        write_report(folder, jobs=1)
    assert not (folder / "report.html").exists()


def test_page_and_figures_can_go_elsewhere(finished: Path, tmp_path: Path) -> None:
    out, before = tmp_path / "mine" / "page.html", sorted(finished.rglob("*"))
    assert write_report(finished, out, gallery=0, jobs=1) == out
    assert {path.name for path in out.parent.iterdir()} == {"page.html", "figures"}
    assert (out.parent / "figures" / "paths.svg").exists()
    assert sorted(finished.rglob("*")) == before


# --- the command


def test_command_says_where_the_report_is(finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = Path(shutil.copytree(finished, tmp_path / "out"))
    command.report(str(folder), gallery=1, jobs=1)
    assert capsys.readouterr().out == f"the report is {folder / 'report.html'}\n"
    assert len(list((folder / "figures").glob("forest-*-[0-9].svg"))) == 1
