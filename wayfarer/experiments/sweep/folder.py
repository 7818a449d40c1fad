"""The results folder of a sweep: partial results that survive a crash, and the final files.

``sweep.json`` is written first and says whose folder this is. While the sweep runs, each finished trial is appended to
``trials.partial.csv`` in the order of completion; a line that a crash cut short is dropped on resuming. At the end
``trials.csv`` and ``trials.parquet`` appear whole, one row a trial with the swept values before its own columns.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.parquet import ParquetRows, types_of
from wayfarer.experiments.results_folder import differences, write_whole
from wayfarer.experiments.rows import COLUMNS, TrialRow, csv_line, parse_row, without_kinds
from wayfarer.experiments.sweep.axes import Axis
from wayfarer.experiments.sweep.grid import PointTask, Sweep
from wayfarer.fieldlog.atomic_file import whole_file

SETTINGS = "sweep.json"
PARTIAL = "trials.partial.csv"
TRIALS = "trials.csv"
PARQUET = "trials.parquet"
KEPT = (*COLUMNS, "ticks")  # of the partial file, after the point


class SweepFolder:
    """A sweep's folder, locked while it is open; ``kept`` holds the trials of an earlier run.

    Raises:
        BadInput: the folder is not empty and not to be resumed, belongs to another sweep, is in use or cannot be
            written.
    """

    def __init__(self, path: Path, sweep: Sweep, *, resume: bool = False) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise BadInput(f"{path} cannot be used for the output: {error.strerror}; it needs a folder") from None
        try:
            self._take_lock()
            self.kept = self._claim(sweep, resume)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others use the folder."""
        os.close(self._lock)

    def append(self, point: int, row: TrialRow) -> None:
        """Keep a finished trial of a point, whatever happens to this process next.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        with self._writing(), (self.path / PARTIAL).open("a", encoding="utf-8") as partial:
            partial.write(f"{point},{csv_line(KEPT, row)}")

    def finish(self, sweep: Sweep, rows: Mapping[PointTask, TrialRow]) -> None:
        """Write the final files; ``rows`` are all there are, in their final order.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        if (self.path / TRIALS).exists():
            return
        values = [point.values for point in sweep.points]
        swept = {axis.key: _kind(axis) for axis in sweep.axes}
        columns = {"point": int, **swept, **types_of(TrialRow, COLUMNS)}
        with self._writing():
            with whole_file(self.path / PARQUET) as draft, ParquetRows(draft, columns) as file:
                for task, row in rows.items():
                    file.append((task.point, *values[task.point], *(getattr(row, name) for name in COLUMNS)))
            lines = (_csv_line(task.point, values[task.point]) + csv_line(COLUMNS, row) for task, row in rows.items())
            write_whole(
                self.path / TRIALS, (_csv_line("point", tuple(swept)) + csv_line(COLUMNS) + "".join(lines)).encode()
            )
            (self.path / PARTIAL).unlink(missing_ok=True)

    def _take_lock(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInput(f"{self.path} is in use by another sweep; wait for it, or give another folder") from None

    def _claim(self, sweep: Sweep, resume: bool) -> dict[PointTask, TrialRow]:
        """Make the folder this sweep's and return the trials that it holds."""
        settings = json.dumps(sweep.settings(), indent=2, allow_nan=False) + "\n"
        if not any(self.path.iterdir()):
            with self._writing():
                write_whole(self.path / SETTINGS, settings.encode())
        elif not resume:
            raise BadInput(f"{self.path} is not empty; give a new folder, or add --resume to go on with what is in it")
        else:
            _refuse_another_sweep(self.path, json.loads(settings))
        if (self.path / TRIALS).exists():
            return read_trials(self.path / TRIALS, COLUMNS, len(sweep.axes))
        _drop_torn_line(self.path / PARTIAL)
        return read_trials(self.path / PARTIAL, KEPT, 0)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise WayfarerError(
                f"{self.path} cannot be written any more: {error.strerror}; mend that, then --resume goes on"
            ) from error


def read_trials(path: Path, fields: tuple[str, ...], axes: int) -> dict[PointTask, TrialRow]:
    """Read a file of trials that has these columns after the point and the values of so many axes.

    Raises:
        BadInput: the file cannot be read, or a line is no row; the text names it.
    """
    try:
        columns, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: cannot be read: {error}") from None
    known = (fields,) if fields == KEPT else (fields, without_kinds(fields))  # a partial file grows on
    there = next((names for names in known if f"{columns}\n".endswith(csv_line(names))), None)
    if there is None:
        raise BadInput(
            f"{path} is damaged, or of another version: its first line names other columns; run the sweep again"
        )
    rows = {}
    for number, line in enumerate(lines, start=2):
        point, *_, rest = line.split(",", axes + 1)
        row = parse_row(rest, there, where := f"{path}, line {number}")
        if not point.isdecimal():
            raise BadInput(f"{where} is not a row of a sweep; remove the line or the folder")
        rows[PointTask(int(point), row.algorithm, row.trial)] = row
    return rows


def _csv_line(point: int | str, values: tuple[Any, ...]) -> str:
    """Return the beginning of a line: the point and its values."""
    return "".join(f"{value}," for value in (point, *values))


def _kind(axis: Axis) -> type:
    """Return the type of an axis's column."""
    kinds = {type(value) for value in axis.values}
    if kinds == {int, float}:
        return float
    return kinds.pop() if len(kinds) == 1 else str


def _drop_torn_line(path: Path) -> None:
    """Leave whole lines only, under a header."""
    text = path.read_bytes() if path.exists() else b""
    whole = text[: text.rfind(b"\n") + 1]
    if not whole:
        path.write_text("point," + csv_line(KEPT), encoding="utf-8")
    elif whole != text:
        os.truncate(path, len(whole))


def _refuse_another_sweep(path: Path, here: Mapping[str, Any]) -> None:
    try:
        there = json.loads((path / SETTINGS).read_text(encoding="utf-8"))
        same_axes = there["axes"] == here["axes"]
        ours, theirs = (_with_ground(settings) for settings in (here, there))
    except (OSError, ValueError, KeyError, TypeError):
        raise BadInput(f"{path} cannot be resumed: it holds no sweep ({SETTINGS} is missing or damaged)") from None
    if not same_axes:
        raise BadInput(
            f"{path} belongs to another sweep: its keys or values differ; repeat them, or give another folder"
        )
    differing = [name for name, *_ in differences(ours, theirs)]
    if differing:
        raise BadInput(
            f"{path} belongs to another sweep: {', '.join(differing)} differ; repeat its settings, "
            "or give another folder"
        )


def _with_ground(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the campaign of a sweep; where grounds are swept it says so, for its points then read the chassis."""
    swept = {axis["key"]: axis["values"] for axis in settings["axes"] if axis["key"] == "ground"}
    return {**settings["campaign"], **swept}
