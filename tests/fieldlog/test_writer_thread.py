"""Whoever tells the log something never waits for the disk."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.children import child
from tests.fieldlog.lines import event, gaps, numbers, read, run_record, tick, write
from wayfarer.errors import BadInput
from wayfarer.fieldlog import writer_thread
from wayfarer.fieldlog.reader import read_header
from wayfarer.fieldlog.writer import RunFiles
from wayfarer.fieldlog.writer_thread import QUEUE_BYTES, URGENT_BYTES, WriterThread

PATIENCE_S = 20.0


class StallingFiles(RunFiles):
    """Files on a disk that answers as often as ``answers`` is released; ``asked`` is, each time the thread waits."""

    def __init__(self, folder: Path, tell: Callable[[str], None] = lambda _: None) -> None:
        super().__init__(folder, tell=tell)
        self.folder = folder
        self.answers = threading.Semaphore(0)
        self.asked = threading.Semaphore(0)

    def flush(self) -> None:
        """Write, when the disk answers."""
        self.asked.release()
        assert self.answers.acquire(timeout=PATIENCE_S)
        super().flush()

    def wakes(self) -> None:
        """Answer from now on."""
        self.answers.release(10_000)


class WatchedFiles(RunFiles):
    """Files that release ``synced`` each time when the disk has everything."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.synced = threading.Semaphore(0)

    def sync(self) -> None:
        """Sync, and say so."""
        super().sync()
        self.synced.release()


@pytest.fixture
def told() -> list[str]:
    """What a person was told."""
    return []


@pytest.fixture
def stalled(tmp_path: Path, told: list[str]) -> Iterator[StallingFiles]:
    """Files whose disk does not answer until a test lets it."""
    files = StallingFiles(tmp_path / "run", told.append)
    yield files
    files.wakes()


def begun(stalled: StallingFiles, queue_bytes: int = QUEUE_BYTES) -> WriterThread:
    """A log whose thread waits for the disk with its first line."""
    log = WriterThread(stalled, queue_bytes)
    log.open(run_record)
    log.urgent(event(1))
    assert stalled.asked.acquire(timeout=PATIENCE_S)
    return log


def test_lines_arrive_in_order_from_any_thread_and_closing_waits_for_them(tmp_path: Path) -> None:
    log = WriterThread(RunFiles(tmp_path))
    log.open(run_record)
    for number in range(1, 2001):
        (log.urgent if number % 500 == 0 else log.bulk)(tick(number))
    log.close()
    log.close()
    assert numbers(tmp_path) == list(range(1, 2001))
    assert log.dropped == 0


def test_urgent_line_is_on_the_disk_without_waiting_for_the_next_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer_thread, "WRITE_S", PATIENCE_S)
    files = WatchedFiles(tmp_path)
    log = WriterThread(files)
    log.open(run_record)
    log.bulk(tick(1))
    log.urgent(event(2))
    assert files.synced.acquire(timeout=PATIENCE_S / 2)
    assert numbers(tmp_path) == [1, 2]
    log.close()


def test_other_lines_are_on_the_disk_after_a_few_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writer_thread, "WRITE_S", 0.001)
    files = WatchedFiles(tmp_path)
    log = WriterThread(files)
    log.open(run_record)
    log.bulk(tick(1))
    for _ in range(2):  # the line may come in the midst of the first
        assert files.synced.acquire(timeout=PATIENCE_S)
    assert numbers(tmp_path) == [1]
    log.close()


