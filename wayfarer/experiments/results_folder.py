"""The results folder of a campaign or a sweep: partial results that survive a crash, and the final files.

``campaign.json`` or ``sweep.json`` is written first and says whose folder this is; ``forests.jsonl``
beside it is a copy of a campaign's forest file, if it has one, so that its trials can be run again, and ``runs.json``
says how they were made (``provenance``). While it runs, each finished trial is appended to ``trials.partial.csv`` in
the order of completion, with a checksum. At the end ``trials.csv``, the same as ``trials.parquet``, and the
``summary.json`` of a campaign appear whole, and the partial file goes. A line that a crash cut short has no newline;
resuming drops it and runs that trial again. A line that was changed is refused: it would end in the tables without a
sign.

The folder may have come from somebody else: only ordinary files are read, and nothing is written through a symlink.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from typing import Any, Self

from wayfarer.config.messages import shortened, shown
from wayfarer.config.rover_file import flat
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.campaign import Tasks
from wayfarer.experiments.provenance import record_run
from wayfarer.experiments.rows import TrialRow, columns_of, copy_as_parquet, csv_line
from wayfarer.experiments.store import CHECKSUM, TrialStore
from wayfarer.files import atomic_file, open_regular, open_to_append, read_regular, write_atomically

SETTINGS = "campaign.json"
SWEEP_SETTINGS = "sweep.json"
FORESTS = "forests.jsonl"
PARTIAL = "trials.partial.csv"
TRIALS = "trials.csv"
PARQUET = "trials.parquet"
SUMMARY = "summary.json"
VERSIONS = {"version", "campaign.version"}  # where the settings of a campaign and of a sweep have it
MOST_BYTES = 10_000_000  # of a settings' file: a sweep of two keys with all the values that fit a command line has less


class ResultsFolder:
    """The folder of a campaign or sweep with these ``settings`` (``Campaign.settings``), locked while it is open.

    ``kept`` are its finished trials; ``complete`` says that they are all there are. ``command``, the command line, is
    noted where trials are still to be run.

    Raises:
        BadInput: the folder is not empty and not to be resumed, belongs to another campaign, is in use or
            cannot be written.
    """

    def __init__(
        self,
        path: Path,
        settings: Mapping[str, Any],
        *,
        resume: bool = False,
        command: Sequence[str] | None = None,
    ) -> None:
        self.path = path
        self._settings = settings
        self._columns = columns_of(settings)
        with _one_line_errors(path):
            path.mkdir(parents=True, exist_ok=True)
            self._open = ExitStack()
            with self._open:
                self._open.callback(os.close, _locked(path, kind_of(settings)))
                self.kept = self._claim(resume)
                if not self.complete:
                    record_run(path, command)
                self._open = self._open.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others use the folder."""
        self._open.close()

    @property
    def complete(self) -> bool:
        """Return whether the final files are there."""
        return (self.path / TRIALS).exists() and not (self.path / PARTIAL).exists()

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
            self.kept.append(row)

    def into_tables(self, rows: Iterable[TrialRow]) -> Iterator[TrialRow]:
        """Pass on ``rows``, in their final order, and write them: the tables are there when the last has passed.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        values = swept_values(self._settings)
        with (
            self._writing(),
            atomic_file(self.path / TRIALS) as draft,
            atomic_file(self.path / PARQUET) as parquet_draft,
        ):
            draft.write(csv_line(self._columns).encode())
            for row in rows:
                draft.write(csv_line(self._columns, row, values[row.point]).encode())
                yield row
            draft.seek(0)
            copy_as_parquet(draft, parquet_draft, values)

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Write the summary, which a sweep does not have; with it the campaign is complete.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        with self._writing():
            if kind_of(self._settings) == "campaign":
                write_atomically(self.path / SUMMARY, _json(summary))
            (self.path / PARTIAL).unlink()

    def _claim(self, resume: bool) -> TrialStore:
        """Make the folder this campaign's and return the trials that it holds."""
        if not any(self.path.iterdir()):
            write_atomically(self.path / f"{kind_of(self._settings)}.json", _json(self._settings))
        elif not resume:
            raise BadInput(f"{self.path} is not empty; give a new folder, or add --resume to continue what is in it")
        else:
            _refuse_another(self.path, self._settings)
        return self._trials()

    def _trials(self) -> TrialStore:
        """Return the trials of the final table, or those of a campaign that is not finished, which takes more."""
        if self.complete:
            return self._open.enter_context(finished_trials(self.path, self._settings))
        path = self.path / PARTIAL
        file = self._open.enter_context(open_to_append(path))
        return TrialStore(file, tasks_of(self._settings), partial_columns(self._settings), str(path))

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise WayfarerError(
                f"{self.path} cannot be written any more: {error.strerror or error}; fix that, then use --resume"
            ) from error


@contextmanager
def finished_trials(folder: Path, settings: Mapping[str, Any]) -> Iterator[TrialStore]:
    """Open the final table of a campaign or sweep with these settings.

    Raises:
        BadInput: the table is damaged, or has not all trials.
        OSError: it is no ordinary file, or cannot be read.
    """
    path = folder / TRIALS
    with open_regular(path) as file:
        kept = TrialStore(file, tasks_of(settings), columns_of(settings), str(path))
        if len(kept) < kept.total:
            raise BadInput(
                f"{path} is damaged: it has {len(kept)} of {kept.total} trials; run them again into another folder"
            )
        yield kept


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    try:
        if path.is_file():
            raise BadInput(f"{path} is a file; the output needs a new or empty folder")
        yield
    except OSError as error:
        where = error.filename or path
        raise BadInput(f"{where} cannot be used for the output: {error.strerror or error}") from error


def _locked(path: Path, kind: str) -> int:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise BadInput(f"{path} is in use by another {kind}; wait for it, or give another folder") from None
    return descriptor


def partial_columns(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the columns of ``trials.partial.csv``: those that are fields of a row, the ticks, and a checksum."""
    return (*(name for name in columns_of(settings) if name in TrialRow._fields), "ticks", CHECKSUM)


def _json(value: Mapping[str, Any]) -> bytes:
    return (json.dumps(value, indent=2, allow_nan=False) + "\n").encode()


# -- the settings that a folder keeps ----------------------------------------------------------------------------------


def kind_of(settings: Mapping[str, Any]) -> str:
    """Return ``sweep`` or ``campaign``: what has these settings, as errors and their file call it."""
    return "sweep" if "axes" in settings else "campaign"


def tasks_of(settings: Mapping[str, Any]) -> Tasks:
    """Return every trial of the campaign or sweep that has these settings."""
    campaign = settings.get("campaign", settings)
    return Tasks(campaign["algorithms"], campaign["trials"], len(swept_values(settings)))


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
