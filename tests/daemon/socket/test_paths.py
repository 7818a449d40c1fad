"""Daemon and client meet at the same place, and one daemon at a time."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from stat import S_IMODE

import pytest

from tests.daemon.socket.fake_daemon import held_elsewhere, open_files
from wayfarer.daemon.driven import known_records
from wayfarer.daemon.socket import paths
from wayfarer.daemon.socket.paths import (
    AlreadyRunning,
    daemon_socket,
    known_sockets,
    single_daemon,
    without_daemon,
)
from wayfarer.errors import BadInput


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without any of the folders and variables: ``run`` is its /run."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(paths, "SYSTEM_FOLDER", tmp_path / "run" / "wayfarer")
    monkeypatch.setattr(paths, "SESSIONS_FOLDER", tmp_path / "run" / "user")
    (tmp_path / "run").mkdir()
    (tmp_path / "session").mkdir(mode=0o700)
    return tmp_path


def test_folder_where_the_socket_is_to_be_is_told_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    (path / "somebody's").mkdir(parents=True)
    files = open_files()
    with pytest.raises(BadInput) as caught, single_daemon(path):
        pytest.fail("it was entered")
    assert str(caught.value).startswith(f"{path}: the control socket cannot be made: it is a folder; remove")
    assert (path / "somebody's").is_dir()
    assert open_files() == files, "the lock is let go"


# -- where ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("services", "there", "better"),
    [
        (None, [], "session/wayfarer"),
        (None, ["run/wayfarer"], "run/wayfarer"),
        ("/run/rover:/run/other", ["run/wayfarer"], "/run/rover"),
    ],
    ids=["session", "system", "made by systemd"],
)
def test_better_folder_is_taken_where_there_is_one(
    places: Path, monkeypatch: pytest.MonkeyPatch, services: str | None, there: list[str], better: str
) -> None:
    for folder in there:
        (places / folder).mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "session"))
    monkeypatch.setenv("RUNTIME_DIRECTORY", services or "")
    assert daemon_socket() == places / better / "control.sock"
    assert daemon_socket() in known_sockets()


def test_system_folder_of_somebody_else_is_passed_over_by_a_daemon(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (places / "run" / "wayfarer").mkdir()
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "session"))
    assert daemon_socket() == places / "session/wayfarer/control.sock"
    assert list(known_sockets()) == [places / "run/wayfarer/control.sock", daemon_socket()]


@pytest.mark.parametrize(
    ("named", "why"),
    [
        (None, "XDG_RUNTIME_DIR is not set"),
        ("", "XDG_RUNTIME_DIR is not set"),
        ("gone", "XDG_RUNTIME_DIR is .*gone, which is not a folder"),
        ("file", "XDG_RUNTIME_DIR is .*file, which is not a folder"),
        ("./session", "XDG_RUNTIME_DIR is ./session, which is not a folder, or not from / on"),
        ("/" + "x" * 300, "XDG_RUNTIME_DIR is .*, which is not a folder"),
        ("shared", r"XDG_RUNTIME_DIR is .*shared, to which others may write \(mode 1777\)"),
        ("theirs", "XDG_RUNTIME_DIR is .*theirs, which belongs to user 7"),
    ],
)
def test_without_a_folder_of_one_s_own_a_line_names_the_variable(
    places: Path, monkeypatch: pytest.MonkeyPatch, named: str | None, why: str
) -> None:
    """No folder that others can write to is used: who made ``wayfarer`` in it first could answer for the daemon."""
    for folder, mode in (("shared", 0o1777), ("theirs", 0o700)):
        (places / folder).mkdir()
        (places / folder).chmod(mode)
    (places / "file").touch()
    there = (places / "theirs").stat()
    theirs, stat = os.stat_result((*there[:4], 7, *there[5:])), Path.stat
    monkeypatch.setattr(Path, "stat", lambda path, **more: theirs if path.name == "theirs" else stat(path, **more))
    monkeypatch.chdir(places)
    if named is not None:
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / named) if named.isalpha() else named)
    with pytest.raises(BadInput, match=f"no folder for the control socket: {why}.*; set it to a folder ") as caught:
        daemon_socket()
    assert "\n" not in str(caught.value)
    assert list(known_sockets())[:1] == [places / "run/wayfarer/control.sock"]
    assert not any(named in str(path) for path in known_sockets() if named)
    with without_daemon():  # no daemon of this user can run, so the parts may be looked at
        assert not (places / "run/wayfarer").exists()


def test_each_place_is_asked_once_for_a_socket_and_for_a_record(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The service's own stop-motors has both the variable and the folder."""
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(paths.SYSTEM_FOLDER))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "session"))
    folders = [places / "run/wayfarer", places / "session/wayfarer"]
    assert known_sockets() == [folder / "control.sock" for folder in folders]
    assert list(known_records()) == [folder / "motors.json" for folder in folders]


