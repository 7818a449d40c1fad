"""The folder of a campaign: what survives a crash, and what is there at the end.

``campaign.json`` is written first and says whose folder this is; ``forests.jsonl`` beside it is a copy of the
campaign's forest file, if it has one, so that its trials can be run again. While the campaign runs, each finished trial
is appended to ``trials.partial.csv`` in the order of completion. At the end ``summary.json`` and
``trials.csv`` appear whole, and the partial file goes. A line that a crash cut short has no newline; resuming
drops it and runs that trial again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from wayfarer.errors import BadInput, WayfarerError
from wayfarer.simhal.rows import COLUMNS, Row, csv_line, parse_row
from wayfarer.whole_file import whole_file

SETTINGS = "campaign.json"
FORESTS = "forests.jsonl"
PARTIAL = "trials.partial.csv"
TRIALS = "trials.csv"
SUMMARY = "summary.json"


class ResultsFolder:
    """A campaign's folder, locked while it is open.

    ``kept`` holds the trials of an earlier run; ``complete`` says that they are all there are.

    Raises:
        BadInput: the folder is not empty and not to be resumed, belongs to another campaign, is in use or
            cannot be written; nothing is left behind then.
    """

    def __init__(self, path: Path, settings: Mapping[str, Any], *, resume: bool = False) -> None:
        self.path = path
        with _one_line_errors(path), _removed_on_failure(path):
            path.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(path)
            try:
                self.kept = self._claim(settings, resume)
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

    @property
    def complete(self) -> bool:
        """Tell whether the final files are there."""
        return (self.path / TRIALS).exists() and not (self.path / PARTIAL).exists()

    def keep_forests(self, file: Path) -> None:
        """Keep a copy of the campaign's forest file; whoever reads it compares its checksum with the settings'.

        Raises:
            WayfarerError: the file cannot be read, or the folder not be written.
        """
        with self._writing():
            write_whole(self.path / FORESTS, file.read_bytes())

    def append(self, row: Row) -> None:
        """Keep a finished trial, whatever happens to this process next.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        with self._writing(), (self.path / PARTIAL).open("a", encoding="utf-8") as partial:
            partial.write(csv_line(row))

    def finish(self, rows: Sequence[Row], summary: Mapping[str, Any]) -> None:
        """Write the final files; ``rows`` are in their final order.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        with self._writing():
            write_whole(self.path / SUMMARY, _json(summary))
            table = csv_line(COLUMNS) + "".join(csv_line(row[:-1]) for row in rows)
            write_whole(self.path / TRIALS, table.encode())
            (self.path / PARTIAL).unlink()

    def _claim(self, settings: Mapping[str, Any], resume: bool) -> list[Row]:
        """Make the folder this campaign's and return the trials that it holds."""
        if not any(self.path.iterdir()):
            write_whole(self.path / SETTINGS, _json(settings))
        elif not resume:
            raise BadInput(f"{self.path} is not empty; give a new folder, or add --resume to go on with what is in it")
        else:
            _refuse_another_campaign(self.path, settings)
        if self.complete:
            return read_rows(self.path / TRIALS, COLUMNS)
        _drop_torn_line(self.path / PARTIAL)
        return read_rows(self.path / PARTIAL, Row._fields)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise WayfarerError(
                f"{self.path} cannot be written any more: {error.strerror}; mend that, then --resume goes on"
            ) from error


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    if path.is_file():
        raise BadInput(f"{path} is a file; the output needs a new or empty folder")
    try:
        yield
    except OSError as error:
        raise BadInput(f"{path} cannot be used for the output: {error.strerror or error}") from error


@contextmanager
def _removed_on_failure(path: Path) -> Iterator[None]:
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        yield
    except BaseException:
        for folder in made:
            with suppress(OSError):
                folder.rmdir()
        raise


def _locked(path: Path) -> int:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise BadInput(f"{path} is in use by another campaign; wait for it, or give another folder") from None
    return descriptor


def _refuse_another_campaign(path: Path, settings: Mapping[str, Any]) -> None:
    try:
        there = _flat(json.loads((path / SETTINGS).read_text(encoding="utf-8")))
    except (OSError, ValueError):
        raise BadInput(f"{path} cannot be resumed: it holds no campaign ({SETTINGS} is missing or damaged)") from None
    here = _flat(json.loads(_json(settings)))
    for name in [*here, *there]:
        if here.get(name) != there.get(name):
            raise BadInput(
                f"{path} belongs to another campaign: {name} is {there.get(name)!r} there and "
                f"{here.get(name)!r} here; repeat its settings, or give another folder"
            )


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Return nested settings by their dotted names."""
    if not isinstance(value, dict):
        return {name: value}
    return {key: leaf for k, v in value.items() for key, leaf in _flat(v, f"{name}.{k}" if name else k).items()}


def _drop_torn_line(path: Path) -> None:
    """Leave whole lines only, under a header."""
    text = path.read_bytes() if path.exists() else b""
    whole = text[: text.rfind(b"\n") + 1]
    if not whole:
        path.write_text(csv_line(Row._fields), encoding="utf-8")
    elif whole != text:
        os.truncate(path, len(whole))


def read_rows(path: Path, fields: tuple[str, ...]) -> list[Row]:
    """Read the rows of a file that has these columns.

    Raises:
        BadInput: the file is no text or has other columns, or a line is no row; the text names it.
    """
    try:
        columns, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
    except UnicodeDecodeError as error:
        raise BadInput(f"{path} is damaged: byte {error.start} is no text; run the campaign again") from None
    if f"{columns}\n" != csv_line(fields):
        raise BadInput(f"{path} is damaged: its first line does not name its columns; run the campaign again")
    return [parse_row(line, fields, f"{path}, line {number}") for number, line in enumerate(lines, start=2)]


def _json(value: Mapping[str, Any]) -> bytes:
    return (json.dumps(value, indent=2, allow_nan=False) + "\n").encode()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is there whole or not at all."""
    with whole_file(path) as draft:
        draft.write_bytes(content)
