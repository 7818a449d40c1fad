from __future__ import annotations

import json
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.errors import BadInput, WayfarerError
from wayfarer.simhal.results import PARQUET, PARTIAL, SETTINGS, SUMMARY, TRIALS, ResultsFolder, read_rows
from wayfarer.simhal.rows import COLUMNS, OUTCOMES, Row, csv_line, parse_row, row_of
from wayfarer.simhal.trial import TrialResult

SETTINGS_HERE: dict[str, Any] = {
    "version": "1",
    "algorithms": ["pledge"],
    "trials": 3,
    "rover": {"name": "sim", "rates": {"compass_hz": 20.0}},
}
ROWS = [Row(n, "pledge", n // 2, n % 2, 77 + n, "escaped", 80.125, 1.5, 90.0, 3, 2, ticks=9) for n in range(3)]
numbers = st.floats(-1e6, 1e6)
maybe = st.none() | numbers


@st.composite
def results(draw: st.DrawFn) -> TrialResult:
    counts = [draw(st.integers(0, 10**6)) for _ in range(4)]
    outcome: Any = draw(st.sampled_from(OUTCOMES))
    return TrialResult(
        counts[0], "pkg.rules:spiral", counts[1], counts[2], draw(st.integers(0, 2**63 - 1)), outcome,
        draw(numbers), draw(numbers), draw(numbers), counts[3], 4, draw(maybe), draw(maybe), 5,
    )  # fmt: skip


@given(results())
def test_row_holds_what_its_line_holds(result: TrialResult) -> None:
    row = row_of(result)
    again = parse_row(csv_line(row), Row._fields, "here")
    assert again == row
    assert csv_line(again) == csv_line(row)


def test_row_reads_as_the_issue_asks() -> None:
    assert csv_line(COLUMNS) == (
        "trial,algorithm,forest,noise,seed,outcome,path_m,reverse_m,time_s,anomalies,episodes,shortest_path_m,spl,"
        "interventions,overturned,off_wheels\n"
    )
    result = TrialResult(7, "pledge", 3, 1, 99, "escaped", 81.3, 4.25, 95.05, 12, 5, 39.9, 0.49077, 1900)
    assert csv_line(row_of(result)[:-1]) == "7,pledge,3,1,99,escaped,81.300,4.250,95.050,12,5,39.900,0.4908,,,\n"
    assert csv_line(Row(7, "pledge", 3, 1, 99, "fault")[:-1]) == "7,pledge,3,1,99,fault,,,,,,,,,,\n"


def test_row_never_holds_nan_or_a_negative_zero() -> None:
    result = TrialResult(0, "pledge", 0, 0, 1, "tipped", float("nan"), -0.0, -1e-9, 0, 0, float("inf"), None, 0)
    assert csv_line(row_of(result)[:-1]) == "0,pledge,0,0,1,tipped,,0.000,0.000,0,0,,,,,\n"


def finish(folder: ResultsFolder, summary: dict[str, Any]) -> None:
    list(folder.into_tables(folder.kept))
    folder.finish(summary)


WHOLE = csv_line(ROWS[0])


@pytest.mark.parametrize(
    "line",
    [
        "",
        "1,pledge",
        "x" * 99,
        WHOLE.replace("escaped", "vanished"),
        WHOLE.replace("80.125", "nan"),
        WHOLE.replace("80.125", "1e999"),
        WHOLE.removeprefix("0"),
    ],
)
def test_line_that_is_no_row_is_refused_with_its_place(line: str) -> None:
    with pytest.raises(BadInput, match=r"^trials.csv, line 9 is not a row"):
        parse_row(line, Row._fields, "trials.csv, line 9")


def test_finished_folder_holds_whole_files_only(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path / "new" / "run", SETTINGS_HERE) as folder:
        for row in ROWS:
            folder.append(row)
        finish(folder, {"ticks": 27})
        assert folder.complete
    assert {path.name for path in folder.path.iterdir()} == {SETTINGS, TRIALS, PARQUET, SUMMARY}
    assert (folder.path / TRIALS).read_text() == csv_line(COLUMNS) + "".join(csv_line(row[:-1]) for row in ROWS)
    assert json.loads((folder.path / SUMMARY).read_text()) == {"ticks": 27}


def test_row_is_on_disk_as_soon_as_it_is_kept(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        folder.append(ROWS[1])
        assert (tmp_path / PARTIAL).read_text() == csv_line(Row._fields) + csv_line(ROWS[1])


def test_resuming_after_a_cut_anywhere_keeps_exactly_the_whole_lines(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        for row in ROWS[:2]:
            folder.append(row)
    whole = (tmp_path / PARTIAL).read_bytes()
    for length in range(len(whole) + 1):
        (tmp_path / PARTIAL).write_bytes(whole[:length])
        with ResultsFolder(tmp_path, SETTINGS_HERE, resume=True) as folder:
            assert list(folder.kept) == ROWS[: max(0, whole[:length].count(b"\n") - 1)]
            for row in ROWS[len(folder.kept) : 2]:
                folder.append(row)
        assert (tmp_path / PARTIAL).read_bytes() == whole


def test_complete_folder_resumes_to_what_it_holds(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        for row in ROWS:
            folder.append(row)
        finish(folder, {})
    with ResultsFolder(tmp_path, SETTINGS_HERE, resume=True) as folder:
        assert folder.complete
        assert list(folder.kept) == [row._replace(ticks=None) for row in ROWS]


def test_damaged_row_in_the_middle_is_named(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        folder.append(ROWS[0])
    with (tmp_path / PARTIAL).open("a") as partial:
        partial.write("\0\0\0\n")
    with pytest.raises(BadInput, match=r"trials\.partial\.csv, line 3 is not a row"):
        ResultsFolder(tmp_path, SETTINGS_HERE, resume=True)


@pytest.mark.parametrize("damage", [b"\x80", b"\xff\xfe"])
def test_rows_that_are_no_text_are_refused_with_the_file(tmp_path: Path, damage: bytes) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        folder.append(ROWS[0])
    with (tmp_path / PARTIAL).open("ab") as partial:
        partial.write(damage + b"\n")
    with pytest.raises(BadInput, match=r"trials\.partial\.csv is damaged: byte \d+ is no text"):
        ResultsFolder(tmp_path, SETTINGS_HERE, resume=True)


@pytest.mark.parametrize("content", [b"", b"trial,algorithm\n"])
def test_table_without_its_columns_is_refused(tmp_path: Path, content: bytes) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        folder.append(ROWS[0])
        finish(folder, {})
    (tmp_path / TRIALS).write_bytes(content)
    with pytest.raises(BadInput, match=r"trials\.csv is damaged: its first line does not name its columns"):
        ResultsFolder(tmp_path, SETTINGS_HERE, resume=True)


def test_another_campaigns_folder_is_refused_by_its_first_difference(tmp_path: Path) -> None:
    ResultsFolder(tmp_path, SETTINGS_HERE).close()
    faster = {**SETTINGS_HERE, "rover": {"name": "sim", "rates": {"compass_hz": 50.0}}}
    with pytest.raises(BadInput, match=r"rover\.rates\.compass_hz is 20\.0 there and 50\.0 here"):
        ResultsFolder(tmp_path, faster, resume=True)


def test_folder_that_is_in_use_is_refused(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE), pytest.raises(BadInput, match="in use"):
        ResultsFolder(tmp_path, SETTINGS_HERE, resume=True)
    ResultsFolder(tmp_path, SETTINGS_HERE, resume=True).close()


@pytest.mark.parametrize("resume", [False, True])
def test_folder_with_something_else_in_it_is_refused_and_left_alone(tmp_path: Path, resume: bool) -> None:
    (tmp_path / "holiday.jpg").touch()
    with pytest.raises(BadInput, match="holds no campaign" if resume else "not empty"):
        ResultsFolder(tmp_path, SETTINGS_HERE, resume=resume)
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.jpg"]


def test_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(BadInput, match="is a file"):
        ResultsFolder(tmp_path / "out", SETTINGS_HERE)
    with pytest.raises(BadInput, match="cannot be used for the output: Not a directory"):
        ResultsFolder(tmp_path / "out" / "run", SETTINGS_HERE)


def test_folder_that_cannot_be_made_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="name too long"):
        ResultsFolder(tmp_path / "a" / "b" / ("c" * 300), SETTINGS_HERE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_write_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with pytest.raises(BadInput, match="Permission denied"):
        ResultsFolder(tmp_path, SETTINGS_HERE)


@contextmanager
def full_disk() -> Iterator[None]:
    """A process that may write no file any further is as badly off."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_full_disk_ends_in_one_line_that_says_what_to_do(tmp_path: Path) -> None:
    said = r"cannot be written any more: File too large.*--resume"
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder, full_disk(), pytest.raises(WayfarerError, match=said):
        folder.append(ROWS[0])


def as_older(text: str, last: int) -> str:
    """Leave out the kinds of interventions, which older versions did not tell; so many columns stand behind them."""
    lines = [line.split(",") for line in text.splitlines()]
    return "".join(",".join(cells[: -2 - last] + cells[len(cells) - last :]) + "\n" for cells in lines)


def test_table_of_an_older_version_is_read(tmp_path: Path) -> None:
    path = tmp_path / TRIALS
    path.write_text(as_older(csv_line(COLUMNS) + "".join(csv_line(row[:-1]) for row in ROWS), last=0))
    assert "overturned" not in path.read_text()
    assert read_rows(path, COLUMNS) == [row._replace(ticks=None) for row in ROWS]


def test_campaign_of_an_older_version_is_gone_on_with(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path, SETTINGS_HERE) as folder:
        folder.append(ROWS[0])
    partial = tmp_path / PARTIAL
    partial.write_text(as_older(partial.read_text(), last=1))
    assert partial.read_text().splitlines()[0].endswith("interventions,ticks")
    helped = ROWS[1]._replace(interventions=3, overturned=1, off_wheels=2)
    with ResultsFolder(tmp_path, SETTINGS_HERE, resume=True) as folder:
        folder.append(helped)
        assert [*folder.kept] == [ROWS[0], helped]
    assert partial.read_text() == csv_line(Row._fields) + csv_line(ROWS[0]) + csv_line(helped)
