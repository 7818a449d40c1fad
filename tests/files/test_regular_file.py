"""Files that are read although somebody else may have made them."""

from __future__ import annotations

import errno
import os
import socket
from pathlib import Path

import pytest

from wayfarer.files import open_regular, open_to_append, read_regular


def test_ordinary_file_is_read_also_through_a_symlink(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"12345")
    (tmp_path / "link").symlink_to("file")
    for name in ("file", "link"):
        assert read_regular(tmp_path / name, 5) == b"12345"


def test_larger_file_is_refused(tmp_path: Path) -> None:
    """Also a sparse one, whose size costs its maker nothing."""
    path = tmp_path / "sparse"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(OSError, match="more than 4 bytes") as refused:
        read_regular(path, 4)
    assert refused.value.errno == errno.EFBIG


@pytest.mark.parametrize("through", ["itself", "a symlink"])
@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "folder"])
def test_what_is_no_ordinary_file_is_refused_at_once(tmp_path: Path, kind: str, through: str) -> None:
    path, link = tmp_path / "it", tmp_path / "link"
    with socket.socket(socket.AF_UNIX) as bound:
        match kind:
            case "pipe":
                os.mkfifo(path)
            case "socket":
                bound.bind(str(path))
            case "device":
                path = Path("/dev/zero")
            case "folder":
                path.mkdir()
        link.symlink_to(path)
        with pytest.raises(OSError, match=f"it is a {kind}"):
            open_regular(path if through == "itself" else link)


def test_file_to_append_to_is_made_or_kept(tmp_path: Path) -> None:
    for content in (b"", b"12"):
        with open_to_append(tmp_path / "file") as file:
            assert file.read() == content
            file.write(b"12")
    assert (tmp_path / "file").read_bytes() == b"1212"


@pytest.mark.parametrize("kind", ["symlink", "pipe", "folder"])
def test_what_is_no_ordinary_file_is_not_appended_to(tmp_path: Path, kind: str) -> None:
    path, other = tmp_path / "it", tmp_path / "other"
    match kind:
        case "symlink":
            path.symlink_to(other)
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
    with pytest.raises(OSError, match=f"it is a {kind}"):
        open_to_append(path)
    assert not other.exists()


def test_pipe_that_comes_in_the_last_moment_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"")
    ordinary = path.stat()
    path.unlink()
    os.mkfifo(path)
    monkeypatch.setattr(Path, "stat", lambda _: ordinary)
    with pytest.raises(OSError, match="it is a pipe"):
        open_regular(path)