def test_queue_has_room_again_for_what_was_written(tmp_path: Path) -> None:
    written = threading.Semaphore(0)

    class Watched(RunFiles):
        def urgent(self, line: bytes) -> None:
            super().urgent(line)
            written.release()

    log = WriterThread(Watched(tmp_path), queue_bytes=0)
    log.open(run_record)
    line = event(1)[:-1] + b', "text": "' + b"x" * (URGENT_BYTES // 3) + b'"}'
    for _ in range(20):
        log.urgent(line)
        assert written.acquire(timeout=PATIENCE_S)
    log.close()
    assert log.dropped == 0


def test_log_that_cannot_begin_is_bad_input_at_once(tmp_path: Path) -> None:
    (tmp_path / "run").write_bytes(b"")
    log = WriterThread(RunFiles(tmp_path / "run"))
    with pytest.raises(BadInput, match="cannot be written"):
        log.open(run_record)
    log.close()


def test_disk_that_stalls_holds_up_no_caller_and_costs_no_line(stalled: StallingFiles, told: list[str]) -> None:
    log = begun(stalled)
    write(log, range(2, 3001))  # would never return if it waited
    log.urgent(event(3001))
    assert numbers(stalled.folder) == []
    stalled.wakes()
    log.close()
    assert numbers(stalled.folder) == list(range(1, 3002))
    assert (log.dropped, told) == (0, [])


def test_full_queue_keeps_urgent_lines_and_the_log_says_what_is_missing_and_where(
    stalled: StallingFiles, told: list[str]
) -> None:
    log = begun(stalled, 20 * len(tick(10)))
    write(log, range(2, 101))
    for number in (101, 102):
        log.urgent(event(number))
    assert log.dropped == 80
    assert told == ["the field log cannot be written: the disk does not answer (see dmesg); the rover drives on"]
    stalled.wakes()
    log.close()
    assert numbers(stalled.folder) == [*range(1, 21), 101, 102]
    assert gaps(stalled.folder) == [80]
    assert log.dropped == read(stalled.folder)[1].damage.missing == 80
    assert told[1:] == ["the field log is written again; records missing: 80"]


def test_queue_that_stays_full_is_told_once_though_the_disk_answers_now_and_then(
    stalled: StallingFiles, told: list[str]
) -> None:
    log = begun(stalled, 20 * len(tick(10)))
    write(log, range(2, 101))
    log.urgent(event(101))
    stalled.answers.release(2)  # for the first line, and for the end of its batch
    for _ in range(2):
        assert stalled.asked.acquire(timeout=PATIENCE_S)
    log.bulk(tick(102))
    assert len(told) == 1
    stalled.wakes()
    log.close()
    assert log.dropped == 81
    assert told[1:] == ["the field log is written again; records missing: 81"]


def test_even_urgent_lines_cannot_fill_the_memory(stalled: StallingFiles) -> None:
    log = WriterThread(stalled, queue_bytes=0)
    log.open(run_record)
    line = event(1)[:-1] + b', "text": "' + b"x" * 100_000 + b'"}'
    for _ in range(100):
        log.urgent(line)
    assert log.dropped == 100 - URGENT_BYTES // len(line)
    stalled.wakes()
    log.close()


def test_closing_leaves_a_disk_that_does_not_answer_and_says_what_is_missing(
    stalled: StallingFiles, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer_thread, "CLOSE_S", 0.01)
    log = WriterThread(stalled)
    log.open(run_record)
    write(log, range(1, 31))
    log.close()
    assert log.dropped == 30
    assert told == ["the disk did not take the end of the field log: its last 30 records may be missing"]
    log.urgent(event(31))
    assert log.dropped == 31


def test_error_in_writing_costs_a_batch_and_not_the_log(tmp_path: Path) -> None:
    class Buggy(RunFiles):
        def urgent(self, line: bytes) -> None:
            raise TypeError("a bug")

    log = WriterThread(Buggy(tmp_path))
    log.open(run_record)
    log.urgent(event(1))
    thread_of_it = log._thread
    assert thread_of_it is not None
    log.bulk(tick(2))
    log.close()
    assert not thread_of_it.is_alive()
    assert log.dropped == 2 - len(numbers(tmp_path))
    assert log.dropped >= 1


# Writes a line on a disk that never answers, and ends.
HANGS = """
import sys, threading
from pathlib import Path
from tests.fieldlog.lines import event, run_record
from wayfarer.fieldlog import writer_thread
from wayfarer.fieldlog.writer import RunFiles
class HangingFiles(RunFiles):
    def flush(self):
        threading.Event().wait()
writer_thread.CLOSE_S = 0.1
log = writer_thread.WriterThread(HangingFiles(Path(sys.argv[1])))
log.open(run_record)
log.urgent(event(1))
log.close()
"""


@pytest.mark.process
def test_process_ends_though_its_disk_never_answers(tmp_path: Path) -> None:
    with child([sys.executable, "-c", HANGS, str(tmp_path)]) as process:
        assert process.wait(PATIENCE_S) == 0
    assert read_header(tmp_path)["part"] == 1
