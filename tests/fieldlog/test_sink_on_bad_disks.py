"""Whatever a disk does, a rover drives on, its log goes on as soon as it can, and a person is told."""

# ruff: noqa: TID251 - a real disk needs real time
from __future__ import annotations

import errno
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fieldlog.disks import FailingCall, damage, ext4_image, files_no_longer_than, mounted, small_disk
from tests.fieldlog.lines import FREE, SMALL, Log, event, header, numbers, read, tick
from wayfarer.commissioning.checks.system import card_health
from wayfarer.config.rover_file import LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog import sink
from wayfarer.fieldlog.folders import new_run_folder
from wayfarer.fieldlog.reader import Damage, log_segments
from wayfarer.fieldlog.sink import Sink

CALLS = ("open", "write", "fdatasync", "mkdir")


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Path]:
    """A disk of 512 kB."""
    with small_disk(tmp_path / "card", kb=512) as mounted:
        if not mounted:
            pytest.skip("mounting a small disk takes root")
        yield tmp_path / "card"


def threaded(folder: Path, told: Callable[[str], None] = lambda _: None) -> Sink:
    """Return the log of a rover."""
    log = Sink(folder, FREE, told, lambda: 0.0)
    log.open(header)
    return log


@pytest.mark.parametrize("number", errno.errorcode, ids=errno.errorcode.get)
@pytest.mark.parametrize("call", CALLS)
def test_whatever_fails_at_the_start_the_rover_starts_and_its_log_begins_when_it_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, number: int
) -> None:
    monkeypatch.setattr(sink, "RETRY_S", 0.001)
    monkeypatch.setattr(sink, "WRITE_S", 0.001)
    told: list[str] = []
    with monkeypatch.context() as patch:
        FailingCall(patch, call, number).failures = 1_000_000_000
        folder = new_run_folder(tmp_path / "logs", needed=False)
        log = threaded(folder, told.append)
        log.put(event(1), urgent=True)
        assert os.strerror(number) in str(log.trouble)
        assert os.strerror(number) in told[0]
    log.put(event(2), urgent=True)
    log.close()
    assert (numbers(folder), log.dropped, log.trouble) == ([1, 2], 0, None)
    assert told[1:] == ["the field log is written again; records missing: 0"]


@pytest.mark.parametrize("number", errno.errorcode, ids=errno.errorcode.get)
@pytest.mark.parametrize("call", CALLS[1:3])
def test_whatever_fails_later_is_told_and_the_log_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, number: int
) -> None:
    told: list[str] = []
    log = Sink(tmp_path, FREE, told.append)
    log.open(header)
    with monkeypatch.context() as patch:
        FailingCall(patch, call, number).failures = 1_000_000_000
        for each in range(1, 4):
            log.put(event(each), urgent=True)
            log._store(sync=True)
        assert os.strerror(number) in str(log.trouble)
    log.put(event(4), urgent=True)
    log._store(sync=True)
    log.close()
    there = numbers(tmp_path)
    assert there[-1] == 4
    assert (len(there), log.trouble) == (4, None) if call == "write" else len(there) + log.dropped >= 4
    assert told[0].endswith("the rover drives on")
    assert len(told) == 2
    assert read(tmp_path)[1].damage.lines == 0
    assert not [part for part in log_segments(tmp_path) if part.read_bytes().count(b"\n") < 2], "a part without a line"


@pytest.mark.parametrize(
    ("error", "advice"),
    [
        (errno.EROFS, "Read-only file system: mount the disk for writing"),
        (errno.EIO, "Input/output error: the card or disk is failing"),
        (errno.ENOSPC, "No space left on device: delete old runs"),
        (errno.EPERM, f"Operation not permitted: user {os.geteuid()} needs the right"),
        (errno.ENODEV, "No such device: look at the disk"),
    ],
)
def test_person_is_told_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int, advice: str) -> None:
    log = Log(tmp_path)
    FailingCall(monkeypatch, "write", error).failures = 1
    log.write(1)
    assert advice in log.told[0]
    assert not str(log.sink.trouble).endswith("drives on")
    log.write(2)
    log.sink.close()
    assert numbers(tmp_path) == [1, 2]


def test_disk_that_failed_is_asked_once_a_second_and_not_with_every_event(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sink, "RETRY_S", 20.0)
    writing = FailingCall(monkeypatch, "write")
    writing.failures = 1_000_000
    log = threaded(tmp_path)
    for number in range(1, 31):
        log.put(event(number), urgent=True)
        time.sleep(0.005)
    assert 1_000_000 - writing.failures == 1
    writing.failures = 0
    log.close()
    assert numbers(tmp_path) == list(range(1, 31))


