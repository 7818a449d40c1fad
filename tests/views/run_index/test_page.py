"""The index of all runs: a row for each, whatever its log and its name are."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import pytest

from tests.views.page.outline import Outline
from tests.views.text.records import BEGAN_WALL_S, HEADER, drive, event, numbered, outcome, tick, write
from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import Record
from wayfarer.views.run_index import findings
from wayfarer.views.run_index.findings import RunFindings, findings_of
from wayfarer.views.run_index.page import write_index
from wayfarer.views.text.summary import summarise

FIRST, SECOND = "00001-20261121T061405Z", "00002-20261121T071405Z"
HOSTILE = "</script><script>alert('&')</script>"
ODD_NAME = "javascript:alert(1)#?%22\"'<b>"


def index_of(logs: Path, out: Path | None = None) -> str:
    return write_index(logs, BEGAN_WALL_S + 1e6, out).read_text(encoding="utf-8")


def rows_of(page: str) -> list[list[str]]:
    """The cells of each row as a reader sees them."""
    body = page.partition("<tbody>")[2].partition("</tbody>")[0]
    rows = re.findall(r"<tr.*?</tr>", body, flags=re.DOTALL)
    return [[unescape(re.sub("<.*?>", "", cell)) for cell in re.findall(r"<t[hd].*?</t[hd]>", row)] for row in rows]


def eventful() -> list[Record]:
    """A drive with two marks and two anomalies, one of which begins again after a tick without a heading."""
    seen: tuple[list[str] | None, ...] = (["touched"], ["touched", "nose_up"], ["nose_up"], None, ["nose_up"], [])
    bumped = [tick(6.0 + 0.05 * at, anomalies=each) for at, each in enumerate(seen) if each is not None]
    blind = tick(6.15, heading_deg=None)
    for key in ("goal_heading_deg", "anomalies", "travelled_m"):
        del blind[key]
    bumped.insert(3, blind)
    marks = [event("mark", at_s, text=text) for at_s, text in ((2.0, "hit log"), (3.0, HOSTILE))]
    return numbered([HEADER, *drive(0.0, 2.0), *marks, *drive(4.0, 6.0), *bumped, outcome(8.0)])


def test_index_has_a_row_for_each_run_the_newest_first(tmp_path: Path) -> None:
    write(tmp_path / FIRST, eventful())
    write(tmp_path / SECOND, [b"nonsense\n"])
    (tmp_path / FIRST / "report.html").touch()
    page = index_of(tmp_path)
    broken, whole = rows_of(page)
    assert whole[:2] == ["1", "report"]
    assert whole[3:8] == ["0:00:08", "minirover", "forest-pledge", "3", "0"]
    assert whole[8:] == ["3", "requested", f"hit log{HOSTILE}", "9.9"]
    assert broken == ["2", *[""] * 8, "unreadable", "", ""]
    assert HOSTILE not in page
    assert Outline(page).links == [f"{SECOND}/", f"{FIRST}/", f"{FIRST}/report.html"]


def test_links_lead_from_where_the_page_is_to_a_run_of_any_name(tmp_path: Path) -> None:
    write(tmp_path / "logs" / ODD_NAME, [HEADER, tick(1.0)])
    (link,) = Outline(index_of(tmp_path / "logs", tmp_path / "elsewhere" / "page.html")).links
    assert link == "../logs/javascript%3Aalert%281%29%23%3F%2522%22%27%3Cb%3E/"


def test_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="holds no run; give the folder of the logs with --log-dir DIR"):
        write_index(tmp_path, BEGAN_WALL_S)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("block_bytes", [7, 300, 4_000_000])
def test_marks_are_found_wherever_a_block_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block_bytes: int
) -> None:
    monkeypatch.setattr(findings, "BLOCK_BYTES", block_bytes)
    run = write(tmp_path / FIRST, eventful())
    assert findings_of(run) == RunFindings(3, ("hit log", HOSTILE))
    assert sum(summarise(RunReader(run)).anomalies.values()) == 3


def test_changed_mark_is_none_and_what_is_too_large_is_not_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = write(tmp_path / FIRST, eventful())
    file = run / "run.jsonl"
    file.write_bytes(file.read_bytes().replace(b"hit log", b"hit dog"))
    assert findings_of(run) == RunFindings(3, (HOSTILE,))
    monkeypatch.setattr(findings, "MOST_BYTES", 1000)
    assert findings_of(run) is None
