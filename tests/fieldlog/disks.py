"""Disks that run full, vanish or fail, without harm to the one that the tests run on."""

from __future__ import annotations

import errno
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest


@contextmanager
def files_no_longer_than(size: int) -> Iterator[None]:
    """Have the operating system cut every write of this process at this length of a file, and refuse the next.

    Meanwhile no import is cached: Python does not notice that a ``.pyc`` was cut, and later fails to import from it.
    """
    (soft, hard), no_cache = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        sys.dont_write_bytecode = no_cache


@contextmanager
def small_disk(mount_point: Path, kb: int) -> Iterator[bool]:
    """Mount a disk of this size; give False if that is not allowed: it takes a root that may mount."""
    mount_point.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={kb}k,mode=755", "tmpfs", str(mount_point)]
    mounted = os.geteuid() == 0 and subprocess.run(command, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(mount_point)], check=True)


@contextmanager
def mounted(image: Path, at: Path) -> Iterator[bool]:
    """Mount an image of a disk; give False if that is not allowed."""
    at.mkdir(exist_ok=True)
    mounts = os.geteuid() == 0 and _done("mount", "-o", "loop", image, at)
    try:
        yield mounts
    finally:
        if mounts:
            subprocess.run(["umount", "-l", at], check=True)


def ext4_image(path: Path) -> Path:
    """Make the image of an empty ext4, if this computer can."""
    path.touch()
    os.truncate(path, 24_000_000)
    if shutil.which("mkfs.ext4") is not None:
        _done("mkfs.ext4", "-q", "-b", "1024", path)
    return path


def damage(image: Path, folder: str) -> None:
    """Have garbage in the place of a folder's names."""
    command = ["debugfs", "-R", f"blocks {folder}", str(image)]
    block = int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    with image.open("r+b") as file:
        file.seek(1024 * block)
        file.write(b"\xa5" * 1024)


def _done(*command: str | Path) -> bool:
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


class PowerCut(BaseException):
    """Ends everything at once; nothing that a program does about an error happens."""


@contextmanager
def power_cut_at(call: int) -> Iterator[None]:
    """Let the power go at the n-th change of the disk, from 0; if there are fewer, nothing happens."""
    left = call

    def counted(real: Callable[..., Any]) -> Callable[..., Any]:
        def change(*args: Any, **keys: Any) -> Any:
            nonlocal left
            if left == 0:
                raise PowerCut
            left -= 1
            return real(*args, **keys)

        return change

    with pytest.MonkeyPatch.context() as patch:
        for name in (
            "open",
            "mkdir",
            "write",
            "ftruncate",
            "fdatasync",
            "fsync",
            "rename",
            "replace",
            "unlink",
            "rmdir",
        ):
            patch.setattr(os, name, counted(getattr(os, name)))
        with suppress(PowerCut):
            yield


class FailingCall:
    """Stands for a function of ``os``, which fails as often as it is told to and then is itself again."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, name: str, number: int = errno.EIO) -> None:
        self._real = getattr(os, name)
        self._number = number
        self.failures = 0
        monkeypatch.setattr(os, name, self)

    def __call__(self, *args: object, **keys: object) -> object:
        """Fail, or do what is asked."""
        if self.failures > 0:
            self.failures -= 1
            self.fail(self._number)
        return self._real(*args, **keys)

    @staticmethod
    def fail(number: int) -> None:
        """Fail as the operating system does."""
        raise OSError(number, os.strerror(number))
