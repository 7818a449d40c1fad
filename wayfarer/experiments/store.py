"""Store of finished trials: a file written in the order of completion, read in the order of ``trials.csv``.

In memory is only where in the file the line of each trial begins, 8 bytes a trial: a million trials need hardly more
of it than a thousand.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from typing import BinaryIO

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Tasks
from wayfarer.experiments.rows import TrialRow, csv_line, parse_row, without_kinds

NOWHERE = 0  # no row begins where the names of the columns stand


class TrialStore(Iterable[TrialRow]):
    """The rows of a file that begins with the names of its columns, ``fields``; ``name`` is what errors call it.

    Iterating gives them by algorithm as asked, then by trial. The file is its opener's to close.

    Raises:
        BadInput: the file is no text or has other columns, or a line is no row of this campaign; the text names it.
    """

    def __init__(self, file: BinaryIO, tasks: Tasks, name: str, fields: tuple[str, ...]) -> None:
        self._file = file
        self._name = name
        self._fields = columns_in(file, name, fields)
        self._trials = tasks.trials
        self._algorithms = {algorithm: index for index, algorithm in enumerate(tasks.algorithms)}
        self._starts = array("q", [NOWHERE]) * len(tasks)
        self._count = 0
        for start, row in rows_in(file, name, self._fields):
            self._place(row, start)
        self._end = file.tell()

    @classmethod
    def begun(cls, file: BinaryIO, tasks: Tasks) -> TrialStore:
        """Return those of an empty file: none yet."""
        file.write(csv_line(TrialRow._fields).encode())
        return cls(file, tasks, "the file of finished trials", TrialRow._fields)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[TrialRow]:
        every = len(self._algorithms)
        for index in range(every):
            for trial in range(self._trials):
                if (start := self._starts[trial * every + index]) != NOWHERE:
                    self._file.seek(start)
                    yield parse_row(self._file.readline().decode(), self._fields, self._name)

    def missing(self) -> Tasks:
        """Return the trials that are not here, in the order of running."""
        if not self._count:
            return Tasks(tuple(self._algorithms), self._trials)
        numbers = array("q", (number for number, start in enumerate(self._starts) if start == NOWHERE))
        return Tasks(tuple(self._algorithms), self._trials, numbers)

    def append(self, row: TrialRow) -> None:
        """Keep a finished trial, whatever happens to this process next.

        Raises:
            OSError: the file takes no more.
        """
        line = csv_line(self._fields, row).encode()
        self._file.seek(self._end)
        self._file.write(line)
        self._file.flush()
        self._place(row, self._end)
        self._end += len(line)

    def _place(self, row: TrialRow, start: int) -> None:
        """Note where a trial's line begins; of two lines of one trial the later one counts."""
        if row.algorithm not in self._algorithms or not 0 <= row.trial < self._trials:
            raise BadInput(f"{self._name} is damaged: the campaign has no trial {row.trial} of {row.algorithm!r}")
        number = row.trial * len(self._algorithms) + self._algorithms[row.algorithm]
        self._count += self._starts[number] == NOWHERE
        self._starts[number] = start


def columns_in(file: BinaryIO, name: str, fields: tuple[str, ...]) -> tuple[str, ...]:
    """Read the first line of a file of rows; return the columns that it has: these, or those that older versions had.

    Raises:
        BadInput: the file is no text or has other columns; the text names it.
    """
    file.seek(0)
    header = _text(file.readline(), 0, name)
    for columns in (fields, without_kinds(fields)):
        if header == csv_line(columns):
            return columns
    raise BadInput(f"{name} is damaged: its first line does not name its columns; run the campaign again")


def rows_in(file: BinaryIO, name: str, fields: tuple[str, ...]) -> Iterator[tuple[int, TrialRow]]:
    """Read a file of rows with these columns, or those of older versions; yield each with the offset of its line.

    Raises:
        BadInput: the file is no text or has other columns, or a line is no row; the text names it.
    """
    columns = columns_in(file, name, fields)
    start = file.tell()
    for number, line in enumerate(file, 2):
        yield start, parse_row(_text(line, start, name), columns, f"{name}, line {number}")
        start += len(line)


def _text(line: bytes, start: int, name: str) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError as error:
        raise BadInput(f"{name} is damaged: byte {start + error.start} is no text; run the campaign again") from None
