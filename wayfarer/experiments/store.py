"""Store of finished trials: a file of CSV written in the order of completion, read in the order of ``trials.csv``.

In memory is only where in the file the line of each trial begins, 8 bytes a trial: a million trials need hardly more
of it than a thousand.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from itertools import count
from typing import BinaryIO
from zlib import crc32

from wayfarer.config.messages import shown
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Task, Tasks
from wayfarer.experiments.rows import TrialRow, csv_line, parse_row

CHECKSUM = "crc32"
MOST_LINE_BYTES = 100_000  # far more than any row: a file without line ends must not fill the memory
NOWHERE = 0  # no row begins where the names of the columns stand


class TrialStore(Iterable[TrialRow]):
    """The rows of a file that begins with the names of its ``columns``; ``name`` is what errors call it.

    Where the last column is ``crc32``, each line ends in the CRC-32 of what stands before it, as eight hexadecimal
    digits. Iterating gives the rows in the order of ``trials.csv``. The file is its opener's to close. In a file that
    can be written, a last line that a crash cut short goes, and so does a first one, which is written again.

    Raises:
        BadInput: the file has other columns, a line is no row of these trials, or two lines of one trial differ; the
            text names it.
    """

    def __init__(self, file: BinaryIO, tasks: Tasks, columns: tuple[str, ...], name: str) -> None:
        self._file = file
        self._tasks = tasks
        self._columns = columns
        self._name = name
        self._starts = array("q", [NOWHERE]) * len(tasks)
        self._count = 0
        self._end = self._after_header()
        for number in count(2):
            line = self._line_at(self._end)
            if not line.endswith(b"\n") and len(line) < MOST_LINE_BYTES:
                break
            self._read(line, f"{name}, line {number}")
        if file.writable():
            file.truncate(self._end)  # nothing of a torn line may stay behind the next one

    def __len__(self) -> int:
        return self._count

    @property
    def total(self) -> int:
        """How many trials there are."""
        return len(self._starts)

    def __iter__(self) -> Iterator[TrialRow]:
        for task in self._tasks.in_table_order():
            if (start := self._starts[self._number(task)]) != NOWHERE:
                yield self._row_in(self._line_at(start), self._name)

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
        self._place(row, line)

    def _after_header(self) -> int:
        """Return where the rows begin; write the names of the columns where none or a part of them is there."""
        header, found = csv_line(self._columns).encode(), self._line_at(0)
        if found != header and header.startswith(found) and self._file.writable():
            self._file.seek(0)
            self._file.write(header)
        elif found != header:
            raise BadInput(
                f"{self._name} is damaged, or was written by another version: its first line does not name its "
                "columns; run the trials again into another folder"
            )
        return len(header)

    def _read(self, line: bytes, where: str) -> None:
        row = self._row_in(line, where)
        start = self._starts[self._number(Task(*row.key))]
        if start != NOWHERE and self._line_at(start) != line:
            raise BadInput(
                f"{where} is damaged: it is a second row of trial {row.trial} of {row.algorithm!r}, unlike the first; "
                "remove both lines or the folder"
            )
        self._place(row, line)

    def _place(self, row: TrialRow, line: bytes) -> None:
        """Note where a trial's line begins: at the end of what was there."""
        number = self._number(Task(*row.key))
        self._count += self._starts[number] == NOWHERE
        self._starts[number] = self._end
        self._end += len(line)

    def _row_in(self, line: bytes, where: str) -> TrialRow:
        """Return the row that ``line_of`` made a line of."""
        columns = self._columns
        if columns[-1] == CHECKSUM:
            line, _, checksum = line.rstrip(b"\n").rpartition(b",")
            if checksum != b"%08x" % crc32(line):
                raise BadInput(f"{where} is damaged: its checksum is wrong; remove the line to run its trial again")
            columns = columns[:-1]
        return parse_row(line, columns, where)

    def _line_at(self, start: int) -> bytes:
        self._file.seek(start)
        return self._file.readline(MOST_LINE_BYTES)

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
