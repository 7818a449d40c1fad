"""Deletes the oldest runs while all together take more than a person has set; otherwise nothing is ever deleted.

The oldest is the one with the lowest counter, whatever a clock says. Never deleted: the newest run, one that a process
writes, and a folder that is not exactly a run: another name or a longer one (a person wrote behind the counter), a
symlink, another user's folder, or one with any other file in it, but for its report. So the file ``keep``, which
``wayfarer mark`` makes, keeps a run.

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

from wayfarer.fieldlog.disk import MB, error_advice
from wayfarer.fieldlog.folders import DELETING, PART_NAME, RUN_NAME

KEEP = "keep"  # the file that keeps a run
REPORT = "report.html"  # of ``wayfarer report``: it goes with its run, because it only shows what the log says
WHOLE_NAME = re.compile(RUN_NAME.pattern + r"(-[0-9a-f]{8})?\Z", re.ASCII)
OPEN_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


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
    deleted, deleted_mb, trouble = [], 0.0, None
    try:
        with _opened(logs) as folder:
            if not dry_run:
                _finish_deletions(folder)
            sizes_mb = {name: _size_mb(folder, name) for name in _run_names(folder)}
            left_mb = sum(sizes_mb.values())
            for name in list(sizes_mb)[:-1]:
                if left_mb <= keep_mb or not may_delete():
                    break
                try:
                    gone = _is_deletable(folder, name) if dry_run else _delete(folder, name)
                except FileNotFoundError:  # somebody else deletes it
                    gone = False
                except OSError as error:
                    gone, trouble = False, f"{name}: {error_advice(error)}"
                if gone:
                    deleted.append(name)
                    deleted_mb += sizes_mb[name]
                    left_mb -= sizes_mb[name]
    except FileNotFoundError:
        return Pruned((), 0.0, 0.0)
    except OSError as error:
        return Pruned((), 0.0, 0.0, f"{logs}: {error_advice(error)}")
    if left_mb > keep_mb and trouble is None and may_delete():
        trouble = "the runs that may not be deleted are more than keep_mb: the newest, the open and the kept ones"
    return Pruned(tuple(deleted), round(deleted_mb, 1), round(left_mb, 1), trouble)


def keep_run(run: Path) -> None:
    """Make the file that keeps a run.

    Raises:
        OSError: it cannot be made, and there is none.
    """
    with _opened(run) as folder, suppress(FileExistsError):
        os.close(os.open(KEEP, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644, dir_fd=folder))
        os.fsync(folder)


def _run_names(logs: int) -> list[str]:
    """Return the numbered runs in an open folder, the newest last; those of other names are nobody's to delete."""
    with os.scandir(logs) as entries:
        names = [entry.name for entry in entries if RUN_NAME.match(entry.name) and entry.is_dir(follow_symlinks=False)]
    return sorted(names, key=lambda name: (int(name.partition("-")[0]), name))


def _size_mb(logs: int, name: str) -> float:
    try:
        with _opened(name, logs) as folder:
            return sum(its.st_size for its in _files(folder).values()) / MB
    except OSError:  # nobody's to look into
        return 0.0


def _is_deletable(logs: int, name: str) -> bool:
    """Return whether a folder has a run's name, is this user's, has only files of a run in it, and nobody writes it."""
    if not WHOLE_NAME.match(name.removeprefix(DELETING)):
        return False
    with _opened(name, logs) as folder:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # a file system without locks
            pass
        only_a_run = all(_is_runs_file(file, its) for file, its in _files(folder).items())
        return only_a_run and os.fstat(folder).st_uid == os.geteuid()


def _is_own(entry: os.DirEntry[str]) -> bool:
    return entry.is_dir(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_uid == os.geteuid()


def _files(folder: int) -> dict[str, os.stat_result]:
    """Return what is in an open folder; a symlink stands for itself."""
    with os.scandir(folder) as entries:
        return {entry.name: entry.stat(follow_symlinks=False) for entry in entries}


def _is_runs_file(name: str, its: os.stat_result) -> bool:
    is_log = PART_NAME.match(name) is not None
    is_own = is_log and its.st_uid == os.geteuid()
    return stat.S_ISREG(its.st_mode) and (is_own or name == REPORT)  # which may have been made with sudo


# -- deleting --------------------------------------------------------------------------------------------------------


def _delete(logs: int, name: str) -> bool:
    """Delete a run; return whether it went. Under another name nobody can put a file into it by its path any more."""
    if not _is_deletable(logs, name):
        return False
    hidden = DELETING + name
    os.rename(name, hidden, src_dir_fd=logs, dst_dir_fd=logs)
    os.fsync(logs)  # before its first file goes: a power cut must not show half a run
    return _empty(logs, hidden)


def _finish_deletions(logs: int) -> None:
    """Remove what a power cut left of runs that were being deleted."""
    with os.scandir(logs) as entries:
        hidden = [each.name for each in entries if each.name.startswith(DELETING) and _is_own(each)]
    for name in hidden:
        with suppress(OSError):
            _empty(logs, name)


def _empty(logs: int, name: str) -> bool:
    """Remove a hidden folder with the files of a run in it, or give it its name back if it must stay after all."""
    if not _is_deletable(logs, name):
        os.rename(name, name.removeprefix(DELETING), src_dir_fd=logs, dst_dir_fd=logs)
        return False
    with _opened(name, logs) as folder:
        for file, its in _files(folder).items():
            if _is_runs_file(file, its):
                os.unlink(file, dir_fd=folder)
    os.rmdir(name, dir_fd=logs)
    return True


@contextmanager
def _opened(path: Path | str, within: int | None = None) -> Iterator[int]:
    """Give a folder's descriptor, by which its files are named whatever becomes of its path; within one, no symlink."""
    folder = os.open(path, OPEN_FOLDER | (0 if within is None else os.O_NOFOLLOW), dir_fd=within)
    try:
        yield folder
    finally:
        os.close(folder)
