"""The list of runs: told from the two ends of each log."""

from __future__ import annotations

import gzip
import os
import time
from pathlib import Path

import pytest

from tests.logview.records import BEGAN_WALL_S, HEADER, RUN, drive, line, numbered, outcome, tick, write
from wayfarer.logview.listing import CELLS, RunRow, lines, rows

LONG_AGO_S = BEGAN_WALL_S - 1e6


def row(logs: Path, now_wall_s: float = LONG_AGO_S) -> RunRow:
    (found,) = rows(logs, now_wall_s)
    return found


def cells(logs: Path) -> tuple[str, ...]:
    """The only run's line, cell by cell."""
    return tuple(cell(row(logs)) for cell in CELLS.values())


def test_row_says_what_became_of_a_run(tmp_path: Path) -> None:
    write(tmp_path / RUN, numbered([HEADER, *drive(0.0, 4000.0, episodes=3), outcome(4000.0)]))
    began = time.strftime("%Y-%m-%d %H:%M", time.localtime(BEGAN_WALL_S))
    assert cells(tmp_path)[:8] == (
        "17", began, "1:06:40", "minirover", "forest-pledge", "2000", "3", "requested",
    )  # fmt: skip
    assert row(tmp_path).commanded_m == pytest.approx(2000.0, abs=1.0)
    assert (row(tmp_path).size_bytes or 0) > 10_000_000


def test_run_without_an_outcome_goes_on_or_was_cut_off(tmp_path: Path) -> None:
    run = write(tmp_path / RUN, [HEADER, tick(1.0)])
    os.utime(run / "run.00001.jsonl", (5000.0, 5000.0))
    assert row(tmp_path, now_wall_s=5001.0).outcome == "running"
    assert row(tmp_path, now_wall_s=5060.0).outcome == "cut off"


def test_clock_that_was_never_set_is_not_shown_as_a_time(tmp_path: Path) -> None:
    write(tmp_path / RUN, [HEADER | {"t_wall": 50.0}, tick(1.0) | {"t_wall": 51.0}])
    assert cells(tmp_path)[1] == "clock not set"
    assert row(tmp_path).began_wall_s is None


def test_trial_has_a_time_of_its_own(tmp_path: Path) -> None:
    write(tmp_path / RUN, [HEADER | {"trial": 5, "simulated": True}, tick(1.0)])
    assert cells(tmp_path)[1:4] == ("trial 5", "0:00:01", "minirover (sim)")


def test_run_in_parts_is_told_by_its_first_and_its_last(tmp_path: Path) -> None:
    write(tmp_path / RUN, [HEADER, tick(1.0)])
    write(tmp_path / RUN, [tick(7200.0)], "run.00004.jsonl")
    write(tmp_path / RUN, [HEADER | {"part": 5, "t_s": 7300.0, "elapsed_s": 7200.0}])
    assert cells(tmp_path)[2:7] == ("2:00:00", "minirover", "forest-pledge", "3600", "0")


@pytest.mark.parametrize("content", [b"", b"\0" * 9000, b"nonsense\n", b'{"record":"run","t_s":1'])
def test_run_of_which_nothing_can_be_read_is_listed_all_the_same(tmp_path: Path, content: bytes) -> None:
    (tmp_path / RUN).mkdir()
    (tmp_path / RUN / "run.00001.jsonl").write_bytes(content)
    assert cells(tmp_path) == ("17", "", "", "", "", "", "", "unreadable", "")
    assert row(tmp_path) == RunRow(RUN, 17)


@pytest.mark.parametrize("hostile", ["pipe", "device", "hole", "empty lines"])
def test_run_in_which_anything_may_stand_is_listed_at_once(tmp_path: Path, hostile: str) -> None:
    file = tmp_path / RUN / "run.00001.jsonl"
    file.parent.mkdir()
    match hostile:
        case "pipe":
            os.mkfifo(file)
        case "device":
            file.symlink_to("/dev/zero")
        case "hole":
            file.touch()
            os.truncate(file, 10**12)
        case "empty lines":
            file.write_bytes(b"\n" * 10**7)
    assert row(tmp_path).outcome == "unreadable"


@pytest.mark.timeout(15)  # a whole look through it takes a minute
def test_packed_part_that_holds_more_than_any_disk_is_listed_at_once(tmp_path: Path) -> None:
    (tmp_path / RUN).mkdir()
    holes = gzip.compress(bytes(10**7)) * 2_000  # 20 GB
    (tmp_path / RUN / "run.00001.jsonl.gz").write_bytes(gzip.compress(line(HEADER) + line(tick(1.0))) + holes)
    assert (row(tmp_path).rover, row(tmp_path).outcome) == ("minirover", "cut off")


def test_long_run_is_listed_from_its_ends(tmp_path: Path) -> None:
    file = write(tmp_path / RUN, [HEADER, tick(1.0)]) / "run.00001.jsonl"
    os.truncate(file, 10**12)
    write(tmp_path / RUN, [b"\n", tick(2.0, travelled_m=5.0), outcome(3.0)])
    assert cells(tmp_path)[2:] == ("0:00:03", "minirover", "forest-pledge", "5", "0", "requested", "1000000.0")


def test_run_whose_first_part_lost_its_header_is_told_by_a_later_one(tmp_path: Path) -> None:
    write(tmp_path / RUN, [tick(1.0)], "run.00001.jsonl")
    write(tmp_path / RUN, [HEADER | {"part": 2, "t_s": 105.0, "simulated": True, "trial": 5}, tick(6.0)])
    assert cells(tmp_path)[:5] == ("17", "trial 5", "0:00:06", "minirover (sim)", "forest-pledge")


def test_folders_without_a_number_are_listed_by_their_names(tmp_path: Path) -> None:
    for name in ("forest-pledge-00017", RUN, "oo-pledge-00001"):
        write(tmp_path / name, [HEADER, tick(1.0)])
    (tmp_path / "no-run").mkdir()
    assert sorted(line.split()[0] for line in lines(rows(tmp_path, LONG_AGO_S), None)) == [
        "17", "forest-pledge-00017", "oo-pledge-00001", "run",
    ]  # fmt: skip


def test_narrow_terminal_goes_without_the_less_important() -> None:
    table = [
        RunRow(
            RUN, 17, None, BEGAN_WALL_S, 4000.0, "minirover", "forest-pledge", False, True, 2000.0, 3, "signal", 12_000
        )
    ]
    wide, narrow = lines(table, None), lines(table, 60)
    assert wide[0].split() == ["run", "began", "lasted", "rover", "algorithm", "m", "episodes", "outcome", "MB"]
    assert narrow[0].split() == ["run", "began", "lasted", "m", "episodes", "outcome"]
    assert max(map(len, narrow)) <= 60
    assert "17" in lines(table, 1)[1]
