"""A full disk costs records, which are counted where they are missing, and never half a line."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fieldlog.disks import files_no_longer_than, small_disk
from tests.fieldlog.lines import Log, event, gaps, header, numbers, run_record, tick, torn_lines, write
from wayfarer.commissioning.checks.card import card_health
from wayfarer.config.rover_file import LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import new_run_folder
from wayfarer.fieldlog.writer import RunFiles


@pytest.fixture
def card(tmp_path: Path) -> Iterator[Path]:
    """A disk of 256 kB."""
    with small_disk(tmp_path / "card", kb=256) as mounted:
        if not mounted:
            pytest.skip("mounting a small disk takes root")
        yield tmp_path / "card"


def test_nearly_full_disk_takes_no_ticks_but_events(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.statvfs("/")
    stated = list(real)

    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result(stated))
    log = Log(tmp_path, LogSettings(part_mb=1.0, free_mb=40.0))
    for number, free_mb in enumerate([50.0, 39.0, 39.0, 41.0, 45.0, 50.0], start=1):
        stated[4] = int(free_mb * 1e6 / real.f_frsize)
        log.files.sync()
        log.files.bulk(tick(2 * number))
        log.files.urgent(event(2 * number + 1))
    log.files.close()
    assert numbers(tmp_path) == [2, 3, 5, 7, 9, 10, 11, 12, 13], "41 MB are too near to 40 to begin again"
    assert gaps(tmp_path) == [1, 1, 1]
    assert log.files.dropped == 3
    assert log.told == [
        f"{tmp_path}: the field log takes only events and positions: less than 40 MB are free: delete old runs; "
        "the rover drives on",
        "the field log is written again; records missing: 3",
    ]


def test_nearly_full_disk_begins_no_new_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log(tmp_path, LogSettings(part_mb=0.001, free_mb=1.0))
    stated = [*os.statvfs("/")]
    stated[4] = 0
    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result(stated))
    for number in range(1, 31):
        log.files.urgent(event(number))
    log.files.close()
    assert (log.parts(), numbers(tmp_path)) == (["run.jsonl"], list(range(1, 31)))


@settings(max_examples=40)
@given(st.integers(0, 1500), st.integers(1, 12))
def test_disk_that_is_full_at_any_byte_tears_no_line_and_tells_what_is_missing(more: int, batch: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        log = Log(Path(folder))
        with files_no_longer_than(len(header(1)) + 1 + more):
            for number in range(1, 31):
                log.files.bulk(tick(number))
                if number % batch == 0:
                    log.files.flush()
            log.files.sync()
            fitted = numbers(Path(folder))
            assert fitted == list(range(1, more // (len(tick(10)) + 1) + 1)) or len(fitted) > 8
        write(log.files, range(31, 41))
        log.files.close()
        after, dropped = numbers(Path(folder)), 30 - len(fitted)
        assert after == [*fitted, *range(31, 41)]
        assert torn_lines(Path(folder)) == 0
        assert log.files.dropped == sum(gaps(Path(folder))) == dropped
        assert len(log.told) == (2 if dropped else 0)


@pytest.mark.process
def test_real_disk_runs_full_and_is_freed(card: Path) -> None:
    log = Log(card / "logs" / "run", LogSettings(part_mb=0.05, free_mb=0.0))
    ballast = card / "ballast"
    ballast.write_bytes(bytes(150_000))
    for number in range(1, 2001):
        log.files.bulk(tick(number))
        if number % 7 == 0:
            log.files.flush()
        if number % 100 == 0:
            log.files.sync()
    fitted = numbers(log.folder)
    assert fitted == list(range(1, len(fitted) + 1))
    assert 500 < len(fitted) < 1500
    ballast.unlink()
    log.files.sync()
    write(log.files, range(2001, 2101))
    log.files.close()
    assert numbers(log.folder) == [*fitted, *range(2001, 2101)]
    assert torn_lines(log.folder) == 0
    assert gaps(log.folder) == [log.files.dropped] == [2000 - len(fitted)]
    assert "No space left on device: delete old runs" in log.told[0]
    assert len(log.told) == 2


@pytest.mark.process
def test_read_only_disk_is_told_before_a_run_begins_or_while_it_cannot(card: Path) -> None:
    (card / "logs").mkdir()
    subprocess.run(["mount", "-o", "remount,ro", str(card)], check=True)
    with pytest.raises(BadInput, match="cannot be written: Read-only file system: mount the disk for writing"):
        Log(card / "logs" / "run")
    with pytest.raises(BadInput, match="no folder can be made for the field log: Read-only file system"):
        new_run_folder(card / "logs")
    assert card_health(card / "logs").disk_read_only
    files = RunFiles(new_run_folder(card / "logs", needed=False), LogSettings(free_mb=0.0))
    files.open(run_record, needed=False)
    files.urgent(event(1))
    assert files.trouble.now is not None
    subprocess.run(["mount", "-o", "remount,rw", str(card)], check=True)
    files.urgent(event(2))
    files.close()
    (run,) = (card / "logs").iterdir()
    assert (numbers(run), gaps(run)) == ([2], [1])
    assert card_health(card / "logs").disk_memory == "tmpfs"