@pytest.mark.parametrize("user", [0, 1000])
def test_root_s_client_looks_into_the_sessions_of_users_too(
    places: Path, monkeypatch: pytest.MonkeyPatch, user: int
) -> None:
    session = places / "run/user/1001/wayfarer"
    session.mkdir(parents=True)
    (places / "run/user/1002").mkdir()
    monkeypatch.setattr(os, "geteuid", lambda: user)
    own = [places / "run/wayfarer/control.sock"]
    assert list(known_sockets()) == own + [session / "control.sock"] * (user == 0)
    with pytest.raises(BadInput, match="XDG_RUNTIME_DIR is not set"):
        daemon_socket()  # a daemon of root's does not move in there


def test_session_of_who_gave_sudo_is_asked_first(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any user who is logged in can put a false daemon into the session's folder."""
    for user in ("1000", "1001"):
        (places / "run/user" / user / "wayfarer").mkdir(parents=True)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setenv("SUDO_UID", "1001")
    assert [path.parent.parent.name for path in known_sockets()][-2:] == ["1001", "1000"]


# -- the lock ------------------------------------------------------------------------------------------------------


def test_folder_of_the_socket_is_made_for_its_owner_and_used_again(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "session"))
    with single_daemon(daemon_socket()):
        assert S_IMODE(daemon_socket().parent.stat().st_mode) == 0o700
    assert daemon_socket().parent.is_dir()


@pytest.mark.process
def test_second_daemon_is_told_who_runs_and_leaves_the_first_alone(path: Path) -> None:
    path.with_name("control.sock.lock").write_bytes(b"99999999999\n")  # of one that was killed, with more digits
    with held_elsewhere(single_daemon, path) as first:
        path.touch()
        with pytest.raises(AlreadyRunning, match=rf"process {first}, socket {path}\): .*'wayfarer stop'"):
            single_daemon(path).__enter__()
        assert path.exists()
    with single_daemon(path):
        assert not path.exists(), "what the killed one left is cleared away by the next"


def test_second_in_the_same_process_is_refused_too(path: Path) -> None:
    before = open_files()
    with single_daemon(path):
        for _ in range(2):
            with pytest.raises(AlreadyRunning, match=f"process {os.getpid()},"):
                single_daemon(path).__enter__()
        assert open_files() == before + 1
    assert open_files() == before


def test_holder_that_has_not_signed_yet_is_not_named(path: Path) -> None:
    with single_daemon(path):
        path.with_name("control.sock.lock").write_bytes(b"")
        with pytest.raises(AlreadyRunning, match="process not known yet,"):
            single_daemon(path).__enter__()


def test_next_daemon_may_begin_when_the_first_has_ended(path: Path) -> None:
    for _ in range(3):
        with single_daemon(path), socket.socket(socket.AF_UNIX) as listening:
            listening.bind(str(path))
        assert not path.exists()


def test_lock_that_is_a_link_is_refused(path: Path) -> None:
    path.with_name("control.sock.lock").symlink_to(path.parent / "victim")
    with pytest.raises(BadInput, match="the daemon's lock cannot be made"):
        single_daemon(path).__enter__()
    assert not (path.parent / "victim").exists()


def test_folder_that_cannot_be_made_is_the_users_to_mend(path: Path) -> None:
    path.touch()
    with pytest.raises(BadInput, match=r"control\.sock/x\.lock: the daemon's lock cannot be made"):
        single_daemon(path / "x").__enter__()
