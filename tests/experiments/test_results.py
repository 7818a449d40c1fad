from __future__ import annotations

import errno
import fcntl
import json
import math
import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.experiments.fake_trials import campaign_of
from tests.fieldlog.disks import files_no_longer_than
from wayfarer.config.rover_file import laid_over
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.campaign import Axis, Plan, Task
from wayfarer.experiments.outcome import OUTCOMES
from wayfarer.experiments.provenance import RUNS
from wayfarer.experiments.recorded import SETTINGS
from wayfarer.experiments.results import MOST_LINE_BYTES, TRIALS, Results
from wayfarer.experiments.rows import COLUMNS, DECIMALS, TrialRow, csv_line, parse_row, row_of
from wayfarer.experiments.sweep import Sweep
from wayfarer.experiments.trial import TrialResult

PLAN = campaign_of(3, "pledge")
ROWS = [TrialRow(n, "pledge", n // 2, n % 2, 77 + n, "escaped", 80.125, 1.5, 90.0, 3, 2) for n in range(3)]
HEADER = csv_line(COLUMNS).encode()
LINES = [csv_line(COLUMNS, row).encode() for row in ROWS]


def values_of(column: str) -> st.SearchStrategy[Any]:
    """What a trial may give for a column; those that need not be known may be None."""
    known: st.SearchStrategy[Any] = st.floats(0, 1e6) if column in DECIMALS else st.integers(0, 10**6)
    return st.none() | known if column in TrialRow._field_defaults else known


results = st.fixed_dictionaries({name: values_of(name) for name in COLUMNS} | {
    "algorithm": st.just("pkg.rules:spiral"), "outcome": st.sampled_from(OUTCOMES), "seed": st.integers(0, 2**63 - 1),
    "ticks": st.just(5), "drawn": st.fixed_dictionaries({
        "sim.slope_deg": st.floats(0, 1e6).map(lambda drawn: float(f"{drawn:.6g}")),
        "sim.compass_bias_deg": st.integers(-100, 0),
    }),
}).map(lambda values: TrialResult(**values))  # fmt: skip


@given(results)
def test_row_holds_what_its_line_holds(result: TrialResult) -> None:
    row = row_of(result)
    columns = (*COLUMNS, *row.drawn)
    again = parse_row(csv_line(columns, row).encode(), columns, "here")
    assert again == row
    assert csv_line(columns, again) == csv_line(columns, row)


def cells_of(**values: Any) -> dict[str, str]:
    """The cells of the line of a trial which gave these values, and 0 for what it had to give; but for empty ones."""
    needed = dict.fromkeys(set(TrialResult._fields) - set(TrialResult._field_defaults), 0)
    row = row_of(TrialResult(**{**needed, **values}))
    cells = csv_line(COLUMNS, row).rstrip("\n").split(",")
    return {name: cell for name, cell in zip(COLUMNS, cells, strict=True) if cell}


def test_cells_have_fixed_decimals_and_are_empty_for_what_is_not_known() -> None:
    names = {"algorithm": "pledge", "outcome": "escaped"}
    cells = cells_of(**names, trial=7, path_m=81.3, reverse_m=4.25, time_s=95.05, shortest_path_m=39.9, spl=0.49077)
    assert cells == {
        **names, "trial": "7", "forest": "0", "noise": "0", "seed": "0", "path_m": "81.300", "reverse_m": "4.250",
        "time_s": "95.050", "anomalies": "0", "episodes": "0", "shortest_path_m": "39.900", "spl": "0.4908",
    }  # fmt: skip
    fault = csv_line(COLUMNS, TrialRow(7, "pledge", 3, 1, 99, "fault"))
    assert fault.rstrip(",\n") == "7,pledge,3,1,99,fault"


def test_row_never_holds_nan_or_a_negative_zero() -> None:
    cells = cells_of(path_m=math.nan, reverse_m=-0.0, time_s=-1e-9, shortest_path_m=math.inf, spl=None)
    assert (cells["reverse_m"], cells["time_s"]) == ("0.000", "0.000")
    assert cells.keys().isdisjoint({"path_m", "shortest_path_m", "spl"})


def fill(path: Path, *rows: TrialRow, finished: bool = False) -> None:
    """Make a folder with these rows, which may be all there are."""
    with Results.kept(PLAN, path) as results:
        for row in rows:
            results.add(row)
        if finished:
            assert results.finished
            results.finish()


def opened(path: Path, plan: Plan = PLAN, **options: Any) -> list[TrialRow]:
    """The rows that a folder has when it is opened to be written."""
    with Results.kept(plan, path, **options) as results:
        return list(results.rows)


WHOLE = csv_line(COLUMNS, ROWS[0])


@pytest.mark.parametrize(
    "line",
    [
        "",
        "1,pledge",
        "x" * 99,
        WHOLE.replace("escaped", "vanished"),
        WHOLE.replace("80.125", "nan"),
        WHOLE.replace("80.125", "1e999"),
        WHOLE.replace("80.125", "-80.125"),
        WHOLE.replace("80.125", str(2**63)),
        WHOLE.replace(",77,", f",{2**63},"),
        WHOLE.replace(",77,", f",{'7' * 5000},"),
        WHOLE.removeprefix("0"),
        f"-1{WHOLE.removeprefix('0')}",
    ],
)
def test_line_that_is_no_row_is_refused_with_its_place(line: str) -> None:
    with pytest.raises(BadInput, match=r"^trials.csv, line 9 is not a row") as refused:
        parse_row(line.encode(), COLUMNS, "trials.csv, line 9")
    assert len(str(refused.value)) < 200


def test_finished_folder_holds_whole_files_only(tmp_path: Path) -> None:
    fill(folder := tmp_path / "new" / "run", *ROWS[::-1], finished=True)
    assert {path.name for path in folder.iterdir()} == {SETTINGS, RUNS, TRIALS}
    assert (folder / TRIALS).read_bytes() == HEADER + b"".join(LINES), "in the order of its trials"


def test_row_is_on_disk_as_soon_as_it_is_kept_and_the_folder_in_use_until_it_is_left(tmp_path: Path) -> None:
    with Results.kept(PLAN, tmp_path) as results:
        results.add(ROWS[1])
        assert (tmp_path / TRIALS).read_bytes() == HEADER + LINES[1]
        with pytest.raises(BadInput, match="in use"):
            opened(tmp_path, resume=True)
    opened(tmp_path, resume=True)


def test_resuming_after_a_cut_anywhere_keeps_exactly_the_whole_lines(tmp_path: Path) -> None:
    fill(tmp_path, *ROWS[:2])
    whole = (tmp_path / TRIALS).read_bytes()
    for length in range(len(whole) + 1):
        (tmp_path / TRIALS).write_bytes(whole[:length])
        with Results.kept(PLAN, tmp_path, resume=True) as results:
            assert results.rows == ROWS[: max(0, whole[:length].count(b"\n") - 1)]
            for row in ROWS[len(results.rows) : 2]:
                results.add(row)
        assert (tmp_path / TRIALS).read_bytes() == whole


@pytest.mark.parametrize("order", [1, -1])
def test_finished_folder_resumes_to_what_it_holds_and_is_put_in_order_if_it_is_not(tmp_path: Path, order: int) -> None:
    fill(tmp_path, *ROWS[::order])
    runs = (tmp_path / RUNS).read_bytes()
    with Results.kept(PLAN, tmp_path, resume=True) as results:
        assert (results.finished, results.rows, results.missing()) == (True, ROWS[::order], [])
        results.finish()
    assert (tmp_path / TRIALS).read_bytes() == HEADER + b"".join(LINES)
    assert ((tmp_path / RUNS).read_bytes() == runs) is (order == 1), "that nothing was to be done is no run"


def test_nothing_of_a_torn_line_stays_behind_the_next_one(tmp_path: Path) -> None:
    fill(tmp_path)
    (tmp_path / TRIALS).write_bytes(HEADER + b"0" * 500)
    with Results.kept(PLAN, tmp_path, resume=True) as results:
        results.add(ROWS[0])
    assert (tmp_path / TRIALS).read_bytes() == HEADER + LINES[0]


@pytest.mark.parametrize("kind", ["symlink", "dangling symlink", "pipe", "device"])
def test_table_is_neither_followed_nor_waited_for(tmp_path: Path, kind: str) -> None:
    fill(folder := tmp_path / "run")
    table, other = folder / TRIALS, tmp_path / "other"
    table.unlink()
    match kind:
        case "pipe":
            os.mkfifo(table)
        case "device":
            table.symlink_to("/dev/zero")
        case _:
            table.symlink_to(other)
    if kind == "symlink":
        other.write_bytes(HEADER)
    with pytest.raises(BadInput, match=rf"{TRIALS} cannot be used .* no ordinary file"):
        opened(folder, resume=True)
    assert other.exists() == (kind == "symlink")


@pytest.mark.parametrize("settings", ["[" * 100_000, "[]", "null", "1" * 5000, "\0", '{"trials": 1e999}'])
def test_settings_that_are_none_are_refused(tmp_path: Path, settings: str) -> None:
    fill(tmp_path)
    (tmp_path / SETTINGS).write_text(settings)
    with pytest.raises(BadInput, match=r"holds no campaign|another campaign") as refused:
        opened(tmp_path, resume=True)
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize(("opening", "end"), [('{"a":', "}"), ("[", "]")])
def test_settings_within_settings_are_refused_at_every_depth(tmp_path: Path, opening: str, end: str) -> None:
    fill(tmp_path)
    for depth in range(sys.getrecursionlimit() - 200, sys.getrecursionlimit()):
        (tmp_path / SETTINGS).write_text(f'{{"version": {opening * depth}1{end * depth}}}')
        with pytest.raises(BadInput, match=r"holds no campaign|another campaign"):
            opened(tmp_path, resume=True)


def test_settings_are_not_waited_for(tmp_path: Path) -> None:
    fill(tmp_path)
    (tmp_path / SETTINGS).unlink()
    os.mkfifo(tmp_path / SETTINGS)
    with pytest.raises(BadInput, match="holds no campaign"):
        opened(tmp_path, resume=True)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (HEADER + b"\0\0\0\n", ", line 2 is not a row"),
        (HEADER + b"\x80\n", ", line 2 is not a row of a campaign .*can't decode byte 0x80"),
        (b"\xff\xfe\n", " is damaged.*: its first line does not name its columns"),
        (b"trial,algorithm\n", " is damaged.*: its first line does not name its columns"),
        (b"point," + HEADER, " is damaged, or was written by another version"),
        (HEADER + b"0" * MOST_LINE_BYTES, ", line 2 is not a row"),
        (HEADER + LINES[0] + LINES[1] + LINES[0], ", line 4 is damaged: it is a second row of trial 0 of 'pledge'"),
        (HEADER + LINES[0].replace(b"0,pledge", b"3,pledge"), ", line 2 is damaged: there is no trial 3 of 'pledge'"),
        (HEADER + LINES[0].replace(b"pledge", b"oo-react"), ", line 2 is damaged: there is no trial 0 of 'oo-react'"),
    ],
)
@pytest.mark.parametrize("finished", [False, True])
def test_damaged_table_is_named_and_left_alone(tmp_path: Path, content: bytes, said: str, finished: bool) -> None:
    fill(tmp_path, *ROWS[: 3 if finished else 1], finished=finished)
    (tmp_path / TRIALS).write_bytes(content + b"2,pled")
    with pytest.raises(BadInput, match=rf"trials\.csv{said}"):
        opened(tmp_path, resume=True)
    assert (tmp_path / TRIALS).read_bytes() == content + b"2,pled"


