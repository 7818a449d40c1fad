"""A file that is there whole or not at all."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from wayfarer.errors import BadInput
from wayfarer.files import atomic_file, write_new


def write(path: Path, text: str = "new", *, follow_symlink: bool = False) -> None:
    with atomic_file(path, follow_symlink=follow_symlink) as draft:
        draft.write(text.encode())


@pytest.mark.parametrize("before", [None, "old"])
def test_file_appears_once_it_is_whole(tmp_path: Path, before: str | None) -> None:
    path = tmp_path / "file"
    if before is not None:
        path.write_text(before, encoding="utf-8")
    with atomic_file(path) as draft:
        draft.write(b"new")
        assert (path.read_text(encoding="utf-8") if path.exists() else None) == before
    assert path.read_text(encoding="utf-8") == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("failure", [OSError, KeyboardInterrupt])
def test_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path, failure: type[BaseException]) -> None:
    path = tmp_path / "file"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(failure), atomic_file(path) as draft:
        draft.write(b"half")
        raise failure
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_content_is_on_the_disk_before_the_name_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, synced = tmp_path / "file", []

    def sync(file: int) -> None:
        status = os.fstat(file)
        synced.append(("folder" if stat.S_ISDIR(status.st_mode) else status.st_size, path.exists()))

    monkeypatch.setattr(os, "fsync", sync)
    write(path)
    assert synced == [(len("new"), False), ("folder", True)], "the folder holds the name"


def test_folder_that_cannot_be_synced_does_not_undo_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One without permission to read it, or on a file system that cannot do it."""
    sync = os.fsync

    def refuse_folders(file: int) -> None:
        if stat.S_ISDIR(os.fstat(file).st_mode):
            raise PermissionError
        sync(file)

    monkeypatch.setattr(os, "fsync", refuse_folders)
    write(tmp_path / "file")
    assert (tmp_path / "file").read_text(encoding="utf-8") == "new"


def test_symlink_that_a_person_gave_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    link, target = tmp_path / "link", tmp_path / "elsewhere" / "file"
    link.symlink_to(target)
    for text in ("first", "second"):
        write(link, text, follow_symlink=True)
        assert link.is_symlink()
        assert target.read_text(encoding="utf-8") == text
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("through", ["itself", "a symlink"])
def test_pipe_is_refused_and_stays(tmp_path: Path, through: str) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    path = pipe if through == "itself" else link
    with pytest.raises(BadInput, match="is not an ordinary file"):
        write(path, follow_symlink=True)
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert set(tmp_path.iterdir()) == {pipe, link}


def test_folder_and_circle_of_symlinks_are_refused(tmp_path: Path) -> None:
    circle = tmp_path / "circle"
    circle.symlink_to(circle)
    for path in (tmp_path, circle):
        with pytest.raises(BadInput, match="is not an ordinary file"):
            write(path, follow_symlink=True)
    assert list(tmp_path.iterdir()) == [circle]
    assert circle.is_symlink()


def test_folder_that_is_not_there_is_the_callers_to_tell(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write(tmp_path / "nowhere" / "file")


@pytest.mark.parametrize("target", ["a file", "a folder", "nothing", "itself"])
def test_symlink_that_nobody_gave_is_replaced(tmp_path: Path, target: str) -> None:
    """The sender of a folder, or its owner, may have put it there."""
    (tmp_path / "a file").write_text("old", encoding="utf-8")
    (tmp_path / "a folder").mkdir()
    link = tmp_path / "report.html"
    link.symlink_to(link if target == "itself" else tmp_path / target)
    write(link)
    assert not link.is_symlink()
    assert link.read_text(encoding="utf-8") == "new"
    assert (tmp_path / "a file").read_text(encoding="utf-8") == "old"
    assert not (tmp_path / "nothing").exists()


def test_draft_is_not_written_through_a_symlink_in_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = tmp_path / "other"
    other.write_text("old", encoding="utf-8")
    monkeypatch.setattr("os.urandom", bytes)  # zeros: its name is guessed
    (tmp_path / ".report.html.00000000.new").symlink_to(other)
    with pytest.raises(FileExistsError):
        write(tmp_path / "report.html")
    assert other.read_text(encoding="utf-8") == "old"


def test_file_for_its_owner_only_is_never_open_to_others(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    with atomic_file(path, mode=0o600) as draft:
        assert stat.S_IMODE(os.fstat(draft.fileno()).st_mode) == 0o600
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


# -- a file that is not there yet ------------------------------------------------------------------------------------


def without_links(code: int) -> Callable[..., None]:
    def refuse(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    return refuse


@pytest.mark.parametrize("code", [errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS])
def test_new_file_is_written_to_a_stick_without_hard_links_and_replaces_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    monkeypatch.setattr(os, "link", without_links(code))  # as vfat, exFAT and FUSE say it
    path = tmp_path / "rover.toml"
    write_new(path, "first")
    with pytest.raises(FileExistsError):
        write_new(path, "second")
    assert path.read_text(encoding="utf-8") == "first"
    assert list(tmp_path.iterdir()) == [path]


def test_new_file_that_cannot_be_written_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "link", without_links(errno.ENOSPC))
    with pytest.raises(OSError, match="No space left"):
        write_new(tmp_path / "rover.toml", "text")
    monkeypatch.setattr(os, "link", without_links(errno.EPERM))
    monkeypatch.setattr(Path, "replace", without_links(errno.EIO))
    with pytest.raises(OSError, match="Input/output error"):
        write_new(tmp_path / "rover.toml", "text")
    assert list(tmp_path.iterdir()) == []
