"""Deletes old runs, oldest first, where a person has set how much is kept; otherwise nothing is ever deleted.

Never deleted: the newest run, the open one, what was written within the last day, a run with a person's mark, and a
folder that is not exactly a run: another name or a longer one (a person wrote behind the counter), a symlink, another
user's folder, or one with any other file in it. So ``touch field_logs/00017-.../keep`` keeps a run.

A run's folder is renamed first, and then emptied. A power cut leaves a run that is whole, or a hidden folder that no
tool takes for a run and that the next deletion removes.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from wayfarer.config.rover_file import LogSettings
from wayfarer.fieldlog.clock import CLOCK_SET_S
from wayfarer.fieldlog.disk import MB, error_advice
from wayfarer.fieldlog.folders import DELETING, FILE_NAME, RUN_NAME, SEGMENT_NAME
from wayfarer.fieldlog.run_ages import StoredRun, over_limits

MARK = re.compile(rb'"name": ?"mark"')  # the event; in a person's text the quotes are escaped
MARK_BYTES = 20  # more than it is long
KEEP = "keep"  # the file that a run with a mark gets, so that its log is searched once
CHUNK_BYTES = 1_000_000
WHOLE_NAME = re.compile(RUN_NAME.pattern + r"(-[0-9a-f]{8})?\Z", re.ASCII)
OPEN_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


class Pruned(NamedTuple):
    """What was deleted, oldest first, and how much it was; ``left`` runs remain with ``left_mb``.

    ``trouble`` says why runs that are over the limits remain; None where nothing hindered.
    """

    deleted: tuple[str, ...]
    deleted_mb: float
    left: int
    left_mb: float
    trouble: str | None = None


def prune(
    logs: Path, settings: LogSettings, now_wall_s: float, open_run: str | None = None, *, dry_run: bool = False
) -> Pruned:
    """Delete the runs that are over the limits; with ``dry_run`` only say which they are.

    Args:
        logs: the folder of all runs.
        settings: how much is kept, as ``keep_days`` and ``keep_mb``.
        now_wall_s: the wall clock in seconds since 1970; while it was never set, nothing is deleted.
        open_run: the name of a run that is being written.
        dry_run: change nothing.
    """
    try:
        with _opened(logs) as folder:
            if not dry_run:
                _finish_deletions(folder)
            runs = stored_runs(folder)
            over = over_limits(
                runs,
                settings,
                now_wall_s,
                lambda name: name != open_run and _is_unmarked(folder, name, dry_run=dry_run),
            )
            gone, trouble = (over, None) if dry_run else _delete_all(folder, over)
    except FileNotFoundError:
        return Pruned((), 0.0, 0, 0.0)
    except OSError as error:
        return Pruned((), 0.0, 0, 0.0, f"{logs}: {error_advice(error)}")
    gone_mb = sum(run.mb for run in gone)
    left_mb = sum(run.mb for run in runs) - gone_mb
    if now_wall_s < CLOCK_SET_S:
        trouble = "no run is deleted while the clock is not set"
    elif settings.keep_mb is not None and left_mb > settings.keep_mb and trouble is None:
        trouble = "the runs that may not be deleted are more than keep_mb: those of a day, and the marked and kept ones"
    names = tuple(run.name for run in gone)
    return Pruned(names, round(gone_mb, 1), len(runs) - len(gone), round(left_mb, 1), trouble)


def stored_runs(logs: int) -> list[StoredRun]:
    """Return all numbered runs in an open folder, the newest last; those of other names are nobody's to delete."""
    with os.scandir(logs) as entries:
        names = [entry.name for entry in entries if RUN_NAME.match(entry.name)]
    found = [run for name in names if (run := _stored(logs, name)) is not None]
    return sorted(found, key=lambda run: (int(run.name.partition("-")[0]), run.name))


def _stored(logs: int, name: str) -> StoredRun | None:
    """Return what is known of a run, None where it is no folder that may be looked into."""
    try:
        with _opened(name, logs) as folder:
            files, own = _files(folder), os.fstat(folder)
    except OSError:
        return None
    written_s = [its.st_mtime for file, its in files.items() if _is_log_name(file)]
    only_a_run = own.st_uid == os.geteuid() and all(_is_log_file(file, its) for file, its in files.items())
    return StoredRun(
        name,
        sum(its.st_size for its in files.values()) / MB,
        max(written_s, default=own.st_mtime),
        only_a_run and WHOLE_NAME.match(name) is not None,
    )


def _files(folder: int) -> dict[str, os.stat_result]:
    """Return what is in an open folder; a symlink stands for itself."""
    with os.scandir(folder) as entries:
        return {entry.name: entry.stat(follow_symlinks=False) for entry in entries}


def _is_log_file(name: str, its: os.stat_result) -> bool:
    return _is_log_name(name) and stat.S_ISREG(its.st_mode) and its.st_uid == os.geteuid()


def _is_log_name(name: str) -> bool:
    return name == FILE_NAME or SEGMENT_NAME.match(name) is not None


# -- deleting --------------------------------------------------------------------------------------------------------


def _delete_all(logs: int, runs: Sequence[StoredRun]) -> tuple[list[StoredRun], str | None]:
    """Delete runs; return those that went, and what went wrong."""
    gone, trouble = [], None
    for run in runs:
        try:
            _delete(logs, run.name)
        except FileNotFoundError:  # somebody else deletes it
            continue
        except OSError as error:
            trouble = f"{run.name}: {error_advice(error)}"
            continue
        gone.append(run)
    return gone, trouble


def _is_unmarked(logs: int, name: str, *, dry_run: bool) -> bool:
    """Return whether nobody has marked anything in a run; one with a mark gets the file ``keep``."""
    try:
        with _opened(name, logs) as run:
            if not any(_holds_mark(run, file) for file in _files(run)):
                return True
            if not dry_run:
                os.close(os.open(KEEP, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644, dir_fd=run))
    except OSError:  # nobody knows whether it is marked, or it is searched again next time
        pass
    return False


def _holds_mark(run: int, name: str) -> bool:
    with os.fdopen(os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=run), "rb", 0) as file:
        before = b""
        while chunk := file.read(CHUNK_BYTES):
            if MARK.search(before + chunk):
                return True
            before = chunk[-MARK_BYTES:]
    return False


def _delete(logs: int, name: str) -> None:
    hidden = DELETING + name
    os.rename(name, hidden, src_dir_fd=logs, dst_dir_fd=logs)
    os.fsync(logs)  # before its first file goes: a power cut must not show half a run
    _empty(logs, hidden)


def _finish_deletions(logs: int) -> None:
    """Remove what a power cut left of runs that were being deleted."""
    for name in os.listdir(logs):
        if name.startswith(DELETING) and WHOLE_NAME.match(name.removeprefix(DELETING)):
            with suppress(OSError):
                _empty(logs, name)


def _empty(logs: int, name: str) -> None:
    """Remove a folder with the files of a log in it, through no symlink; what else is in it stays, and so does it."""
    with _opened(name, logs) as folder:
        for file, its in _files(folder).items():
            if _is_log_file(file, its):
                os.unlink(file, dir_fd=folder)
    os.rmdir(name, dir_fd=logs)


@contextmanager
def _opened(path: Path | str, within: int | None = None) -> Iterator[int]:
    """Give a folder's descriptor, by which its files are named whatever becomes of its path; within one, no symlink."""
    folder = os.open(path, OPEN_FOLDER | (0 if within is None else os.O_NOFOLLOW), dir_fd=within)
    try:
        yield folder
    finally:
        os.close(folder)