# -- which trials there are, and in which order ------------------------------------------------------------------------

SWEPT = Sweep(campaign_of(2, "b", "a"), (Axis("escape.turn_angle_deg", (10, 30.5, 20), 30.0),))
ALL = Results(SWEPT).missing()


def row_of_task(task: Task) -> TrialRow:
    return TrialRow(task.trial, task.algorithm, 3, 1, 77, "escaped", 80.5, point=task.point)


def test_forest_serves_all_algorithms_of_a_point_and_the_table_goes_by_points() -> None:
    assert [Task(name, trial, point) for trial in range(2) for point in range(3) for name in "ba"] == ALL
    assert [row.key for row in Results(SWEPT, list(map(row_of_task, ALL))).in_order()] == [
        (name, trial, point) for point in range(3) for name in "ba" for trial in range(2)
    ]


@given(st.lists(st.sampled_from(ALL), unique=True))
def test_rows_come_back_as_they_were_kept_and_what_is_missing_is_the_rest(finished: list[Task]) -> None:
    """Also while it runs, when a last line may be torn."""
    with tempfile.TemporaryDirectory() as out:
        with Results.kept(SWEPT, Path(out)) as results:
            for task in finished:
                results.add(row_of_task(task))
            (read := Results.open(Path(out), unfinished=True)).rows.sort(key=lambda row: finished.index(Task(*row.key)))
        assert read.rows == results.rows == list(map(row_of_task, finished))
        assert read.missing() == [task for task in ALL if task not in finished]
        assert (read.total, read.finished) == (12, len(finished) == 12)
        with (Path(out) / TRIALS).open("a") as file:
            file.write("0,10,0,")
        assert len(Results.open(Path(out), unfinished=True).rows) == len(finished)


