"""A run's lines are in its files, in their order, in parts that can be read alone; nobody waits for a disk."""

from __future__ import annotations

import fcntl
import os
import threading
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fieldlog.disks import FailingCall
from tests.fieldlog.lines import FREE, SMALL, Log, event, header, numbers, read, tick
from wayfarer.config.rover_file import LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog import sink
from wayfarer.fieldlog.reader import Damage, find_header, log_segments
from wayfarer.fieldlog.record import Header
from wayfarer.fieldlog.sink import BATCH, QUEUE_BYTES, URGENT_BYTES, Sink
from wayfarer.waiting_thread import OneCall

PATIENCE_S = 20.0


class Disk:
    """Stands between a log and its disk: counts the syncs, and answers only while it is ``well``."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.well = threading.Event()
        self.well.set()
        self.asked = threading.Semaphore(0)
        self.synced = threading.Semaphore(0)
        self._sync = os.fdatasync
        monkeypatch.setattr(os, "fdatasync", self)

    def __call__(self, file: int) -> None:
        """Sync, when the disk answers."""
        self.asked.release()
        assert self.well.wait(PATIENCE_S)
        self._sync(file)
        self.synced.release()


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


class Rover:
    """A log that a thread writes, what a person was told of it, and its clock."""

    def __init__(self, folder: Path, queue_bytes: int = QUEUE_BYTES) -> None:
        self.told: list[str] = []
        self.folder = folder
        self.now_s = 0.0
        self.sink = Sink(folder, FREE, self.told.append, lambda: self.now_s, queue_bytes)

    def begin(self) -> Rover:
        """Begin the log."""
        self.sink.open(header)
        return self

    def begin_and_hang(self, disk: Disk) -> Rover:
        """Begin the log on a disk that does not answer any more after the first event."""
        self.begin()
        disk.well.clear()
        while disk.asked.acquire(blocking=False):
            pass
        self.sink.put(event(1), urgent=True)
        assert disk.asked.acquire(timeout=PATIENCE_S)
        return self


# -- the files -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("clock", [None, time.thread_time])
def test_lines_are_written_in_order_and_closing_writes_the_rest(tmp_path: Path, clock: None) -> None:
    written = Sink(tmp_path / "logs" / "run", clock=clock)
    written.open(header)
    for number in range(1, 2001):
        written.put(tick(number), urgent=number % 300 == 0)
    written.close()
    written.close()
    found, its = read(tmp_path / "logs" / "run")
    assert [record.n for record in found] == [0, *range(1, 2001)]
    assert (its.damage, written.dropped, written.trouble) == (Damage(), 0, None)


def test_without_a_thread_an_event_is_written_at_once_and_ticks_by_the_batch(tmp_path: Path) -> None:
    log = Log(tmp_path)
    log.put(*range(1, BATCH))
    assert numbers(tmp_path) == []
    log.put(BATCH)
    assert numbers(tmp_path) == list(range(1, BATCH + 1))
    log.put(BATCH + 1)
    log.write(BATCH + 2)
    assert numbers(tmp_path)[-2:] == [BATCH + 1, BATCH + 2]
    log.sink.close()


def test_log_of_a_trial_is_never_written_over_and_no_trial_begins_without_one(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").write_bytes(b"precious")
    with pytest.raises(BadInput, match="File exists: log into a separate folder"):
        Log(tmp_path)
    with pytest.raises(BadInput, match="Not a directory: a file is in the place of the folder"):
        Log(tmp_path / "run.00001.jsonl" / "run")
    assert (tmp_path / "run.00001.jsonl").read_bytes() == b"precious"


def test_what_comes_after_closing_is_dropped(tmp_path: Path) -> None:
    log = Log(tmp_path)
    log.sink.close()
    log.write(1)
    log.put(2)
    log.sink.close()
    assert (log.sink.dropped, numbers(tmp_path), log.parts()) == (2, [], [1])


@settings(max_examples=30)
@given(batches=st.lists(st.integers(1, 40), min_size=1, max_size=12))
def test_parts_lose_nothing_and_begin_with_the_header_and_none_is_empty(
    tmp_path_factory: pytest.TempPathFactory, batches: list[int]
) -> None:
    log, number = Log(tmp_path_factory.mktemp("run"), SMALL), 0
    for batch in batches:
        log.put(*range(number + 1, number + batch))
        log.write(number + batch)
        number += batch
    log.sink.close()
    found, its = read(log.folder)
    assert [record.n for record in found if record.n] == list(range(1, number + 1))
    assert [record.part for record in found if isinstance(record, Header)] == log.parts()
    assert log.parts() == list(range(1, len(log.parts()) + 1))
    assert its.damage == Damage()
    assert all(part.read_bytes().count(b"\n") > 1 for part in log_segments(log.folder)[:-1])


def test_part_is_never_larger_than_its_limit_nor_renamed(tmp_path: Path) -> None:
    log = Log(tmp_path, SMALL)
    files: dict[str, int] = {}
    for number in range(1, 101):
        log.write(number)
        there = {part.name: part.stat().st_ino for part in log_segments(tmp_path)}
        assert files.items() <= there.items()
        files = there
    log.sink.close()
    assert len(files) > 8
    assert all(500 < part.stat().st_size <= 1000 for part in log_segments(tmp_path)[:-1])


def test_run_beyond_its_limit_keeps_its_first_part_and_the_newest(tmp_path: Path) -> None:
    log = Log(tmp_path, LogSettings(part_mb=0.001, run_mb=0.005, free_mb=0.0))
    (tmp_path / "keep").touch()
    for number in range(1, 301):
        log.write(number)
        assert sum(part.stat().st_size for part in log_segments(tmp_path)) <= 5000
    log.sink.close()
    first, *newest = log.parts()
    assert (first, newest) == (1, list(range(newest[0], newest[-1] + 1)))
    kept = numbers(tmp_path)
    assert (kept[0], kept[-25:]) == (1, list(range(276, 301)))
    assert (found := find_header(tmp_path)) is not None
    assert found.part == 1
    assert read(tmp_path)[1].damage == Damage(missing=300 - len(kept))
    assert log.sink.dropped == 0, "what was deleted on purpose was not dropped"
    assert (tmp_path / "keep").exists()


def test_file_of_somebody_else_is_neither_written_over_nor_deleted_nor_followed(tmp_path: Path) -> None:
    log = Log(tmp_path / "run", SMALL)
    (tmp_path / "passwd").write_bytes(b"precious")
    (log.folder / "run.00002.jsonl").write_bytes(b"precious")
    (log.folder / "run.00003.jsonl").symlink_to(tmp_path / "passwd")
    (log.folder / "run.00004.jsonl").symlink_to(tmp_path / "nothing")
    log.write(*range(1, 31))
    log.sink.close()
    assert (tmp_path / "passwd").read_bytes() == (log.folder / "run.00002.jsonl").read_bytes() == b"precious"
    assert not (tmp_path / "nothing").exists()
    own = [part for part in log_segments(log.folder) if not part.is_symlink() and part.name != "run.00002.jsonl"]
    assert [part.name for part in own[:2]] == ["run.00001.jsonl", "run.00005.jsonl"]
    assert sum(part.read_bytes().count(b'"event"') for part in own) == 30
    assert log.sink.dropped == 0


def test_what_stands_in_a_part_is_on_the_disk_before_the_next_begins_and_when_the_log_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, synced = os.fdatasync, dict[int, int]()

    def sync(file: int) -> None:
        real(file)
        its = os.fstat(file)
        synced[its.st_ino] = its.st_size

    def on_disk() -> list[bool]:
        files = [part.stat() for part in log_segments(tmp_path)]
        return [synced.get(its.st_ino) == its.st_size for its in files]

    monkeypatch.setattr(os, "fdatasync", sync)
    log = Log(tmp_path, SMALL)
    assert on_disk() == [True], "its header"
    for number in range(1, 31):
        log.write(number)
        assert all(on_disk()[:-1])
    log.sink.close()
    assert all(on_disk())


def test_thread_has_everything_on_the_disk_when_the_log_is_closed(tmp_path: Path, disk: Disk) -> None:
    rover = Rover(tmp_path).begin()
    while disk.synced.acquire(blocking=False):
        pass
    rover.sink.put(tick(1))
    rover.sink.close()
    assert disk.synced.acquire(blocking=False)
    assert numbers(tmp_path) == [1]


def test_folder_is_held_whatever_becomes_of_its_name(tmp_path: Path) -> None:
    """A user whose folder is around it may swap it: no line goes elsewhere."""
    log = Log(tmp_path / "run", SMALL)
    log.write(*range(1, 10))
    log.folder.rename(tmp_path / "moved")
    (tmp_path / "etc").mkdir()
    log.folder.symlink_to(tmp_path / "etc")
    log.write(*range(10, 31))
    log.sink.close()
    assert numbers(tmp_path / "moved") == list(range(1, 31))
    assert list((tmp_path / "etc").iterdir()) == []


def test_symlink_that_somebody_puts_on_the_way_later_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "logs").symlink_to(tmp_path / "disk")
    log = Log(tmp_path / "logs" / "run")
    log.write(1)
    assert numbers(tmp_path / "disk" / "run") == [1], "a person's own symlink"
    (tmp_path / "etc").mkdir()
    (tmp_path / "disk").rename(tmp_path / "moved")
    (tmp_path / "disk").symlink_to(tmp_path / "etc")
    with monkeypatch.context() as patch:
        FailingCall(patch, "write").failures = 10
        log.write(2)
        log.sink._parts.close()  # as after a disk that failed
    log.write(3)
    assert list((tmp_path / "etc").iterdir()) == []
    assert log.sink.trouble is not None
    log.sink.close()


def test_folder_that_is_a_symlink_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "etc").mkdir()
    (tmp_path / "run").symlink_to(tmp_path / "etc")
    rover = Rover(tmp_path / "run").begin()
    rover.sink.close()
    assert list((tmp_path / "etc").iterdir()) == []
    assert rover.sink.trouble is not None


def test_file_system_without_locks_costs_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def flock(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", flock)
    log = Log(tmp_path)
    log.write(1)
    log.sink.close()
    assert (numbers(tmp_path), log.sink.trouble) == ([1], None)
    (warning,) = log.told
    assert "no lock keeps other programs from deleting this run" in warning


# -- the thread ------------------------------------------------------------------------------------------------------


def test_event_is_on_the_disk_without_waiting_for_the_next_write(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sink, "WRITE_S", PATIENCE_S)
    rover = Rover(tmp_path).begin()
    while disk.synced.acquire(blocking=False):
        pass
    rover.sink.put(tick(1))
    rover.sink.put(event(2), urgent=True)
    assert disk.synced.acquire(timeout=PATIENCE_S / 2)
    assert numbers(tmp_path) == [1, 2]
    rover.sink.close()


def test_ticks_are_on_the_disk_after_a_few_writes(tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sink, "WRITE_S", 0.001)
    rover = Rover(tmp_path).begin()
    while disk.synced.acquire(blocking=False):
        pass
    rover.sink.put(tick(1))
    for _ in range(2):  # the line may come in the midst of the first
        assert disk.synced.acquire(timeout=PATIENCE_S)
    assert numbers(tmp_path) == [1]
    rover.sink.close()


def test_disk_that_hangs_holds_nobody_up_and_costs_no_line(tmp_path: Path, disk: Disk) -> None:
    rover = Rover(tmp_path).begin_and_hang(disk)
    for number in range(2, 3001):  # would never return if it waited
        rover.sink.put(tick(number))
    rover.sink.put(event(3001), urgent=True)
    disk.well.set()
    rover.sink.close()
    assert numbers(tmp_path) == list(range(1, 3002))
    assert (rover.sink.dropped, rover.told) == (0, [])


def test_disk_that_hangs_is_told_after_some_seconds_and_once(tmp_path: Path, disk: Disk) -> None:
    rover = Rover(tmp_path).begin_and_hang(disk)
    rover.now_s += 4.9
    rover.sink.put(tick(2))
    assert rover.sink.trouble is None
    rover.now_s += 0.2
    for number in (3, 4):
        rover.sink.put(tick(number))
    assert rover.told == ["the field log cannot be written: the disk does not answer (see dmesg); the rover drives on"]
    assert rover.sink.trouble == "the field log cannot be written: the disk does not answer (see dmesg)"
    disk.well.set()
    rover.sink.close()
    assert rover.told[1:] == ["the field log is written again; records missing: 0"]
    assert rover.sink.take_slowest_sync_s() == pytest.approx(5.1)


def test_disk_that_hangs_from_the_start_lets_the_rover_start(tmp_path: Path, disk: Disk) -> None:
    disk.well.clear()
    rover = Rover(tmp_path)
    opening = OneCall(rover.begin)
    opening.start()
    opening.join(PATIENCE_S)
    assert opening.is_over
    rover.sink.put(event(1), urgent=True)
    disk.well.set()
    rover.sink.close()
    assert numbers(tmp_path) == [1]


def test_full_queue_drops_ticks_first_and_the_jump_of_their_numbers_says_where(tmp_path: Path, disk: Disk) -> None:
    rover = Rover(tmp_path, 20 * len(tick(10))).begin_and_hang(disk)
    for number in range(2, 101):
        rover.sink.put(tick(number))
    for number in (101, 102):
        rover.sink.put(event(number), urgent=True)
    assert rover.sink.dropped == 100 - 21 + 1
    assert len(rover.told) == 1
    disk.well.set()
    rover.sink.close()
    assert numbers(tmp_path) == [*range(1, 21), 101, 102]
    assert read(tmp_path)[1].damage == Damage(missing=80)
    assert rover.told[1:] == ["the field log is written again; records missing: 80"]


def test_even_events_cannot_fill_the_memory(tmp_path: Path, disk: Disk) -> None:
    rover = Rover(tmp_path, 0).begin_and_hang(disk)
    line = event(1)[:-1] + b', "text": "' + b"x" * 100_000 + b'"}'
    for _ in range(100):
        rover.sink.put(line, urgent=True)
    assert rover.sink.dropped == 100 - (URGENT_BYTES - len(event(1))) // len(line)
    disk.well.set()
    rover.sink.close()


def test_queue_has_room_again_for_what_was_written(tmp_path: Path, disk: Disk) -> None:
    rover = Rover(tmp_path, 0).begin()
    line = event(1)[:-1] + b', "text": "' + b"x" * (URGENT_BYTES // 3) + b'"}'
    for _ in range(20):
        while disk.synced.acquire(blocking=False):
            pass
        rover.sink.put(line, urgent=True)
        assert disk.synced.acquire(timeout=PATIENCE_S)
    rover.sink.close()
    assert rover.sink.dropped == 0


def test_closing_leaves_a_disk_that_does_not_answer_and_says_what_is_missing(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sink, "CLOSE_S", 0.01)
    rover = Rover(tmp_path).begin_and_hang(disk)
    for number in range(2, 32):
        rover.sink.put(tick(number))
    rover.sink.close()
    assert rover.sink.dropped == 30
    assert rover.told == ["the end of the field log could not be written: its last 30 records may be missing"]
    rover.sink.put(event(32), urgent=True)
    assert rover.sink.dropped == 31
    disk.well.set()
    rover.sink._join(PATIENCE_S)
    assert len(rover.told) == 1, "what the disk took after all is no trouble"


def test_error_inside_wayfarer_ends_no_log(tmp_path: Path) -> None:
    broken = True

    def first_line(part: int) -> bytes:
        if broken:
            raise TypeError("a bug")
        return header(part)

    rover = Rover(tmp_path)
    rover.sink.open(first_line)
    assert "a bug" in str(rover.sink.trouble)
    rover.sink.put(event(1), urgent=True)
    broken = False
    rover.sink.close()
    assert (numbers(tmp_path), rover.sink.dropped) == ([1], 0)
    assert find_header(tmp_path) is not None
