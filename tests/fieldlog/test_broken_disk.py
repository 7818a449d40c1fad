"""Whatever is taken away or breaks under a log, it goes on as soon as it can, and says what is missing."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fieldlog.disks import FailingCall, files_no_longer_than, power_cut_at
from tests.fieldlog.lines import FREE, SMALL, Log, event, gaps, numbers, read, run_record, tick, torn_lines, write
from wayfarer.config.rover_file import LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog.disk import DiskTrouble
from wayfarer.fieldlog.folders import new_run_folder
from wayfarer.fieldlog.reader import log_segments, read_header
from wayfarer.fieldlog.writer import RunFiles


def test_deleted_folder_is_made_again_and_what_was_lost_is_counted(tmp_path: Path) -> None:
    log = Log(tmp_path / "run")
    log.files.urgent(event(1))
    write(log.files, range(2, 5))
    log.files.flush()
    shutil.rmtree(log.folder)
    write(log.files, range(5, 8))
    log.files.sync()
    write(log.files, range(8, 10))
    log.files.flush()
    assert numbers(log.folder) == [8, 9], "it does not wait for another second"
    log.files.close()
    found, its = read(log.folder)
    assert [record.get("n", record.get("name", record.get("part"))) for record in found] == [2, "log_gap", 8, 9]
    assert gaps(log.folder) == [6], "what was not synced when the folder went"
    assert its.damage.missing == 7
    assert log.files.dropped == 6
    assert "No such file or directory: was it deleted" in log.told[0]
    assert len(log.told) == 2


def test_renamed_folder_keeps_what_it_has_and_the_log_goes_on_in_a_new_one(tmp_path: Path) -> None:
    log = Log(tmp_path / "run")
    write(log.files, range(1, 4))
    log.files.sync()
    log.folder.rename(tmp_path / "moved")
    write(log.files, range(4, 6))
    log.files.sync()
    write(log.files, range(6, 8))
    log.files.close()
    assert numbers(tmp_path / "moved") == [1, 2, 3, 4, 5]
    assert numbers(log.folder) == [6, 7]
    assert read_header(log.folder)["part"] == 2


@pytest.mark.parametrize(("editor", "there"), [("replaces", [1, 2, 3]), ("appends", [1, 3])])
def test_file_that_another_program_changed_is_noticed_and_a_new_one_begun(
    tmp_path: Path, editor: str, there: list[int]
) -> None:
    """A copy in its place has the same length; what was appended leaves its line open, and the next one is lost."""
    log = Log(tmp_path)
    log.files.urgent(event(1))
    if editor == "replaces":
        shutil.copy(tmp_path / "run.jsonl", tmp_path / "saved")
        (tmp_path / "saved").rename(tmp_path / "run.jsonl")
        log.files.sync()
    else:
        with (tmp_path / "run.jsonl").open("ab") as other:
            other.write(b"an editor was here")
    log.files.urgent(event(2))
    log.files.urgent(event(3))
    log.files.close()
    assert (numbers(tmp_path), log.files.dropped) == (there, 3 - len(there))
    assert log.parts() == ["run.00001.jsonl", "run.jsonl"]
    assert "File was changed by another program: a new one is begun" in log.told[0]


def test_logs_folder_that_vanishes_for_a_while_is_tried_again(tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    log = Log(logs / "run")
    log.files.urgent(event(1))
    shutil.rmtree(logs)
    logs.write_bytes(b"in the way")
    for number in range(2, 6):
        log.files.urgent(event(number))
    logs.unlink()
    log.files.urgent(event(6))
    log.files.close()
    assert numbers(log.folder) == [6]
    assert gaps(log.folder) == [4]


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
def test_disk_that_fails_to_write_is_told_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int, advice: str
) -> None:
    log = Log(tmp_path)
    writing = FailingCall(monkeypatch, "write", error)
    log.files.urgent(event(1))
    writing.failures = 2
    for number in range(2, 6):
        log.files.urgent(event(number))
    log.files.close()
    assert (numbers(tmp_path), gaps(tmp_path)) == ([1, 4, 5], [2])
    assert advice in log.told[0]
    assert log.told[1:] == ["the field log is written again; records missing: 2"]


@pytest.mark.parametrize("error", [errno.EROFS, errno.ENOSPC, errno.EIO])
def test_log_that_is_not_needed_begins_when_the_disk_takes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int
) -> None:
    told: list[str] = []
    files = RunFiles(tmp_path / "logs" / "run", FREE, told.append)
    making = FailingCall(monkeypatch, "mkdir", error)
    making.failures = 2
    files.open(run_record, needed=False)
    assert os.strerror(error) in (files.trouble.now or "")
    for number in range(1, 4):
        files.urgent(event(number))
    files.close()
    assert (numbers(tmp_path / "logs" / "run"), gaps(tmp_path / "logs" / "run")) == ([2, 3], [1])
    assert read_header(tmp_path / "logs" / "run")["part"] == 1
    assert told[1:] == ["the field log is written again; records missing: 1"]


def test_folder_that_is_not_the_disks_fault_is_refused_though_the_log_is_not_needed(tmp_path: Path) -> None:
    (tmp_path / "logs").write_text("in the way", encoding="ascii")
    with pytest.raises(BadInput, match="a file stands where the folder should be"):
        RunFiles(tmp_path / "logs" / "run").open(run_record, needed=False)


def test_failure_is_tried_again_once_a_second_and_not_with_every_batch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Log(tmp_path)
    writing = FailingCall(monkeypatch, "write")
    writing.failures = 2
    for number in range(1, 31):
        log.files.bulk(tick(number))
        log.files.flush()
        if number % 10 == 0:
            log.files.sync()
    log.files.close()
    assert (numbers(tmp_path), gaps(tmp_path)) == (list(range(21, 31)), [20])


@pytest.mark.parametrize("failures", [1, 5])
def test_disk_that_cannot_sync_leaves_no_trail_of_empty_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failures: int
) -> None:
    log = Log(tmp_path)
    log.files.urgent(event(1))
    sync = FailingCall(monkeypatch, "fdatasync")
    sync.failures = failures
    for number in range(2, 10):
        log.files.urgent(event(number))
    log.files.close()
    assert log.parts() == ["run.00001.jsonl", "run.jsonl"]
    assert [record["part"] for record in read(tmp_path)[0] if record["record"] == "run"] == [1, 2]
    assert set(range(1, 10)) - set(numbers(tmp_path)) <= set(range(2, 2 + failures))
    assert log.files.dropped == failures
    assert "Input/output error: the card or disk is failing" in log.told[0]


def test_part_without_a_record_is_replaced_and_keeps_its_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Log(tmp_path)
    FailingCall(monkeypatch, "fdatasync").failures = 3
    for number in range(4):
        log.files.sync()
        log.files.urgent(event(number))
    log.files.close()
    assert log.parts() == ["run.jsonl"]
    assert read_header(tmp_path)["part"] == 1
    assert (numbers(tmp_path), gaps(tmp_path)) == ([2, 3], [2])


def test_write_that_cannot_be_taken_back_ends_its_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log(tmp_path)
    log.files.urgent(event(1))
    FailingCall(monkeypatch, "ftruncate").failures = 1
    with files_no_longer_than((tmp_path / "run.jsonl").stat().st_size + 20):
        log.files.urgent(event(2))
    log.files.urgent(event(3))
    log.files.close()
    found, its = read(tmp_path)
    assert [record["n"] for record in found if "n" in record] == [1, 3]
    assert (its.damage.torn, its.damage.missing) == (1, 1)
    assert log.parts() == ["run.00001.jsonl", "run.jsonl"]


@pytest.mark.parametrize("call", range(0, 96, 3))
def test_power_cut_at_any_change_of_the_disk_leaves_a_log_that_says_what_was_synced(tmp_path: Path, call: int) -> None:
    """In parts, of which the oldest but the first are deleted."""
    written = 0
    with power_cut_at(call):
        log = Log(tmp_path / "run", LogSettings(part_mb=0.0004, run_mb=0.0016, free_mb=0.0))
        for number in range(1, 21):
            log.files.urgent(tick(number))
            written = number
    there = numbers(tmp_path / "run") if (tmp_path / "run").exists() else []
    assert torn_lines(tmp_path / "run") == 0 if there else written == 0
    assert there[-1:] in ([], [written], [written + 1])
    assert there == sorted(there)
    next_one = Log(new_run_folder(tmp_path))
    next_one.files.urgent(event(1))
    next_one.files.close()
    assert numbers(next_one.folder) == [1]


@settings(max_examples=40)
@given(st.lists(st.sampled_from(["tick", "event", "sync", "full", "free", "delete", "unsync"]), max_size=40))
def test_nothing_raises_and_every_line_is_in_the_log_or_counted(steps: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as monkeypatch:
        log = Log(Path(folder) / "run", SMALL)
        sync = FailingCall(monkeypatch, "fdatasync")
        given_, deleted, limit = 0, False, None
        for step in [*steps, "free", "sync", "event", "sync", "event"]:
            if step in {"tick", "event"}:
                given_ += 1
                (log.files.bulk if step == "tick" else log.files.urgent)(tick(given_))
            elif step == "sync":
                log.files.sync()
            elif step in {"full", "free"}:
                if limit is not None:
                    limit.__exit__(None, None, None)
                limit = files_no_longer_than(300) if step == "full" else None
                if limit is not None:
                    limit.__enter__()
            elif step == "delete":
                shutil.rmtree(log.folder, ignore_errors=True)
                deleted = True
            else:
                sync.failures = 1
        log.files.close()
        there = numbers(log.folder)
        assert there == sorted(set(there))
        assert given_ in there, "in the end it writes again"
        assert torn_lines(log.folder) == 0
        if not deleted:
            assert len(there) + log.files.dropped >= given_
        assert not [part for part in log_segments(log.folder)[:-1] if part.read_bytes().count(b"\n") < 2]


def test_present_trouble_is_known_until_it_is_over() -> None:
    trouble = DiskTrouble(lambda _: None)
    assert trouble.now is None
    trouble.begins("disk", "the disk is full; the rover drives on")
    trouble.begins("queue", "the disk does not answer")
    assert trouble.now == "the disk is full"
    trouble.ends("disk", 1)
    assert trouble.now == "the disk does not answer"
    trouble.ends("queue", 1)
    assert trouble.now is None


def test_each_kind_of_trouble_is_told_once_until_all_of_it_is_over() -> None:
    told: list[str] = []
    trouble = DiskTrouble(told.append)
    trouble.ends("disk", 3)
    for _ in range(3):
        trouble.begins("queue", "the disk does not answer")
        trouble.begins("disk", "the disk is full")
    trouble.ends("queue", 10)
    trouble.ends("queue", 11)
    assert told == ["the disk does not answer", "the disk is full"]
    trouble.ends("disk", 12)
    trouble.ends("disk", 12)
    assert told[2:] == ["the field log is written again; records missing: 9"]
    trouble.begins("disk", "the disk is full")
    trouble.ends("disk", 14)
    assert told[3:] == ["the disk is full", "the field log is written again; records missing: 2"]
