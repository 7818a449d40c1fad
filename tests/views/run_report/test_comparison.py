"""The page of two runs, and the command that writes the pages of runs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.views.run_report.logs import (
    ARMED,
    HEADER,
    OUTCOME,
    check_page,
    data_of,
    drawn,
    drive,
    episode,
    simulated_drive,
    text_of,
    tick,
    write_log,
)
from tests.views.text.records import outcome
from wayfarer.cli import report as command
from wayfarer.errors import BadInput
from wayfarer.fieldlog.schema import Record
from wayfarer.views.run_report.comparison import difference_text, materially_different
from wayfarer.views.run_report.run import number_of, write_comparison, write_run_report
from wayfarer.views.run_report.settings import SAME_SETTINGS, changed_settings_table
from wayfarer.views.run_report.track import tracks_of


def test_two_runs_stand_beside_each_other_with_what_changed(tmp_path: Path) -> None:
    other = {**HEADER, "config": {**HEADER["config"], "control_hz": 10.0, "gym": {"seed": 3}}}
    first = write_log(tmp_path / "00017-20261121T061405Z", [HEADER, *episode(), OUTCOME])
    second = write_log(tmp_path / "00018-20261121T061405Z", [other, *drive(3.0), OUTCOME])
    out = write_comparison(first, second)
    assert out == second / "report-17-18.html"
    page = out.read_text(encoding="utf-8")
    check_page(page)
    text = text_of(page)
    assert "17 18 control_hz 20.0 10.0 gym.seed not there 3" in text
    assert "tilt_deg" not in text
    assert re.search(r'<tr class="same"><th scope="row">anomalies</th><td data-column="17">[^<]*1[^<]*</td>', page)
    assert re.findall(r'<tr class="differs"><th scope="row">(.*?)</th>', page) == ["where", "distance"]
    assert "What differs: where, distance" in text
    assert '"path-1"' in drawn(page)


def test_only_what_differs_by_more_than_runs_of_one_rover_stands_out(tmp_path: Path) -> None:
    def differs(name: str, *records: Record, **header: object) -> list[str]:
        return materially_different([usual, data_of(tmp_path / name, HEADER | header, *records)])

    usual = data_of(tmp_path / "usual", HEADER, ARMED, *drive(4.0), OUTCOME)
    assert differs("another seed, a little shorter", ARMED, *drive(3.8), OUTCOME, seed=99) == []
    assert "nothing" in difference_text([usual, usual])
    assert differs("half as long", ARMED, *drive(2.0), outcome(2.0)) == ["where", "time", "distance"]
    bumps = [tick(each["t_s"] - 100.0, anomalies=["touched"] * (at % 8 == 0)) for at, each in enumerate(drive(4.0))]
    assert differs("ten bumps", ARMED, *bumps, OUTCOME) == ["anomalies"]
    assert differs("one bump", ARMED, *bumps[:8], *drive(4.0)[8:], OUTCOME) == []
    assert differs("another version", ARMED, *drive(4.0), OUTCOME, version="9.8") == ["run"]
    assert differs("another end", ARMED, *drive(4.0), {**OUTCOME, "reason": "signal"}) == ["outcome"]


def test_folder_that_only_begins_with_a_number_is_not_called_by_it(tmp_path: Path) -> None:
    """``wayfarer logs list`` and the names of runs in commands know it by the folder's name too."""
    daemons, own = tmp_path / "00017-20261121T061405Z", tmp_path / "17-foo"
    assert [number_of(run) for run in (daemons, own)] == ["17", "17-foo"]


def test_runs_whose_maps_nothing_joins_begin_at_one_place(tmp_path: Path) -> None:
    there = data_of(tmp_path / "there", *simulated_drive(), OUTCOME)
    outside = data_of(tmp_path / "outside", HEADER, *drive(), OUTCOME)
    apart = [(track.path.north_m[0], track.forest) for track in tracks_of([there, outside])]
    assert apart == [(0.0, None), (0.0, None)]
    assert [track.path.north_m[0] for track in tracks_of([there, there])] == [12.5, 12.5]


def test_same_rover_file_is_said_to_be_the_same(tmp_path: Path) -> None:
    runs = [data_of(tmp_path / name, HEADER, *drive(1.0), OUTCOME) for name in "ab"]
    assert SAME_SETTINGS in changed_settings_table(runs, ["17", "18"])


@pytest.mark.parametrize(("content", "said"), [(b"hello\n", "nothing in this log can be read"), (None, r"run\.jsonl")])
def test_log_of_which_nothing_can_be_read_is_refused(tmp_path: Path, content: bytes | None, said: str) -> None:
    run = tmp_path if content is None else write_log(tmp_path / "1-run", [], content)
    with pytest.raises(BadInput, match=said):
        write_run_report(run)
    assert not list(tmp_path.rglob("*.html"))


# -- the command -------------------------------------------------------------------------------------------------


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
def test_runs_number_goes_before_a_folder_of_that_name(logs: Path, what: str, number: int) -> None:
    command.report(what, log_dir=logs)
    assert [page.parent.name[:5] for page in logs.rglob("report.html")] == [f"000{number}"]


@pytest.mark.parametrize("what", ["18", "./17"])
def test_folder_is_a_campaign_where_no_run_has_its_name(logs: Path, what: str) -> None:
    with pytest.raises(BadInput, match="campaign"):
        command.report(what, log_dir=logs)
    assert not list(logs.rglob("report.html"))


def test_what_is_neither_run_nor_folder_is_refused_with_the_runs_there_are(logs: Path) -> None:
    with pytest.raises(BadInput, match="00016-20261121T061405Z to 00017-20261121T061405Z"):
        command.report("19", log_dir=logs)


def test_command_writes_the_page_where_it_is_told(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine" / "page.html"
    command.report("17", out=out, log_dir=logs)
    assert capsys.readouterr().out == f"the report is {out}\n"
    assert {path.name for path in out.parent.iterdir()} == {"page.html"}
    assert {path.name for path in logs.rglob("*") if path.is_file()} == {"run.jsonl"}


def test_command_takes_two_runs(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command.report("16", "17", log_dir=logs)
    (page,) = logs.rglob("report-16-17.html")
    assert capsys.readouterr().out == f"the report is {page}\n"
