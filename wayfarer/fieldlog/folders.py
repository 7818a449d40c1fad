"""Folders of runs and their files: their names, finding one again, and the disk that they are on.

A folder is named by a counter, which no clock can turn back, and the time in UTC at which the run began:
``00017-20261121T061405Z``. The counter is the order; the time is for people, and wrong if the clock was. A person
may write on behind the name. Simulated trials have folders of other names, and those that people gave. The files in it,
the parts of the log, are ``run.00001.jsonl``, ``run.00002.jsonl`` and so on.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event

from wayfarer.config.rover_path import STATE_FOLDER
from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.files import open_regular
from wayfarer.waiting_thread import answer_within

SYSTEM_LOGS = STATE_FOLDER / "field_logs"
OWN_LOGS = Path("field_logs")
RUN_NAME = re.compile(r"(\d{1,9})-\d{8}T\d{6}Z", re.ASCII)
DELETING = ".deleting-"  # begins the name of a run's folder that ``retention`` removes
LAST_NUMBER = 999_999_999  # a longer number is not taken for a run's
LONGEST_NAME = 255  # of a file, in bytes
LOCK_TRIES, LOCK_TRY_S = 100, 0.01  # a daemon holds the lock for some milliseconds
LOOK_S = 2.0  # how long a daemon waits for the disk of its logs: it may hang for ever
PART_NAME = re.compile(r"run\.(\d{1,9})\.jsonl(?:\.gz)?\Z", re.ASCII)
LOG_BEGINS = (b"{", b"\xef\xbb\xbf{", b"\x1f\x8b")  # a record, also behind a byte-order mark; what gzip has packed
MB = 1_000_000  # bytes
ADVICE = {
    errno.ENOSPC: "delete old runs",
    errno.EDQUOT: "delete old runs, or ask for a larger quota",
    errno.EROFS: "mount the disk for writing; a card that mounts itself read-only is wearing out (see dmesg)",
    errno.EIO: "the card or disk is failing (see dmesg): save what is on it and replace it",
    errno.ENOTDIR: "a file is in the place of the folder",
    errno.ENOENT: "was it deleted, or is the disk not there?",
    errno.EEXIST: "log into a separate folder",
    errno.EFBIG: "the disk allows no file of this size: set a smaller part_mb",
}


def default_log_folder() -> Path:
    """Return where runs are logged: where the system keeps them if this user may write there, else in this folder."""
    return SYSTEM_LOGS if os.access(SYSTEM_LOGS.parent, os.W_OK) else OWN_LOGS


def new_run_folder(logs: Path, *, needed: bool = True) -> Path:
    """Make the next run's folder, and that of all logs; no other daemon gets the same number.

    Args:
        logs: the folder of all logs.
        needed: if not, and the folder cannot be made at once, only its path is returned; the
            log's sink makes it when that is possible. If the other runs could not be seen, its number may be that of
            one of them.

    Raises:
        BadInput: it cannot be made.
    """
    if not needed:
        return answer_within(LOOK_S, lambda: _new_run_folder(logs, needed=False), logs / _name_after(0))
    return _new_run_folder(logs, needed=True)


def _new_run_folder(logs: Path, *, needed: bool) -> Path:
    last = 0
    try:
        logs.mkdir(parents=True, exist_ok=True)
        with _only_one(logs):
            last = max((number for path in logs.iterdir() if (number := run_number(path)) is not None), default=0)
            folder = logs / _name_after(last)
            folder.mkdir()
    except OSError as error:
        if needed:
            raise BadInput(f"{logs}: no folder can be made for the field log: {error_advice(error)}") from None
        return logs / _name_after(last)
    return folder


def _name_after(last: int) -> str:
    # If another user has made the last one, the number stays and the name has something more.
    name = f"{min(last + 1, LAST_NUMBER):05d}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime(wall_clock(0.0)))}"
    return name if last < LAST_NUMBER else f"{name}-{os.urandom(4).hex()}"


def run_folders(logs: Path) -> list[Path]:
    """Return the folders of all runs, none if there is no such folder.

    Those without a number come first, by name; the newest is the last.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    return [path for path in _folders(logs) if is_run(path)]


def newest_run(logs: Path) -> Path | None:
    """Return the folder of the newest run, None if there is none; quickly, however many there are.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    return next((path for path in reversed(_folders(logs)) if is_run(path)), None)


def _folders(logs: Path) -> list[Path]:
    """Return the folders in the logs' folder, in the order of ``run_folders``."""
    try:
        with os.scandir(logs) as entries:
            names = [entry.name for entry in entries if not entry.name.startswith(DELETING) and _is_folder(entry)]
        return [logs / name for name in sorted(names, key=_place)]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise BadInput(f"{logs}: the logs' folder cannot be read: {error.strerror}") from None


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a symlink to where nobody may look
        return False


def _place(name: str) -> tuple[int, str]:
    number = _number(name, RUN_NAME)
    return -1 if number is None else number, name


