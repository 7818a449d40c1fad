"""Store of finished trials: a file written in the order of completion, read in the order of ``trials.csv``.

In memory is only where in the file the line of each trial begins, 8 bytes a trial: a million trials need hardly more
of it than a thousand.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Task, Tasks
from wayfarer.experiments.rows import TrialRow, csv_line, parse_row, without_kinds

NOWHERE = 0  # no row begins where the names of the columns stand


class TrialStore(Iterable[TrialRow]):
    """The rows of a file that begins with the names of its ``columns``; ``name`` is what errors call it.

    Iterating gives them in the order of ``trials.csv``. The file is its opener's to close.

    Raises:
        BadInput: the file is no text or has other columns, or a line is no row of these trials; the text names it.
    """

    def __init__(self, file: BinaryIO, tasks: Tasks, name: str, columns: tuple[str, ...]) -> None:
        self._file = file
        self._name = name
        self._columns = columns_in(file, name, columns)
        self._tasks = tasks
        self._starts = array("q", [NOWHERE]) * len(tasks)
        self._count = 0
        for start, row in rows_in(file, name, self._columns):
            self._place(row, start)
        self._end = file.tell()

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
                self._file.seek(start)
                yield parse_row(self._file.readline().decode(), self._columns, self._name)

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
        line = csv_line(self._columns, row).encode()
        self._file.seek(self._end)
        self._file.write(line)
        self._file.flush()
        self._place(row, self._end)
        self._end += len(line)

    def _place(self, row: TrialRow, start: int) -> None:
        """Note where a trial's line begins; of two lines of one trial the later one counts."""
        number = self._number(Task(*row.key))
        self._count += self._starts[number] == NOWHERE
        self._starts[number] = start

    def _number(self, task: Task) -> int:
        number = self._tasks.number(task)
        if number is None:
            at = f" at point {task.point}" if task.point else ""
            raise BadInput(f"{self._name} is damaged: there is no trial {task.trial} of {task.algorithm!r}{at}")
        return number


def columns_in(file: BinaryIO, name: str, columns: tuple[str, ...]) -> tuple[str, ...]:
    """Read the first line of a file of rows; return the columns that it has: these, or those that older versions had.

    Raises:
        BadInput: the file is no text or has other columns; the text names it.
    """
    file.seek(0)
    header = _text(file.readline(), 0, name)
    for known in (columns, without_kinds(columns)):
        if header == csv_line(known):
            return known
    raise BadInput(f"{name} is damaged: its first line does not name its columns; run the trials again")


def read_rows(path: Path, columns: tuple[str, ...]) -> list[TrialRow]:
    """Read the rows of a file that has these columns.

    Raises:
        BadInput: as of ``rows_in``.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        return [row for _, row in rows_in(file, str(path), columns)]


def rows_in(file: BinaryIO, name: str, columns: tuple[str, ...]) -> Iterator[tuple[int, TrialRow]]:
    """Read a file of rows with these columns, or those of older versions; yield each with the offset of its line.

    Raises:
        BadInput: the file is no text or has other columns, or a line is no row; the text names it.
    """
    columns = columns_in(file, name, columns)
    start = file.tell()
    for number, line in enumerate(file, 2):
        yield start, parse_row(_text(line, start, name), columns, f"{name}, line {number}")
        start += len(line)


def _text(line: bytes, start: int, name: str) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError as error:
        raise BadInput(f"{name} is damaged: byte {start + error.start} is no text; run the trials again") from None