@settings(max_examples=40)
@given(more=st.integers(0, 1500), batch=st.integers(1, 12))
def test_disk_that_is_full_at_any_byte_costs_no_record_and_half_a_line_at_most(
    tmp_path_factory: pytest.TempPathFactory, more: int, batch: int
) -> None:
    log = Log(tmp_path_factory.mktemp("run"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sink.Parts, "_begin", lambda _: FailingCall.fail(errno.ENOSPC))  # no room for another header
        with files_no_longer_than(len(header(1)) + 1 + more):
            for number in range(1, 31):
                log.put(number)
                if number % batch == 0:
                    log.sink._store(sync=True)
            log.sink._store(sync=True)
            ends = accumulate(len(tick(number)) + 1 for number in range(1, 31))
            assert len(numbers(log.folder)) == sum(end - 1 <= more for end in ends)  # the last one may lack its end
        log.write(31)
    log.sink.close()
    found, its = read(log.folder)
    assert [record.n for record in found if record.n] == list(range(1, 32))
    assert (its.damage.lines <= 1, its.damage.missing, log.sink.dropped) == (True, 0, 0)
    assert len(log.told) in {0, 2}


def test_disk_that_takes_no_header_leaves_nothing_behind(tmp_path: Path) -> None:
    with files_no_longer_than(10), pytest.raises(BadInput, match="cannot be written: No space left on device"):
        Log(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_trouble_that_comes_again_is_told_again_with_what_is_missing_since(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Log(tmp_path)
    syncing = FailingCall(monkeypatch, "fdatasync")
    for round_ in range(2):
        log.write(*range(10 * round_ + 1, 10 * round_ + 4))
        syncing.failures = 1
        log.sink._store(sync=True)
        log.sink._store(sync=True)
    assert log.told == [log.told[0], "the field log is written again; records missing: 3"] * 2
    log.sink.close()


def test_full_queue_hides_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    log = Sink(tmp_path, FREE, told.append, lambda: 0.0, 100)
    log.open(header)
    FailingCall(monkeypatch, "write").failures = 1_000_000
    log.put(event(1), urgent=True)
    ends_s = time.monotonic() + 20.0
    while log.trouble is None and time.monotonic() < ends_s:
        time.sleep(0.001)
    for number in range(2, 10):
        log.put(tick(number))
    assert log.dropped > 0
    assert "Input/output error" in str(log.trouble)
    log.close()


def test_nearly_full_disk_takes_no_ticks_but_events(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log(tmp_path, LogSettings(part_mb=1.0, free_mb=40.0))
    for number, free_mb in enumerate([50.0, 39.0, 39.0, 41.0, 45.0, 50.0], start=1):
        monkeypatch.setattr(sink.Parts, "free_mb", lambda _, mb=free_mb: mb)
        log.sink._store(sync=True)
        log.put(2 * number)
        log.write(2 * number + 1)
    log.sink.close()
    assert numbers(tmp_path) == [2, 3, 5, 7, 9, 10, 11, 12, 13], "41 MB are too near to 40 to begin again"
    assert log.sink.dropped == 3
    assert log.told == [
        f"{tmp_path}: the field log records only events and positions: less than 40 MB are free: delete old runs; "
        "the rover drives on",
        "the field log is written again; records missing: 3",
    ]


@pytest.mark.parametrize("gone", ["file", "folder", "logs"])
def test_what_somebody_deleted_is_made_again_and_what_was_lost_is_counted(tmp_path: Path, gone: str) -> None:
    log = Log(tmp_path / "logs" / "run")
    log.write(1)
    log.sink._store(sync=True)
    log.write(2, 3)
    {
        "file": lambda: (log.folder / "run.00001.jsonl").unlink(),
        "folder": lambda: shutil.rmtree(log.folder),
        "logs": lambda: shutil.rmtree(tmp_path / "logs"),
    }[gone]()
    log.sink._store(sync=True)
    assert "No such file or directory: was it deleted" in log.told[0]
    log.write(*range(4, 8))  # the first two tries may still find what is gone
    log.sink.close()
    assert (numbers(log.folder), log.sink.dropped) == ([4, 5, 6, 7], 2)
    assert read(log.folder)[1].damage == Damage(missing=3)


def test_file_that_takes_no_more_is_left_for_a_new_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log(tmp_path)
    log.write(1)
    broken, real = (tmp_path / "run.00001.jsonl").stat().st_ino, os.write

    def write(file: int, data: bytes) -> int:
        if os.fstat(file).st_ino == broken:
            FailingCall.fail(errno.EIO)
        return real(file, data)

    monkeypatch.setattr(os, "write", write)
    log.write(2, 3)
    log.sink.close()
    assert (numbers(tmp_path), log.parts(), log.sink.dropped) == ([1, 2, 3], [1, 2], 0)


def test_file_that_somebody_puts_in_the_place_of_an_empty_part_stays(tmp_path: Path) -> None:
    log = Log(tmp_path)
    (tmp_path / "run.00001.jsonl").unlink()
    (tmp_path / "run.00001.jsonl").write_bytes(b"precious")
    log.sink._store(sync=True)
    log.write(1)
    log.sink.close()
    assert (tmp_path / "run.00001.jsonl").read_bytes() == b"precious"
    assert log.parts() == [1, 2]


def test_part_that_cannot_be_made_is_no_trouble_while_the_one_before_takes_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Log(tmp_path, SMALL)
    opening = FailingCall(monkeypatch, "open", errno.ENFILE)
    opening.failures = 15
    log.write(*range(1, 51))
    log.sink.close()
    assert (numbers(tmp_path), log.sink.dropped, log.told, opening.failures) == (list(range(1, 51)), 0, [], 0)
    assert log_segments(tmp_path)[0].stat().st_size > 1000


@pytest.mark.parametrize("call", CALLS[1:3])
def test_disk_that_fails_for_long_leaves_no_trail_of_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    log = Log(tmp_path)
    log.write(1)
    header_bytes, real = len(header(1)), getattr(os, call)

    def fails(file: int, *data: bytes) -> object:
        """Take headers only."""
        if call == "write" and not data[0].startswith(b'{"record":"run"'):
            FailingCall.fail(errno.EIO)
        if call == "fdatasync" and os.fstat(file).st_size > header_bytes + 10:
            FailingCall.fail(errno.EIO)
        return real(file, *data)

    with monkeypatch.context() as patch:
        patch.setattr(os, call, fails)
        for _ in range(20):
            log.write(2)
            log.sink._store(sync=True)
    if call == "write":
        assert len(log.parts()) <= 2
    log.write(3)
    log.sink.close()
    assert not [part for part in log_segments(tmp_path) if part.read_bytes().count(b"\n") < 2], "a part without a line"


@pytest.mark.process
def test_real_disk_runs_full_and_is_freed(small: Path) -> None:
    log = Log(small / "logs" / "run", LogSettings(part_mb=0.05, free_mb=0.0))
    ballast = small / "ballast"
    ballast.write_bytes(bytes(350_000))
    log.put(*range(1, 2001))
    log.sink._store(sync=True)
    assert "No space left on device: delete old runs" in str(log.sink.trouble)
    assert 500 < len(numbers(log.folder)) < 1500
    ballast.unlink()
    log.put(*range(2001, 2101))
    log.sink.close()
    found, its = read(log.folder)
    assert [record.n for record in found if record.n] == list(range(1, 2101))
    assert its.damage.lines <= 1
    assert (log.sink.dropped, log.sink.trouble, len(log.told)) == (0, None, 2)


@pytest.mark.process
def test_read_only_disk_lets_a_rover_start_and_a_trial_say_so(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sink, "RETRY_S", 0.01)
    (small / "logs").mkdir()
    subprocess.run(["mount", "-o", "remount,ro", str(small)], check=True)
    with pytest.raises(BadInput, match="cannot be written: Read-only file system: mount the disk for writing"):
        Log(small / "logs" / "run")
    with pytest.raises(BadInput, match="no folder can be made for the field log: Read-only file system"):
        new_run_folder(small / "logs")
    assert card_health(small / "logs").disk_read_only
    log = threaded(new_run_folder(small / "logs", needed=False))
    log.put(event(1), urgent=True)
    assert "Read-only file system" in str(log.trouble)
    subprocess.run(["mount", "-o", "remount,rw", str(small)], check=True)
    log.put(event(2), urgent=True)
    log.close()
    (run,) = (small / "logs").iterdir()
    assert (numbers(run), log.dropped) == ([1, 2], 0)
    assert card_health(small / "logs").disk_memory == "tmpfs"


@pytest.mark.process
def test_corrupt_file_system_lets_a_rover_start(tmp_path: Path) -> None:
    """Where the names of its folder should be is garbage: looking into it is an error that nobody thinks of."""
    image, told = ext4_image(tmp_path / "image"), list[str]()
    with mounted(image, tmp_path / "card") as mounts:
        if not mounts:
            pytest.skip("mounting an image takes root and a loop device")
        (tmp_path / "card" / "logs").mkdir()
    damage(image, "/logs")
    with mounted(image, tmp_path / "card"):
        log = threaded(new_run_folder(tmp_path / "card" / "logs", needed=False), told.append)
        log.put(event(1), urgent=True)
        log.close()
    assert (log.dropped, log.trouble is None) == (1, False)
    assert "cannot be written" in told[0]


@pytest.mark.process
def test_frozen_file_system_holds_nobody_up_and_costs_no_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sink, "SILENT_S", 0.1)
    monkeypatch.setattr(sink, "CLOSE_S", 20.0)
    with mounted(ext4_image(tmp_path / "image"), tmp_path / "card") as mounts:
        if not mounts:
            pytest.skip("mounting an image takes root and a loop device")
        log = Sink(tmp_path / "card" / "run", FREE, clock=time.monotonic)
        log.open(header)
        subprocess.run(["fsfreeze", "-f", tmp_path / "card"], check=True)
        number, ends_s = 0, time.monotonic() + 20.0
        try:
            while log.trouble is None and time.monotonic() < ends_s:
                log.put(event(number := number + 1), urgent=True)
                time.sleep(0.01)
        finally:
            subprocess.run(["fsfreeze", "-u", tmp_path / "card"], check=True)
        log.close()
        assert numbers(tmp_path / "card" / "run") == list(range(1, number + 1))
        assert (log.dropped, log.trouble) == (0, None)
