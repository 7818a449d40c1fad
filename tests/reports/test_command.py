"""The command that writes the page of a run."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.reports.logs import HEADER, OUTCOME, text_of, write_log
from wayfarer.errors import BadInput
from wayfarer.reports.run import write_run_report


@pytest.mark.parametrize(
    ("content", "said"), [(b"hello\n", "nothing in this log can be read"), (None, r"run\.00001\.jsonl")]
)
def test_log_of_which_nothing_can_be_read_is_refused(tmp_path: Path, content: bytes | None, said: str) -> None:
    run = tmp_path if content is None else write_log(tmp_path / "1-run", [], content)
    with pytest.raises(BadInput, match=said):
        write_run_report(run)
    assert not list(tmp_path.rglob("*.html"))


@pytest.fixture
def logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two runs; the present folder holds folders that are named as runs are called."""
    for number in (16, 17):
        write_log(tmp_path / "logs" / f"000{number}-20261121T061405Z", [HEADER, OUTCOME])
    for name in ("last", "17", "18"):
        (tmp_path / "here" / name).mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "logs"


@pytest.mark.parametrize(("what", "number"), [("16", 16), ("last", 17)])
def test_runs_number_goes_before_a_folder_of_that_name(run: Run, logs: Path, what: str, number: int) -> None:
    assert run("report", what, "--log-dir", logs)[0] == 0
    assert [page.parent.name[:5] for page in logs.rglob("report.html")] == [f"000{number}"]


@pytest.mark.parametrize("what", ["18", "./17"])
def test_folder_is_a_campaign_where_no_run_has_its_name(run: Run, logs: Path, what: str) -> None:
    assert "campaign" in refusal(run, "report", what, "--log-dir", logs)
    assert not list(logs.rglob("report.html"))


def test_what_is_neither_run_nor_folder_is_refused_with_the_runs_there_are(run: Run, logs: Path) -> None:
    assert "00016-20261121T061405Z to 00017-20261121T061405Z" in refusal(run, "report", "19", "--log-dir", logs)


def test_page_of_a_copied_file_is_beside_it(run: Run, logs: Path, tmp_path: Path) -> None:
    (part,) = (logs / "00017-20261121T061405Z").glob("run.*")
    copy = tmp_path / "mine" / "from the rover.jsonl.gz"
    copy.parent.mkdir()
    copy.write_bytes(gzip.compress(part.read_bytes()))
    assert run("report", copy)[:2] == (0, f"the report is {copy.parent / 'report.html'}\n")
    assert "log complete" in text_of((copy.parent / "report.html").read_text(encoding="utf-8"))


def test_command_writes_the_page_where_it_is_told(run: Run, logs: Path, tmp_path: Path) -> None:
    out = tmp_path / "mine" / "page.html"
    assert run("report", "17", "--out", out, "--log-dir", logs)[:2] == (0, f"the report is {out}\n")
    assert {path.name for path in out.parent.iterdir()} == {"page.html"}
    assert {path.name for path in logs.rglob("*") if path.is_file()} == {"run.00001.jsonl"}
