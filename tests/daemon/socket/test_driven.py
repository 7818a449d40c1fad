"""What a daemon drives is written down whole, and believed only where nobody else can have written it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from stat import S_IMODE

import pytest

from wayfarer.daemon.socket import paths
from wayfarer.daemon.socket.driven import (
    MAX_BYTES,
    DrivenBoard,
    known_records,
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


def test_what_was_written_is_read_and_gone_when_it_is_removed(path: Path, record: Path) -> None:
    assert read_record(record) == (DRIVEN, ME)
    assert S_IMODE(record.stat().st_mode) == 0o600
    assert list(record.parent.iterdir()) == [record]
    remove_record(path)
    assert read_record(record) is None
    remove_record(path)


def test_next_daemon_s_takes_the_place_of_one_that_was_left(path: Path, record: Path) -> None:
    write_record(path, DrivenBoard({"driver": "thunderborg"}, "some:buses"))
    assert read_record(record) == (({"driver": "thunderborg"}, "some:buses"), ME)


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
        (lambda record: record.chmod(0o620), r"others may write to it \(mode 0620\)"),
        (lambda record: record.chmod(0o602), r"others may write to it \(mode 0602\)"),
        (lambda record: record.parent.chmod(0o770), r"others may write to its folder \(mode 0770\)"),
        (lambda record: record.parent.chmod(0o1777), r"others may write to its folder \(mode 1777\)"),
        (other_link, "it is a symlink"),
        (pipe, "it is no ordinary file"),
        (says(""), "no daemon wrote this"),
        (says("{}"), "no daemon wrote this"),
        (says("[" * 100_000), "no daemon wrote this"),
        (says('{"motors": 3, "buses": "linux"}'), "no daemon wrote this"),
        (says('{"motors": {}, "buses": "linux"}'), "no daemon wrote this"),
        (says('{"motors": {"driver": "x"}, "buses": "linux", "more": 1}'), "no daemon wrote this"),
        (says(json.dumps({"motors": {"driver": "x" * MAX_BYTES}, "buses": "linux"})), "no daemon wrote this"),
    ],
)
def test_what_cannot_be_believed_is_told(record: Path, done: Callable[[Path], object], why: str) -> None:
    done(record)
    with pytest.raises(BadInput, match=rf"motors\.json: rejected: {why}"):
        read_record(record)


@pytest.mark.parametrize(
    ("user", "file", "folder", "why"),
    [
        (1000, 1000, 1000, None),
        (1000, 0, 0, None),
        (1000, 1000, 0, None),
        (1000, 1001, 1001, "it belongs to user 1001"),
        (1000, 1001, 0, "it belongs to user 1001"),
        (1000, 1000, 1001, "its folder belongs to user 1001, and it to user 1000"),
        (1000, 0, 1001, "its folder belongs to user 1001, and it to user 0"),
        (0, 1001, 1001, None),
        (0, 1001, 0, None),
        (0, 0, 1001, "its folder belongs to user 1001, and it to user 0"),
        (0, 1001, 1002, "its folder belongs to user 1002, and it to user 1001"),
    ],
)
def test_owner_is_this_user_or_root_and_root_takes_every_owner_s_as_theirs(
    record: Path, monkeypatch: pytest.MonkeyPatch, user: int, file: int, folder: int, why: str | None
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: user)
    inode, fstat = record.stat().st_ino, os.fstat

    def owned(number: int) -> os.stat_result:
        about = list(fstat(number))
        about[4] = file if about[1] == inode else folder
        return os.stat_result(about)

    monkeypatch.setattr(os, "fstat", owned)
    if why is None:
        assert read_record(record) == (DRIVEN, file)
    else:
        with pytest.raises(BadInput, match=why):
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


def test_records_are_looked_for_beside_every_socket_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paths, "known_folders", lambda: [Path("/run/wayfarer"), Path("/run/wayfarer"), Path("/x")])
    assert list(known_records()) == [Path("/run/wayfarer/motors.json"), Path("/x/motors.json")]
