"""What a daemon drives is written down whole, and read with whose file it is."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from stat import S_IMODE

import pytest

from wayfarer.daemon.driven import (
    RECORD_BYTES,
    DrivenBoard,
    read_record,
    remove_record,
    write_record,
)
from wayfarer.errors import BadInput

DRIVEN = DrivenBoard({"driver": "sabertooth", "port": "/dev/ttyAMA0", "duty_limit": 0.5}, "linux")
ME, NOBODY = os.geteuid(), 65534


@pytest.fixture
def record(path: Path) -> Path:
    """A record beside a daemon's socket."""
    write_record(path, DRIVEN)
    return path.with_name("motors.json")


def told(record: Path) -> tuple[DrivenBoard, int, int]:
    """What a record says, which file it is, and whose: reading it changes when it was last read."""
    found = read_record(record)
    assert found is not None
    driven, about = found
    return driven, about.st_ino, about.st_uid


def test_what_was_written_is_read_and_gone_when_it_is_removed(path: Path, record: Path) -> None:
    assert told(record) == (DRIVEN, record.stat().st_ino, ME)
    assert S_IMODE(record.stat().st_mode) == 0o600
    assert list(record.parent.iterdir()) == [record]
    remove_record(path)
    assert read_record(record) is None
    remove_record(path)


def test_next_daemon_s_takes_the_place_of_one_that_was_left(path: Path, record: Path) -> None:
    write_record(path, DrivenBoard({"driver": "thunderborg"}, "some:buses"))
    assert told(record) == (({"driver": "thunderborg"}, "some:buses"), record.stat().st_ino, ME)


def test_folder_that_cannot_be_written_to_is_told(path: Path) -> None:
    with pytest.raises(BadInput, match=r"motors\.json: the record of the motors cannot be written: No such file"):
        write_record(path.parent / "none" / "control.sock", DRIVEN)


def other_link(record: Path) -> None:
    record.rename(record.with_name("elsewhere"))
    record.symlink_to("elsewhere")


def pipe(record: Path) -> None:
    record.unlink()
    os.mkfifo(record, 0o600)


def says(text: str) -> Callable[[Path], object]:
    return lambda record: record.write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("done", "why"),
    [
        (other_link, "no daemon wrote this"),
        (pipe, "no daemon wrote this"),
        (lambda record: (record.unlink(), record.mkdir()), "no daemon wrote this"),
        (says(""), "no daemon wrote this"),
        (says("{}"), "no daemon wrote this"),
        (says("[" * 100_000), "no daemon wrote this"),
        (says('{"motors": 3, "buses": "linux"}'), "no daemon wrote this"),
        (says('{"motors": {}, "buses": "linux"}'), "no daemon wrote this"),
        (says('{"motors": {"driver": "x"}, "buses": "linux", "more": 1}'), "no daemon wrote this"),
        (says(json.dumps({"motors": {"driver": "x" * RECORD_BYTES}, "buses": "linux"})), "no daemon wrote this"),
    ],
)
def test_what_cannot_be_believed_is_told(record: Path, done: Callable[[Path], object], why: str) -> None:
    done(record)
    with pytest.raises(BadInput, match=rf"motors\.json: rejected: {why}"):
        read_record(record)


@pytest.mark.skipif(ME != 0, reason="root reads everything, and only root can become somebody else")
def test_what_this_user_may_not_read_is_nobody_s(record: Path) -> None:
    for each in (record, record.parent):
        os.chown(each, 0, 0)
    os.seteuid(NOBODY)
    try:
        assert read_record(record) is None
    finally:
        os.seteuid(0)