def test_unfinished_results_say_so(tmp_path: Path) -> None:
    fill(tmp_path, *ROWS[:2])
    with pytest.raises(BadInput, match="its campaign is not finished, it has 2 of 3 trials; repeat its `wayfarer sim`"):
        Results.open(tmp_path)
    assert repr(Results.open(tmp_path, unfinished=True)) == "<Results: 2 of 3 trials of pledge>"


# -- whose folder it is ------------------------------------------------------------------------------------------------


def test_another_campaigns_folder_is_refused_by_its_first_difference(tmp_path: Path) -> None:
    opened(tmp_path)
    faster = replace(PLAN, rover=laid_over(PLAN.rover, {"rates": {"compass_hz": 50.0}}))
    with pytest.raises(BadInput, match=r"rover\.rates\.compass_hz is 20\.0 there and 50\.0 here"):
        opened(tmp_path, faster, resume=True)


@pytest.mark.parametrize("plan", [PLAN, SWEPT])
def test_folder_of_another_commit_is_resumed_and_one_of_another_release_is_refused(tmp_path: Path, plan: Plan) -> None:
    def of_version(version: str) -> Plan:
        base = replace(plan.base, version=version)
        return Sweep(base, plan.axes) if plan.axes else base

    opened(tmp_path, of_version("0.2.0+g1a2b3c4d"))
    opened(tmp_path, of_version("0.2.0+dev"), resume=True)
    with pytest.raises(BadInput, match=r"version is '0\.2\.0' there and '0\.3\.0' here"):
        opened(tmp_path, of_version("0.3.0"), resume=True)


