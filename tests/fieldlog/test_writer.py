"""A run's files hold every line in order, in parts that are neither too many nor empty."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fieldlog.disks import FailingCall, files_no_longer_than
from tests.fieldlog.lines import SMALL, Log, event, gaps, header, numbers, read, standing, tick, write
from tests.kit.workshop import AHEAD
from wayfarer.config.rover_file import UNLIMITED, LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import RunReader, log_segments, read_header
from wayfarer.fieldlog.writer import RunFiles
from wayfarer.hal import STOP, WheelCommand


def test_lines_are_written_in_order_and_closing_writes_the_rest(tmp_path: Path) -> None:
    log = Log(tmp_path / "logs" / "run", UNLIMITED)
    write(log.files, range(1, 4))
    log.files.urgent(event(4))
    assert numbers(log.folder) == [1, 2, 3, 4], "an urgent line is written at once, with all before it"
    write(log.files, range(5, 1000))
    log.files.close()
    assert numbers(log.folder) == list(range(1, 1000))
    assert (log.files.dropped, log.told, log.parts()) == (0, [], ["run.jsonl"])


def test_lines_are_written_by_the_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    real = os.write

    def counted(file: int, data: bytes) -> int:
        calls.append(len(data))
        return real(file, data)

    monkeypatch.setattr(os, "write", counted)
    log = Log(tmp_path)
    write(log.files, range(1, 3001))
    log.files.close()
    assert len(calls) == 1 + -(-sum(calls[1:]) // 65_536), "the header, and then full batches"


def test_batch_is_written_as_soon_as_it_is_full_and_not_a_byte_sooner(tmp_path: Path) -> None:
    log = Log(tmp_path)
    for _ in range(2):  # the next batch begins at nothing
        before = written(log)
        log.files.bulk(b"x" * 65_534)  # and its end of line: a byte is missing
        assert written(log) == before
        log.files.bulk(b"{}")
        assert written(log) == before + 65_538
        log.files.bulk(b"x" * 65_535)
        assert written(log) == before + 65_538 + 65_536


def written(log: Log) -> int:
    return (log.folder / "run.jsonl").stat().st_size


def test_what_was_handed_over_before_a_sync_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log(tmp_path)
    synced: list[int] = []
    monkeypatch.setattr(os, "fdatasync", lambda file: synced.append(os.fstat(file).st_size))
    log.files.bulk(tick(1))
    log.files.flush()
    assert synced == []
    log.files.urgent(event(2))
    assert synced == [(tmp_path / "run.jsonl").stat().st_size]


def test_file_that_is_there_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "run.jsonl").write_bytes(b"precious")
    with pytest.raises(BadInput, match="File exists: log into a separate folder"):
        Log(tmp_path)
    assert (tmp_path / "run.jsonl").read_bytes() == b"precious"


def test_file_that_cannot_begin_is_bad_input_and_leaves_nothing(tmp_path: Path) -> None:
    with files_no_longer_than(10), pytest.raises(BadInput, match="cannot be written: File too large"):
        Log(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_is_written_after_closing_is_dropped(tmp_path: Path) -> None:
    log = Log(tmp_path)
    log.files.close()
    log.files.urgent(event(1))
    log.files.bulk(tick(2))
    log.files.close()
    assert (log.files.dropped, numbers(tmp_path)) == (2, [])


def test_rotation_loses_nothing_and_repeats_the_header(tmp_path: Path) -> None:
    log = Log(tmp_path, SMALL)
    for number in range(1, 101):
        log.files.bulk(tick(number))
        log.files.flush()
    log.files.close()
    found, its = read(tmp_path)
    assert [record["n"] for record in found if "n" in record] == list(range(1, 101))
    assert its.damage.lines == its.damage.missing == log.files.dropped == 0
    headers = [record["part"] for record in found if record["record"] == "run"]
    assert headers == list(range(1, len(headers) + 1))
    assert log.parts() == [*(f"run.{number:05d}.jsonl" for number in headers[:-1]), "run.jsonl"]
    assert len(headers) > 8
    assert all(part.stat().st_size <= 1000 for part in log_segments(tmp_path))
    assert [record["t_s"] for record in found] == sorted(record["t_s"] for record in found)


@settings(max_examples=30)
@given(st.lists(st.integers(1, 40), max_size=12))
def test_rotation_leaves_no_part_empty_however_lines_come(batches: list[int]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        log, number = Log(Path(folder), SMALL), 0
        for batch in batches:
            write(log.files, range(number + 1, number + batch + 1))
            log.files.flush()
            number += batch
        log.files.close()
        assert numbers(Path(folder)) == list(range(1, number + 1))
        assert all(part.read_bytes().count(b"\n") > 1 for part in log_segments(Path(folder))[:-1])


def test_run_beyond_its_limit_keeps_its_first_part_and_the_newest(tmp_path: Path) -> None:
    log = Log(tmp_path, LogSettings(part_mb=0.001, run_mb=0.005, free_mb=0.0))
    for number in range(1, 301):
        log.files.urgent(tick(number))
        assert sum(part.stat().st_size for part in log_segments(tmp_path)) <= 5000
    log.files.close()
    kept = numbers(tmp_path)
    assert kept[0] == 1
    assert kept[-25:] == list(range(276, 301))
    assert log.parts()[0] == "run.00001.jsonl"
    assert read_header(tmp_path)["part"] == 1
    assert read(tmp_path)[1].damage.missing == 300 - len(kept)
    assert log.files.dropped == 0, "what was deleted on purpose was not dropped"


def test_rover_that_stands_for_days_keeps_the_log_of_its_mission(tmp_path: Path) -> None:
    """Parts in which no wheel turned are deleted first; the oldest mission only where missions alone are too many."""
    log = FieldLog(RunFiles(tmp_path, LogSettings(part_mb=0.005, run_mb=0.03, free_mb=0.0)), {}, wall=lambda t_s: t_s)
    moments = iter(range(10_000))

    def goes_on(ticks: int, wheels: WheelCommand) -> list[float]:
        times_s = [next(moments) / 20 for _ in range(ticks)]
        for t_s in times_s:
            record = standing(t_s)
            record.applied = wheels
            log.tick(record)
            log.event("mark", t_s, text="written at once")
        return times_s

    def driven() -> list[float]:
        return [record["t_s"] for record in RunReader(tmp_path) if record.get("applied_left")]

    goes_on(30, STOP)
    mission = goes_on(20, AHEAD)
    goes_on(300, STOP)
    assert driven() == mission
    mission = goes_on(300, AHEAD)
    kept = driven()
    assert 20 < len(kept) < 300
    assert kept == mission[-len(kept) :]
    assert sum(part.stat().st_size for part in log_segments(tmp_path)) <= 30_000
    log.close("requested", "enough")


def test_part_that_cannot_be_renamed_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rename = FailingCall(monkeypatch, "rename", errno.EACCES)
    log = Log(tmp_path, SMALL)
    rename.failures = 2
    for number in range(1, 51):
        log.files.urgent(tick(number))
    log.files.close()
    assert numbers(tmp_path) == list(range(1, 51))
    assert rename.failures == 0, "it was tried again after another length, not with each line"
    assert (log.files.dropped, log.told) == (0, [])
    sizes = [part.stat().st_size for part in log_segments(tmp_path)]
    assert 2000 < sizes[0] <= 3000 and max(sizes[1:]) <= 1000


def test_part_that_cannot_be_made_costs_only_what_comes_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Log(tmp_path, SMALL)
    fitting = (1000 - len(header(1)) - 1) // (len(tick(10)) + 1)
    write(log.files, range(1, fitting + 1))
    log.files.flush()
    opening = FailingCall(monkeypatch, "open", errno.ENFILE)
    opening.failures = 1
    log.files.urgent(tick(fitting + 1))
    assert log.parts() == ["run.00001.jsonl"], "as after a power cut in that moment"
    assert numbers(tmp_path) == list(range(1, fitting + 1))
    opening.failures = 1
    for number in range(fitting + 2, 31):
        log.files.urgent(tick(number))
    log.files.close()
    assert numbers(tmp_path) == [*range(1, fitting + 1), *range(fitting + 3, 31)]
    assert gaps(tmp_path) == [2]
    headers = [record["part"] for record in read(tmp_path)[0] if record["record"] == "run"]
    assert headers == list(range(1, len(headers) + 1))


def test_older_part_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "run.00001.jsonl").write_bytes(b"precious\n")
    log = Log(tmp_path, SMALL)
    for number in range(1, 31):
        log.files.urgent(tick(number))
    log.files.close()
    assert (tmp_path / "run.00001.jsonl").read_bytes() == b"precious\n"
    assert numbers(tmp_path) == list(range(1, 31))
