"""The results folder of a campaign or a sweep: finished trials survive a crash, and are put in order at the end.

``campaign.json`` or ``sweep.json`` is written first and says whose folder this is; ``forests.jsonl`` beside it is a
copy of a campaign's forest file, if it has one, so that its trials can be run again, and ``runs.json`` says how they
were made (``provenance``). While it runs, each finished trial is appended to ``trials.csv`` in the order of completion.
When none is missing ``trials.csv`` is written again, by point, algorithm and trial. A line that a crash cut short has
no newline; resuming drops it and runs that trial again.

The folder may have come from somebody else: only ordinary files are read, and nothing is written through a symlink.
"""

from __future__ import annotations

import fcntl
import json
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count, product
from pathlib import Path
from typing import Any, BinaryIO, Self

from wayfarer.config.messages import shortened, shown
from wayfarer.config.rover_file import flat
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.campaign import Task
from wayfarer.experiments.provenance import record_run
from wayfarer.experiments.rows import TrialRow, columns_of, csv_line, parse_row
from wayfarer.files import open_to_append, read_regular, write_atomically

SETTINGS = "campaign.json"
SWEEP_SETTINGS = "sweep.json"
FORESTS = "forests.jsonl"
TRIALS = "trials.csv"
VERSIONS = {"version", "campaign.version"}  # where the settings of a campaign and of a sweep have it
MOST_BYTES = 10_000_000  # of a settings' file: a sweep of two keys with all the values that fit a command line has less
MOST_LINE_BYTES = 100_000  # far more than any row: a file without line ends must not fill the memory


class ResultsFolder:
    """The folder of a campaign or sweep with these ``settings`` (``Campaign.settings``), locked while it is open.

    ``rows`` are the trials that were in it when it was opened, and ``finished`` says that all are there, in
    the final order. ``command``, the command line, is noted if that is not so. ``notice`` gets a sentence if nothing
    keeps another campaign out.

    Raises:
        BadInput: the folder is not empty and not to be resumed, belongs to another campaign, is in use, damaged or
            cannot be written.
    """

    def __init__(
        self,
        path: Path,
        settings: Mapping[str, Any],
        *,
        resume: bool = False,
        command: Sequence[str] | None = None,
        notice: Callable[[str], object] = warnings.warn,
    ) -> None:
        self.path = path
        self._settings = settings
        self._columns, self._swept = columns_of(settings), swept_values(settings)
        with _one_line_errors(path):
            path.mkdir(parents=True, exist_ok=True)
            self._open = ExitStack()
            with self._open:
                self._open.callback(os.close, _locked(path, kind_of(settings), notice))
                self._claim(resume)
                self._file = self._open.enter_context(open_to_append(path / TRIALS))
                self.rows = self._kept()
                has_all = len(self.rows) == count_of(settings)
                self.finished = has_all and self.rows == in_table_order(self.rows, settings)
                if not self.finished:
                    record_run(path, command)
                self._open = self._open.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others use the folder."""
        self._open.close()

    def keep_forests(self, content: bytes) -> None:
        """Keep a copy of the campaign's forest file; the report compares its checksum with the settings'.

        Raises:
            WayfarerError: the folder cannot be written.
        """
        with self._writing():
            write_atomically(self.path / FORESTS, content)

    def append(self, row: TrialRow) -> None:
        """Keep a finished trial, safe from a crash of this process.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        with self._writing():
            self._write(self._line(row))

    def finish(self, rows: Sequence[TrialRow]) -> None:
        """Write all ``rows``, which are in their final order.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        table = [csv_line(self._columns).encode(), *map(self._line, rows)]
        with self._writing():
            write_atomically(self.path / TRIALS, b"".join(table))
        self.finished = True

    def _claim(self, resume: bool) -> None:
        """Make the folder this campaign's."""
        if not any(self.path.iterdir()):
            write_atomically(self.path / f"{kind_of(self._settings)}.json", _json(self._settings))
        elif not resume:
            raise BadInput(f"{self.path} is not empty; give a new folder, or add --resume to continue what is in it")
        else:
            _refuse_another(self.path, self._settings)

    def _kept(self) -> list[TrialRow]:
        """Read what is there; the next row is to come behind its last whole line."""
        rows, end = read_rows(self._file, self._settings, str(self.path / TRIALS))
        os.truncate(self._file.fileno(), end)  # nothing of a torn line may stay behind the next one
        os.lseek(self._file.fileno(), end, os.SEEK_SET)
        if not end:
            self._write(csv_line(self._columns).encode())
        return rows

    def _write(self, line: bytes) -> None:
        """Write a line at once: a buffer would try again when it is closed, on a disk that is still full."""
        while line:
            line = line[os.write(self._file.fileno(), line) :]

    def _line(self, row: TrialRow) -> bytes:
        return csv_line(self._columns, row, self._swept[row.point]).encode()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise WayfarerError(
                f"{self.path} cannot be written any more: {error.strerror or error}; fix that, then use --resume"
            ) from error


