"""Daemon and client meet at the same place, and one daemon at a time."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from stat import S_IMODE

import pytest

from tests.daemon.socket.fake_daemon import held_elsewhere, open_files
from wayfarer.daemon.socket import paths
from wayfarer.daemon.socket.paths import (
    AlreadyRunning,
    daemon_socket,
    known_sockets,
    may_listen,
    single_daemon,
    unsafe_folders,
)
from wayfarer.errors import BadInput


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without any of the folders: ``run`` and ``tmp`` are its /run and /tmp."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(paths, "SYSTEM_FOLDER", tmp_path / "run" / "wayfarer")
    monkeypatch.setattr(paths, "SESSIONS_FOLDER", tmp_path / "run" / "user")
    monkeypatch.setattr(paths, "SHARED_FOLDER", tmp_path / "tmp")
    (tmp_path / "tmp").mkdir()
    (tmp_path / "run").mkdir()
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


def test_last_resort_is_a_folder_of_the_users_own(places: Path) -> None:
    assert daemon_socket() == places / "tmp" / f"wayfarer-{os.geteuid()}" / "control.sock"


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
    for folder in ["session", *there]:
        (places / folder).mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "session"))
    monkeypatch.setenv("RUNTIME_DIRECTORY", services or "")
    assert daemon_socket() == places / better / "control.sock"


@pytest.mark.parametrize("session", ["gone", "relative", "", "/" + "x" * 300])
def test_session_folder_that_is_not_there_is_passed_over(
    places: Path, monkeypatch: pytest.MonkeyPatch, session: str
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / session) if session == "gone" else session)
    assert daemon_socket().parent.parent == places / "tmp"


def test_system_folder_of_somebody_else_is_passed_over_by_a_daemon(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (places / "run" / "wayfarer").mkdir()
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    assert daemon_socket().parent.parent == places / "tmp"


def test_client_looks_wherever_a_daemon_may_be(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sockets = list(known_sockets())
    assert sockets == [places / "run/wayfarer/control.sock", daemon_socket()]
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places))
    assert list(known_sockets()) == [sockets[0], daemon_socket(), sockets[1]]


@pytest.mark.parametrize("user", [0, 1000])
def test_root_s_client_looks_into_the_sessions_of_users_too(
    places: Path, monkeypatch: pytest.MonkeyPatch, user: int
) -> None:
    session = places / "run/user/1001/wayfarer"
    session.mkdir(parents=True)
    (session / "control.sock").touch()
    (places / "run/user/1002").mkdir()
    monkeypatch.setattr(os, "geteuid", lambda: user)
    own = [places / "run/wayfarer/control.sock", places / "tmp" / f"wayfarer-{user}" / "control.sock"]
    assert list(known_sockets()) == own + [session / "control.sock"] * (user == 0)
    assert daemon_socket() == own[1], "a daemon of root's does not move in there"


@pytest.mark.parametrize("mode", [0o755, 0o770, 0o1777])
def test_folder_that_others_can_enter_is_refused(places: Path, mode: int) -> None:
    folder = daemon_socket().parent
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(BadInput, match=f"mode 0700.* with mode {mode:04o}: .*; remove it"):
        daemon_socket()


def test_folder_of_another_user_is_refused(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = os.geteuid()
    (places / "tmp" / f"wayfarer-{own + 1}").mkdir(mode=0o700)
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)
    with pytest.raises(BadInput, match=f"only user {own + 1} can enter .* belongs to user {own} "):
        daemon_socket()


@pytest.mark.parametrize("mode", [0o755, 0o777])
def test_session_s_folder_that_others_can_enter_is_passed_over(
    places: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    """``XDG_RUNTIME_DIR`` may name a shared folder, in which another user made ``wayfarer`` first."""
    folder = places / "shared/wayfarer"
    folder.mkdir(parents=True)
    folder.chmod(mode)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "shared"))
    assert daemon_socket().parent.parent == places / "tmp"
    assert folder / "control.sock" not in known_sockets()
    assert [why.split(": ")[0] for why in unsafe_folders()] == [str(folder)]


def test_session_s_folder_of_another_user_is_passed_over(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (places / "shared/wayfarer").mkdir(parents=True, mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "shared"))
    other = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: other)
    assert daemon_socket().parent == places / "tmp" / f"wayfarer-{other}"


@pytest.mark.parametrize(("mode", "safe"), [(0o777, False), (0o1777, True)])
def test_folder_that_others_can_rename_is_passed_over(
    places: Path, monkeypatch: pytest.MonkeyPatch, mode: int, safe: bool
) -> None:
    (places / "shared/wayfarer").mkdir(parents=True)
    (places / "shared/wayfarer").chmod(0o700)
    (places / "shared").chmod(mode)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places / "shared"))
    assert (daemon_socket().parent.parent == places / "shared") == safe


def test_folder_that_another_user_makes_in_the_last_moment_is_refused(places: Path) -> None:
    socket_path = daemon_socket()
    socket_path.parent.mkdir()
    socket_path.parent.chmod(0o777)
    files = open_files()
    with pytest.raises(BadInput, match="somebody may be listening in"), single_daemon(socket_path):
        pytest.fail("it was entered")
    assert open_files() == files


def test_any_user_s_folder_keeps_root_from_no_daemon_elsewhere(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    (places / "tmp/wayfarer-0").mkdir()
    (places / "tmp/wayfarer-0").chmod(0o777)
    session = places / "run/user/1001/wayfarer"
    session.mkdir(parents=True)
    assert list(known_sockets()) == [places / "run/wayfarer/control.sock", session / "control.sock"]
    with pytest.raises(BadInput, match=r"no folder for the control socket: .*wayfarer-0"):
        daemon_socket()  # root's daemon does not move into a user's session


def test_session_of_who_gave_sudo_is_asked_first(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any user who is logged in can put a false daemon into the session's folder."""
    for user in ("1000", "1001"):
        (places / "run/user" / user / "wayfarer").mkdir(parents=True)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setenv("SUDO_UID", "1001")
    assert [path.parent.parent.name for path in known_sockets()][-2:] == ["1001", "1000"]


@pytest.mark.parametrize(
    ("place", "believed"),
    [("tmp/wayfarer-1000", {0, 1000}), ("run/wayfarer", {0, 1000, 7}), ("run/user/7/wayfarer", {0, 1000, 7})],
)
def test_only_root_this_user_and_who_owns_a_folder_of_root_s_may_listen(
    places: Path, monkeypatch: pytest.MonkeyPatch, place: str, believed: set[int]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    folder = places / place
    folder.mkdir(parents=True)
    there = folder.lstat()
    owned = os.stat_result((*there[:4], 7, *there[5:]))
    monkeypatch.setattr(Path, "lstat", lambda path: owned if path == folder else os.lstat(path))
    assert {uid for uid in (0, 7, 8, 1000) if may_listen(uid, folder / "control.sock")} == believed


def test_link_to_a_private_folder_is_refused(places: Path) -> None:
    (places / "mine").mkdir(mode=0o700)
    daemon_socket().parent.symlink_to(places / "mine")
    with pytest.raises(BadInput, match="remove it"):
        daemon_socket()


def test_shared_folder_matters_only_where_it_is_needed(places: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    daemon_socket().parent.mkdir(mode=0o755)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(places))
    assert daemon_socket() == places / "wayfarer" / "control.sock"


# -- the lock ------------------------------------------------------------------------------------------------------


def test_folder_of_the_socket_is_made_for_its_owner_and_used_again(places: Path) -> None:
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
