"""The folders of runs: how they are named, and finding one again.

A folder is named by a counter, which no clock can turn back, and the time in UTC at which the run began:
``00017-20261121T061405Z``. The counter is the order; the time is for people, and wrong where the clock was.
"""

from __future__ import annotations

import time
from pathlib import Path

from wayfarer.errors import BadInput

FILE_NAME = "run.jsonl"  # the newest part of a run's log; older ones are run.00001.jsonl and so on


def new_run_folder(logs: Path) -> Path:
    """Return the name of the next run's folder.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    last = max((number for path in _entries(logs) if (number := _number(path)) is not None), default=0)
    return logs / f"{last + 1:05d}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}"


def run_folders(logs: Path) -> list[Path]:
    """Return the folders of all runs, oldest first; none where there is no such folder.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    numbered = [(number, path) for path in _entries(logs) if (number := _number(path)) is not None and path.is_dir()]
    return [path for _, path in sorted(numbered)]


def find_run(name: str | None, logs: Path) -> Path:
    """Return the folder of a run.

    Args:
        name: its number (``17``), its folder's name, or the path of its folder or of its ``run.jsonl``; None or
            ``last`` is the newest.
        logs: the folder of all runs.

    Raises:
        BadInput: there is no such run; the text says which there are.
    """
    runs = run_folders(logs)
    if name is None or name == "last":
        if not runs:
            raise BadInput(f"{logs} holds no run; say where runs are logged with --logs DIR, or give a run's folder")
        return runs[-1]
    for run in runs:
        if run.name == name or (name.isdecimal() and _number(run) == int(name)):
            return run
    path = Path(name)
    if path.is_file() and path.suffix == ".jsonl":
        return path.parent
    if path.is_dir() and any(path.glob("run*.jsonl")):
        return path
    if path.is_dir():
        raise BadInput(f"{name} is no run: there is no {FILE_NAME} in it")
    if path.exists():
        raise BadInput(f"{name} is no field log: a run is a folder with a {FILE_NAME} in it")
    there = f"{logs} holds {runs[0].name} to {runs[-1].name}" if runs else f"{logs} holds none"
    raise BadInput(f"there is no run '{name}': {there} (see wayfarer logs list)")


def _entries(logs: Path) -> list[Path]:
    try:
        return list(logs.iterdir()) if logs.exists() else []
    except OSError as error:
        raise BadInput(f"{logs}: the logs' folder cannot be read: {error.strerror}") from None


def _number(path: Path) -> int | None:
    number = path.name.partition("-")[0]
    return int(number) if number.isdecimal() else None