def find_run(name: str | None, logs: Path) -> Path:
    """Return the folder of a run, or a file of a log that was copied or renamed.

    Args:
        name: its number (``17``), its folder's name, or the path of its folder, or of a file with records; None or
            ``last`` is the newest.
        logs: the folder of all runs.

    Raises:
        BadInput: there is no such run; the text says which there are.
    """
    if name is None or name == "last":
        newest = newest_run(logs)
        if newest is None:
            raise BadInput(f"{logs} holds no run; give their folder with --log-dir DIR, or give a run's folder")
        return newest
    runs = run_folders(logs)
    number = int(name) if name.isdecimal() and len(name) <= LONGEST_NAME else None
    found = [run for run in runs if run.name == name or (number is not None and run_number(run) == number)]
    if len(found) > 1:
        raise BadInput(
            f"{logs} holds several runs {name}: {', '.join(run.name for run in found)}; give the folder's name"
        )
    return found[0] if found else _run_at(Path(name), logs, runs)


def _run_at(path: Path, logs: Path, runs: list[Path]) -> Path:
    """Return the run at a path."""
    try:
        if path.is_file() and PART_NAME.match(path.name):
            return path.parent
        if path.is_dir() and is_run(path):
            return path
        if path.is_dir():
            raise BadInput(no_run(path))
        if path.is_file():
            with open_regular(path) as file:
                if file.read(4).startswith(LOG_BEGINS):
                    return path
        if path.exists():
            raise BadInput(f"{path} is not a field log: a run is a folder with a {part_name(1)} in it")
    except OSError as error:
        raise BadInput(f"{str(path)[:40]} cannot be a run: {error.strerror}") from None
    there = " to ".join(dict.fromkeys(run.name for run in (*runs[:1], *runs[-1:]))) or "none"
    raise BadInput(f"there is no run and no folder '{path}': {logs} holds {there} (see wayfarer logs list)")


def no_run(folder: Path) -> str:
    """Return why a folder is not a run."""
    if (folder / "run.jsonl").exists():
        return f"{folder}: its log is of an older wayfarer (run.jsonl): read it with that one"
    return f"{folder} is not a run: there is no {part_name(1)} in it"


def part_name(number: int) -> str:
    """Return the name of a part of a run's log, by its number from 1."""
    return f"run.{number:05d}.jsonl"


def part_names(folder: Path | int) -> list[str]:
    """Return the names of the parts of a run's log, oldest first; the folder is a path or an open descriptor.

    Raises:
        OSError: the folder cannot be read.
    """
    with os.scandir(folder) as entries:
        numbered = [(number, each.name) for each in entries if (number := _number(each.name, PART_NAME)) is not None]
    return [name for _, name in sorted(numbered)]


def parts_of(run: Path) -> list[Path]:
    """Return the parts of a run's log, oldest first.

    Raises:
        OSError: the folder cannot be read.
    """
    return [run / name for name in part_names(run)]


def run_number(run: Path) -> int | None:
    """Return the number in the name of a run's folder, None if it has another name."""
    return _number(run.name, RUN_NAME)


def short_name(run: Path) -> str:
    """Return what a run is called in short: its number, else its folder's name."""
    return run.name if (number := run_number(run)) is None else str(number)


def run_title(run: Path) -> str:
    """Return the name of a run's folder, however it was given (``.`` has none), fit for a terminal."""
    return escape_control_chars(run.resolve().name)


def _number(name: str, pattern: re.Pattern[str]) -> int | None:
    match = pattern.match(name)
    return int(match[1]) if match else None


def is_run(path: Path) -> bool:
    """Return whether there is a log in a folder; a run that ended before it began may have left an empty folder."""
    try:
        return path.is_dir() and bool(parts_of(path))
    except OSError:
        return True  # opening it reports the error


@contextmanager
def _only_one(folder: Path) -> Iterator[None]:
    """Keep other processes out of the same lines for one folder, for as long as a daemon can be in them.

    Any user who may read the folder can hold its lock for ever, and a file system may have no locks: neither must keep
    a daemon from starting.
    """
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        for _ in range(LOCK_TRIES):
            try:
                fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                Event().wait(LOCK_TRY_S)
            except OSError:
                break
            else:
                break
        yield
    finally:
        os.close(opened)


# -- the disk --------------------------------------------------------------------------------------------------------


def free_mb(folder: Path) -> float:
    """Return how much may still be written to the disk of a folder.

    Raises:
        OSError: there is no such folder, or its disk does not answer.
    """
    return shutil.disk_usage(folder).free / MB


def total_mb(folder: Path) -> float:
    """Return the size of the disk of a folder; errors as ``free_mb``."""
    return shutil.disk_usage(folder).total / MB


def error_advice(error: OSError) -> str:
    """Return what went wrong and what a person can do about it."""
    if error.errno in {errno.EACCES, errno.EPERM}:
        return f"{error.strerror}: user {os.geteuid()} needs the right to write there; or choose another --log-dir"
    advice = ADVICE.get(error.errno or 0, "look at the disk (df, dmesg)")
    return f"{error.strerror}: {advice}"
