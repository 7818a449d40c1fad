"""Store of finished trials: a file written in the order of completion, read in the order of ``trials.csv``.

Where the last column is ``crc32``, each line ends in the CRC-32 of what stands before it, as eight hexadecimal digits.

In memory is only where in the file the line of each trial begins, 8 bytes a trial: a million trials need hardly more
of it than a thousand.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import BinaryIO, NamedTuple
from zlib import crc32

from wayfarer.config.messages import shown
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Task, Tasks
from wayfarer.experiments.rows import TrialRow, csv_line, parse_row, without_kinds
from wayfarer.files.regular_file import open_regular

CHECKSUM = "crc32"
MOST_LINE_BYTES = 100_000  # far more than any row: a file without line ends must not fill the memory
NOWHERE = 0  # no row begins where the names of the columns stand


class TrialStore(Iterable[TrialRow]):
    """The rows of a file that begins with the names of its ``columns``; ``name`` is what errors call it.

    Iterating gives them in the order of ``trials.csv``. The file is its opener's to close.

    Raises:
        BadInput: the file is no text or has other columns, a line is no row of these trials, or two lines of one
            trial differ; the text names it.
    """

    def __init__(self, file: BinaryIO, tasks: Tasks, name: str, columns: tuple[str, ...]) -> None:
        self._file = file
        self._name = name
        self._columns = columns_in(file, name, columns)
        self._tasks = tasks
        self._starts = array("q", [NOWHERE]) * len(tasks)
        self._count = 0
        self._end = file.tell()
        for line in lines_in(file, name, self._columns):
            self._refuse_contradiction(line)
            self._place(line.row, line.start)
            self._end = line.start + len(line.content)
        if file.writable():
            file.truncate(self._end)  # of what a crash has left of a line nothing may stay behind the next one

    @classmethod
    def begun(cls, file: BinaryIO, tasks: Tasks) -> TrialStore:
        """Return those of an empty file: none yet."""
        file.write(csv_line(TrialRow._fields).encode())
        return cls(file, tasks, "the file of finished trials", TrialRow._fields)

    def __len__(self) -> int:
        return self._count

    @property
    def total(self) -> int:
        """How many trials there are."""
        return len(self._starts)

    def __iter__(self) -> Iterator[TrialRow]:
        for task in self._tasks.in_table_order():
            if (start := self._starts[self._number(task)]) != NOWHERE:
                yield row_in(self._line_at(start), self._columns, self._name)

    def missing(self) -> Tasks:
        """Return the trials that are not here, in the order of running."""
        if not self._count:
            return self._tasks
        return self._tasks.only(array("q", (number for number, at in enumerate(self._starts) if at == NOWHERE)))

    def append(self, row: TrialRow) -> None:
        """Keep a finished trial, safe from a crash of this process.

        Raises:
            OSError: the file takes no more.
        """
        line = line_of(self._columns, row)
        self._file.seek(self._end)
        self._file.write(line)
        self._file.flush()
        self._place(row, self._end)
        self._end += len(line)

    def _place(self, row: TrialRow, start: int) -> None:
        """Note where a trial's line begins."""
        number = self._number(Task(*row.key))
        self._count += self._starts[number] == NOWHERE
        self._starts[number] = start

    def _refuse_contradiction(self, line: Line) -> None:
        start = self._starts[self._number(Task(*line.row.key))]
        if start != NOWHERE and self._line_at(start) != line.content:
            raise BadInput(
                f"{line.where} is a second row of trial {line.row.trial} of {line.row.algorithm!r}, unlike the "
                "first; remove both lines or the folder"
            )

    def _line_at(self, start: int) -> bytes:
        self._file.seek(start)
        return self._file.readline()

    def _number(self, task: Task) -> int:
        number = self._tasks.number(task)
        if number is None:
            at = f" at point {task.point}" if task.point else ""
            raise BadInput(f"{self._name} is damaged: there is no trial {task.trial} of {shown(task.algorithm)}{at}")
        return number


def line_of(columns: tuple[str, ...], row: TrialRow) -> bytes:
    """Return a row as a line of a file with these columns."""
    if columns[-1] != CHECKSUM:
        return csv_line(columns, row).encode()
    text = csv_line(columns[:-1], row).rstrip("\n").encode()
    return b"%b,%08x\n" % (text, crc32(text))


def row_in(line: bytes, columns: tuple[str, ...], where: str) -> TrialRow:
    """Return the row that ``line_of`` made a line of.

    Raises:
        BadInput: the line is no such row, or is not as it was written; the text names ``where``.
    """
    if columns[-1] == CHECKSUM:
        line, _, checksum = line.rstrip(b"\n").rpartition(b",")
        if checksum != b"%08x" % crc32(line):
            raise BadInput(f"{where} is damaged: its checksum is wrong; remove the line to run its trial again")
        columns = columns[:-1]
    return parse_row(_text(line, where), columns, where)


def columns_in(file: BinaryIO, name: str, columns: tuple[str, ...]) -> tuple[str, ...]:
    """Read the first line of a file of rows; return the columns that it has: these, or in a table those of old.

    Raises:
        BadInput: the file is no text or has other columns; the text names it.
    """
    file.seek(0)
    header = _text(file.readline(MOST_LINE_BYTES), f"{name}, line 1")
    for known in [columns] if columns[-1] == CHECKSUM else [columns, without_kinds(columns)]:
        if header == csv_line(known):
            return known
    raise BadInput(
        f"{name} is damaged, or was written by another version: its first line does not name its columns; run the "
        "trials again into another folder"
    )


class Line(NamedTuple):
    """A line of a file of rows: how errors call it, where it begins, its bytes, and its row."""

    where: str
    start: int
    content: bytes
    row: TrialRow


def lines_in(file: BinaryIO, name: str, columns: tuple[str, ...]) -> Iterator[Line]:
    """Read the rows of a file whose first line is read; what a crash has left of a last line is no row.

    The file may be read elsewhere between two lines.

    Raises:
        BadInput: a line is no text or no row; the text names it.
    """
    start = file.tell()
    for number in count(2):
        file.seek(start)
        line, where = file.readline(MOST_LINE_BYTES), f"{name}, line {number}"
        if not line.endswith(b"\n"):
            if len(line) == MOST_LINE_BYTES:
                raise BadInput(f"{where} is not a row of a campaign: it is too long; remove the line or the folder")
            return
        yield Line(where, start, line, row_in(line, columns, where))
        start += len(line)


def read_rows(path: Path, columns: tuple[str, ...]) -> Iterator[TrialRow]:
    """Read the rows of a file that has these columns, or in a table those of old.

    Raises:
        BadInput: as of ``columns_in`` and ``lines_in``.
        OSError: it is no ordinary file, or cannot be read.
    """
    with open_regular(path) as file:
        columns = columns_in(file, str(path), columns)
        yield from (line.row for line in lines_in(file, str(path), columns))


def _text(line: bytes, where: str) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError as error:
        raise BadInput(f"{where} is damaged: its byte {error.start} is no text; run the trials again") from None