def test_folder_of_a_version_with_fewer_settings_is_refused_by_what_it_lacks(tmp_path: Path) -> None:
    opened(tmp_path)
    settings = json.loads((tmp_path / SETTINGS).read_text())
    del settings["ground"]
    (tmp_path / SETTINGS).write_text(json.dumps(settings))
    with pytest.raises(BadInput, match=r"belongs to another campaign: ground is None there and 'ideal' here"):
        opened(tmp_path, resume=True)


@pytest.mark.parametrize(("resume", "said"), [(False, "not empty"), (True, "holds no campaign")])
def test_folder_with_something_else_in_it_is_refused_and_left_alone(tmp_path: Path, resume: bool, said: str) -> None:
    (tmp_path / "holiday.jpg").touch()
    with pytest.raises(BadInput, match=said):
        opened(tmp_path, resume=resume)
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.jpg"]


def test_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(BadInput, match="is a file"):
        opened(tmp_path / "out")
    with pytest.raises(BadInput, match="cannot be used for the output: Not a directory"):
        opened(tmp_path / "out" / "run")


def test_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="name too long"):
        opened(tmp_path / ("c" * 300))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_write_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with pytest.raises(BadInput, match="Permission denied"):
        opened(tmp_path)


def test_full_disk_ends_in_one_line_that_says_what_to_do(tmp_path: Path) -> None:
    """It is still full when the folder is left, and a line that was cut short does not count."""
    said = r"cannot be written any more: File too large.*--resume"
    kept: list[TrialRow] = []
    with (
        files_no_longer_than(4000),
        pytest.raises(WayfarerError, match=said),
        Results.kept(LARGE, tmp_path) as results,
    ):
        for trial in range(1000):
            results.add(ROWS[0]._replace(trial=trial))
            kept.append(ROWS[0]._replace(trial=trial))
    assert opened(tmp_path, LARGE, resume=True) == kept


LARGE = campaign_of(1000, "pledge")


def test_filesystem_without_locks_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(_descriptor: int, _operation: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuses)
    with (
        pytest.warns(
            UserWarning, match=r"cannot be locked \(No locks available\): let no other campaign write into it"
        ),
        Results.kept(PLAN, tmp_path) as results,
    ):
        results.add(ROWS[0])
    assert (tmp_path / TRIALS).read_bytes() == HEADER + LINES[0]
    assert Results.open(tmp_path, unfinished=True).rows == ROWS[:1]