def read_rows(file: BinaryIO, settings: Mapping[str, Any], name: str) -> tuple[list[TrialRow], int]:
    """Return the rows of an open ``trials.csv`` in its order, and where its last whole line ends.

    A last line that a crash cut short is left out, also if it is the first one.

    Raises:
        BadInput: the file has other columns, a line is no row of these trials, or a trial is there twice; the text
            says in which line, and calls the file ``name``.
    """
    columns = columns_of(settings)
    header, first = csv_line(columns).encode(), file.readline(MOST_LINE_BYTES)
    if first != header and header.startswith(first):
        return [], 0
    if first != header:
        raise BadInput(
            f"{name} is damaged, or was written by another version: its first line does not name its columns; "
            "run the trials again into another folder"
        )
    campaign, points = _campaign(settings), swept_values(settings)
    rows: dict[Task, TrialRow] = {}
    end = len(header)
    for number in count(2):
        line = file.readline(MOST_LINE_BYTES)
        if not line.endswith(b"\n") and len(line) < MOST_LINE_BYTES:
            break
        row = parse_row(line, columns, f"{name}, line {number}", points[0])
        if row.algorithm not in campaign["algorithms"] or row.trial >= campaign["trials"] or row.point >= len(points):
            at = f" at point {row.point}" if row.point else ""
            raise BadInput(
                f"{name}, line {number} is damaged: there is no trial {row.trial} of {shown(row.algorithm)}{at}; "
                "remove the line"
            )
        if rows.setdefault(Task(*row.key), row) is not row:
            raise BadInput(
                f"{name}, line {number} is damaged: it is a second row of trial {row.trial} of {shown(row.algorithm)}; "
                "remove one of them"
            )
        end += len(line)
    return list(rows.values()), end


def in_table_order(rows: Sequence[TrialRow], settings: Mapping[str, Any]) -> list[TrialRow]:
    """Return rows in the order of a finished ``trials.csv``: by point, algorithm as asked, and number."""
    place = {name: number for number, name in enumerate(_campaign(settings)["algorithms"])}
    return sorted(rows, key=lambda row: (row.point, place[row.algorithm], row.trial))


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    try:
        if path.is_file():
            raise BadInput(f"{path} is a file; the output needs a new or empty folder")
        yield
    except OSError as error:
        where = error.filename or path
        raise BadInput(f"{where} cannot be used for the output: {error.strerror or error}") from error


def _locked(path: Path, kind: str, notice: Callable[[str], object]) -> int:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise BadInput(f"{path} is in use by another {kind}; wait for it, or give another folder") from None
    except OSError as error:  # some network filesystems have no locks
        notice(f"{path} cannot be locked ({error.strerror or error}): let no other {kind} write into it meanwhile")
    return descriptor


def _json(value: Mapping[str, Any]) -> bytes:
    return (json.dumps(value, indent=2, allow_nan=False) + "\n").encode()


# -- the settings that a folder keeps ----------------------------------------------------------------------------------


def kind_of(settings: Mapping[str, Any]) -> str:
    """Return ``sweep`` or ``campaign``: what has these settings, as errors and their file call it."""
    return "sweep" if "axes" in settings else "campaign"


def tasks_of(settings: Mapping[str, Any]) -> list[Task]:
    """Return every trial of the campaign or sweep that has these settings, in the order of running.

    A forest serves all algorithms of a point, then comes the next.
    """
    campaign = _campaign(settings)
    points = range(len(swept_values(settings)))
    return [
        Task(name, trial, point) for trial in range(campaign["trials"]) for point in points
        for name in campaign["algorithms"]
    ]  # fmt: skip


def missing(settings: Mapping[str, Any], rows: Iterable[TrialRow]) -> list[Task]:
    """Return those of them that have no row, in the order of running."""
    done = {row.key for row in rows}
    return [task for task in tasks_of(settings) if task not in done]


def count_of(settings: Mapping[str, Any]) -> int:
    """Return how many trials that are."""
    campaign = _campaign(settings)
    found: int = len(campaign["algorithms"]) * campaign["trials"] * len(swept_values(settings))
    return found


def _campaign(settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the settings of the campaign, which a sweep has among its own."""
    found: Mapping[str, Any] = settings.get("campaign", settings)
    return found


def swept_values(settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the value of each swept key at each point, the last key varying fastest; a campaign is one point."""
    axes = settings.get("axes", ())
    points = product(*(axis["values"] for axis in axes))
    return [dict(zip((axis["key"] for axis in axes), values, strict=True)) for values in points]


def _refuse_another(path: Path, settings: Mapping[str, Any]) -> None:
    """Refuse a folder that does not belong to the campaign or sweep that has these settings.

    Raises:
        BadInput: it belongs to another one, or to another version's; the text names the first difference.
    """
    kind = kind_of(settings)
    here = _by_name(json.loads(json.dumps(settings)))
    try:
        there = _by_name(json.loads(read_regular(path / f"{kind}.json", MOST_BYTES)))
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        raise BadInput(f"{path} cannot be resumed: it holds no {kind} ({kind}.json is missing or damaged)") from None
    for name in (*here, *there):
        if here.get(name) != there.get(name):
            raise BadInput(
                f"{path} belongs to another {kind}: {shortened(name)} is {shown(there.get(name))} there and "
                f"{shown(here.get(name))} here; repeat its settings, or give another folder"
            )


def _by_name(settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings by their dotted names, those of a sweep's axes by their numbers too.

    Of a version only the release counts: a commit between two releases does not end a campaign.
    """
    named = flat(settings | {"axes": dict(enumerate(settings.get("axes", ()), start=1))})
    return named | {name: str(named[name]).partition("+")[0] for name in VERSIONS & named.keys()}
