"""Deletes the oldest runs while all together take more than a person has set; otherwise nothing is ever deleted.

The oldest is the one with the lowest counter; clocks do not count. These runs are never deleted: the newest, one that a
process writes, and a folder that is not exactly a run: another name or a longer one (a person wrote behind the
counter), a symlink, another user's folder, or one with any other file in it, but for its report. So the file ``keep``,
which ``wayfarer mark`` makes, keeps a run.

One run after the other: its folder is renamed, looked at again, and then emptied. A power cut leaves a run that is
whole, or a hidden folder that no tool takes for a run and that the next deletion removes.
"""

from __future__ import annotations

import fcntl
import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from wayfarer.fieldlog.folders import DELETING, MB, PART_NAME, RUN_NAME, error_advice

KEEP = "keep"  # the file that keeps a run
REPORT = "report.html"  # of ``wayfarer report``: it goes with its run, because it only shows what the log says
WHOLE_NAME = re.compile(RUN_NAME.pattern + r"(-[0-9a-f]{8})?\Z", re.ASCII)
TOO_MUCH = "the runs that must not be deleted take more than keep_mb: the newest, the open and the kept ones"


class Pruned(NamedTuple):
    """What was deleted, oldest first, how much it was, and how much remains.

    ``trouble`` says why more than the limit remains; None if it does not.
    """

    deleted: tuple[str, ...]
    deleted_mb: float
    left_mb: float
    trouble: str | None = None


def prune(
    logs: Path, keep_mb: float, may_delete: Callable[[], bool] = lambda: True, *, dry_run: bool = False
) -> Pruned:
    """Delete the oldest runs until all take at most ``keep_mb`` (1,000,000 bytes each); or only say which would go.

    Args:
        logs: the folder of all runs.
        keep_mb: how much is kept.
        may_delete: asked before each run, whether it may be deleted now.
        dry_run: change nothing.
    """
    deleted: list[str] = []
    left_mb = deleted_mb = 0.0
    trouble: str | None = None
    try:
        with _opened(logs) as folder:
            with os.scandir(folder) as entries:
                folders = [each for each in entries if each.is_dir(follow_symlinks=False)]
            for left in [each for each in folders if each.name.startswith(DELETING) and not dry_run]:
                with suppress(OSError):  # a power cut has left it
                    if left.stat(follow_symlinks=False).st_uid == os.geteuid():
                        _delete(folder, left.name)
            runs = sorted((int(run[1]), run.string) for each in folders if (run := RUN_NAME.match(each.name)))
            sizes_mb = {name: _look(folder, name)[0] for _, name in runs}
            left_mb = sum(sizes_mb.values())
            for name in list(sizes_mb)[:-1]:
                if left_mb <= keep_mb or not may_delete():
                    break
                try:
                    gone = _look(folder, name)[1] is not None and (dry_run or _delete(folder, name))
                except FileNotFoundError:  # somebody else deletes it
                    gone = False
                except OSError as error:
                    gone, trouble = False, f"{name}: {error_advice(error)}"
                if gone:
                    deleted.append(name)
                    deleted_mb += sizes_mb[name]
                    left_mb -= sizes_mb[name]
    except FileNotFoundError:
        pass
    except OSError as error:
        trouble = f"{logs}: {error_advice(error)}"
    if left_mb > keep_mb and trouble is None and may_delete():
        trouble = TOO_MUCH
    return Pruned(tuple(deleted), round(deleted_mb, 1), round(left_mb, 1), trouble)


def keep_run(run: Path) -> None:
    """Make the file that keeps a run.

    Raises:
        OSError: it cannot be made, and there is none.
    """
    with _opened(run) as folder, suppress(FileExistsError):
        os.close(os.open(KEEP, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644, dir_fd=folder))
        os.fsync(folder)


def _look(logs: int, name: str) -> tuple[float, list[str] | None]:
    """Return how large a folder is in MB, and its files if it may be deleted: it is exactly a run of this user's."""
    me, may_go = os.geteuid(), WHOLE_NAME.match(name.removeprefix(DELETING)) is not None
    try:
        with _opened(name, logs) as folder:
            with os.scandir(folder) as entries:
                files = {each.name: each.stat(follow_symlinks=False) for each in entries}
            may_go = may_go and os.fstat(folder).st_uid == me and not _is_written(folder)
    except OSError:  # nobody's to look into
        return 0.0, None
    for file, its in files.items():
        own_part = its.st_uid == me and PART_NAME.match(file)  # a report may have been made with sudo
        may_go = may_go and stat.S_ISREG(its.st_mode) and bool(own_part or file == REPORT)
    return sum(its.st_size for its in files.values()) / MB, list(files) if may_go else None


def _is_written(folder: int) -> bool:
    """Return whether a process writes the run in an open folder: its sink has a lock on it then."""
    with suppress(OSError):  # some file systems have no locks
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _delete(logs: int, name: str) -> bool:
    """Delete a run; return whether it went. Under another name nobody can put a file into it by its path any more."""
    hidden = name
    if not name.startswith(DELETING):
        hidden = DELETING + name
        os.rename(name, hidden, src_dir_fd=logs, dst_dir_fd=logs)
        os.fsync(logs)  # before its first file goes: a power cut must not show half a run
    files = _look(logs, hidden)[1]
    if files is None:
        os.rename(hidden, hidden.removeprefix(DELETING), src_dir_fd=logs, dst_dir_fd=logs)
        return False
    with _opened(hidden, logs) as folder:
        for file in files:
            os.unlink(file, dir_fd=folder)
    os.rmdir(hidden, dir_fd=logs)
    return True


@contextmanager
def _opened(path: Path | str, within: int | None = None) -> Iterator[int]:
    """Yield a folder's descriptor, by which its files are named even if its path changes; within one, no symlink."""
    flags = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | (0 if within is None else os.O_NOFOLLOW)
    folder = os.open(path, flags, dir_fd=within)
    try:
        yield folder
    finally:
        os.close(folder)
