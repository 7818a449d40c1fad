"""Following logs while they are written: each wait does the next thing that the writer does."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.logview.records import HEADER, drive, event, numbered, outcome, tick, write
from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import log_segments
from wayfarer.logview import tail

FIRST, SECOND = "00001-20261121T061405Z", "00002-20261121T071405Z"


class Following:
    """Follows until every step was done and read.

    ``times`` has the times of what came, by the folder's name; ``ended`` tells whether following ended by itself.
    """

    def __init__(self, logs: Path, run: Path | None, *steps: Callable[[], object]) -> None:
        self._left = list(steps)
        self.times: dict[str, list[float]] = {}
        self.ended = False
        try:
            for path, record in tail.follow(logs, run, self._wait):
                self.times.setdefault(path.name, []).append(record.t_s - HEADER["t_s"])
            self.ended = True
        except KeyboardInterrupt:
            pass

    def _wait(self) -> None:
        if not self._left:
            raise KeyboardInterrupt
        self._left.pop(0)()


def test_records_come_as_they_are_written(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER, tick(1.0)])
    following = Following(tmp_path, None, lambda: write(run, [tick(2.0), tick(3.0)]), lambda: write(run, [tick(4.0)]))
    assert following.times == {FIRST: [0.0, 1.0, 2.0, 3.0, 4.0]}
    assert not following.ended


def test_line_counts_once_its_end_is_there(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER])
    whole = write(tmp_path / "elsewhere", [tick(1.0)]) / "run.00001.jsonl"

    def append(part: bytes) -> Callable[[], None]:
        def append() -> None:
            with (run / "run.00001.jsonl").open("ab") as file:
                file.write(part)

        return append

    line = whole.read_bytes()
    assert Following(tmp_path, None, append(line[:30])).times == {FIRST: [0.0]}
    assert Following(tmp_path, None, append(line[30:50]), append(line[50:])).times == {FIRST: [0.0, 1.0]}


def test_it_follows_into_the_next_parts(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER, tick(1.0)])

    def begin_a_part() -> None:
        write(run, [tick(2.0)])  # after the reader looked
        write(run, [HEADER | {"part": 2, "t_s": 103.0}, tick(3.0)], "run.00002.jsonl")

    def begin_two() -> None:
        write(run, [tick(4.0)], "run.00003.jsonl")
        write(run, [tick(5.0)], "run.00010.jsonl")

    following = Following(tmp_path, None, begin_a_part, begin_two, lambda: write(run, [tick(6.0)], "run.00010.jsonl"))
    assert following.times == {FIRST: [0.0, 1.0, 2.0, 3.0, 3.0, 4.0, 5.0, 6.0]}


def test_part_that_was_deleted_to_make_room_is_left_for_the_newest(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER, tick(1.0)])

    def forget() -> None:
        (run / "run.00001.jsonl").unlink()
        write(run, [HEADER], "run.00002.jsonl")
        write(run, [tick(9.0)], "run.00003.jsonl")

    assert Following(tmp_path, None, forget).times == {FIRST: [0.0, 1.0, 9.0]}


def test_it_goes_on_with_the_next_run(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER, tick(1.0)])

    def restart() -> None:
        write(run, [outcome(2.0)])
        write(tmp_path / SECOND, [HEADER, tick(5.0)])

    assert Following(tmp_path, None, restart).times == {FIRST: [0.0, 1.0, 2.0], SECOND: [0.0, 5.0]}


def test_it_waits_where_there_is_no_run_yet(tmp_path: Path) -> None:
    logs = tmp_path / "not there yet"
    steps = [lambda: None, lambda: (logs / FIRST).mkdir(parents=True), lambda: write(logs / FIRST, [HEADER])]
    assert Following(logs, None, *steps).times == {FIRST: [0.0]}


def test_run_that_was_named_is_followed_to_its_end(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER])
    write(tmp_path / SECOND, [HEADER])
    following = Following(tmp_path, run, lambda: write(run, [tick(1.0), outcome(2.0)]))
    assert following.times == {FIRST: [0.0, 1.0, 2.0]}
    assert following.ended


def test_long_run_begins_with_what_runs_and_its_last_seconds(tmp_path: Path) -> None:
    records = numbered([HEADER, event("armed", 0.0), *drive(0.0, 100.0)])
    write(tmp_path / FIRST, records)
    first, *rest = Following(tmp_path, None).times[FIRST]
    assert first == 0.0
    assert 80.0 < rest[0] < 99.0
    assert rest[-1] == pytest.approx(99.95)


def test_what_is_no_record_is_skipped(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER])
    with (run / "run.00001.jsonl").open("ab") as file:
        file.write(b"\0" * 100 + b"\nno record\n\xff\xfe\n" + b"x" * 3_000_000 + b"\n")
    write(run, [tick(1.0)])
    assert Following(tmp_path, run).times == {FIRST: [0.0, 1.0]}


def test_next_part_that_is_deleted_before_it_is_opened_is_left_for_the_newest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = write(tmp_path / FIRST, [HEADER, tick(1.0)])

    def list_one_that_goes(folder: Path) -> list[Path]:
        monkeypatch.setattr(tail, "log_segments", log_segments)
        return [*log_segments(folder), run / "run.00002.jsonl"]

    def begin_two() -> None:
        write(run, [HEADER, tick(3.0)], "run.00003.jsonl")
        monkeypatch.setattr(tail, "log_segments", list_one_that_goes)

    assert Following(tmp_path, run, begin_two, lambda: None).times[FIRST] == [0.0, 1.0, 0.0, 3.0]


def test_log_that_cannot_be_opened_is_told(tmp_path: Path) -> None:
    (tmp_path / FIRST).mkdir()
    os.mkfifo(tmp_path / FIRST / "run.00001.jsonl")
    with pytest.raises(BadInput, match=r"run\.00001\.jsonl: cannot be read: it is a pipe"):
        Following(tmp_path, None)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_run_that_may_not_be_read_is_told(tmp_path: Path) -> None:
    run = write(tmp_path / FIRST, [HEADER])
    run.chmod(0)
    try:
        with pytest.raises(BadInput, match="cannot be read"):
            Following(tmp_path, run)
    finally:
        run.chmod(0o700)


def test_logs_that_cannot_be_read_are_told(tmp_path: Path) -> None:
    (tmp_path / "logs").write_text("a file")
    with pytest.raises(BadInput, match="cannot be read"):
        Following(tmp_path / "logs", None)
