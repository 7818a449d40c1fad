"""Reading a log back, through whatever cut it short: a power cut, a full disk, a card that forgets.

Every line that is whole is given; what is not is skipped, and counted by what is wrong with it. A line that was being
written when the power went has no end, or is filled with NUL bytes; nothing after it is lost, because the next run has
a folder of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import FILE_NAME

Record = dict[str, Any]
KINDS = ("run", "tick", "event", "position", "board", "computer", "truth", "outcome")
LINE_BYTES = 1_000_000  # far more than any record: the header of a simulated forest has 20,000


@dataclass
class Damage:
    """What could not be read: lines by what is wrong with them, and records that never got into the log.

    ``torn`` has no end of line, ``nul`` is filled with NUL bytes, ``oversized`` has more than ``LINE_BYTES``, and
    ``garbled`` is no JSON object with a known ``record``. ``missing`` counts the numbers that the records left out.
    """

    torn: int = 0
    nul: int = 0
    oversized: int = 0
    garbled: int = 0
    missing: int = 0

    @property
    def lines(self) -> int:
        """How many lines were skipped."""
        return self.torn + self.nul + self.oversized + self.garbled


class RunReader:
    """Reads the records of one run in their order; ``damage`` is complete once all of them were read.

    Iterate it once. The header of a later part of the log is given as well, as another ``run`` record.

    Args:
        run: a run's folder.

    Raises:
        BadInput: the folder cannot be read, or there is no log in it.
    """

    def __init__(self, run: Path) -> None:
        self.run = run
        self.damage = Damage()
        self.parts = log_parts(run)
        self._number: int | None = None

    def __iter__(self) -> Iterator[Record]:
        for part in self.parts:
            yield from self._part(part)

    def _part(self, part: Path) -> Iterator[Record]:
        try:
            with part.open("rb") as file:
                while line := file.readline(LINE_BYTES):
                    if (record := self._record(line)) is not None:
                        self._count_missing(record)
                        yield record
        except OSError as error:
            raise BadInput(f"{part}: cannot be read: {error.strerror}") from None

    def _record(self, line: bytes) -> Record | None:
        """Return the record of a line, or count what is wrong with it."""
        record = parse(line)
        if isinstance(record, dict):
            return record
        setattr(self.damage, record, getattr(self.damage, record) + 1)
        return None

    def _count_missing(self, record: Record) -> None:
        """Find the gaps in the numbers; headers have none."""
        number, before = record.get("n"), self._number
        if not isinstance(number, int):
            return
        if before is not None and number > before + 1:
            self.damage.missing += number - before - 1
        self._number = number


def parse(line: bytes) -> Record | str:
    """Return the record of a line, or which field of ``Damage`` counts it."""
    if not line.endswith(b"\n"):
        if len(line) >= LINE_BYTES:
            return "oversized"
        return "torn" if line.strip(b"\0") else "nul"
    try:
        record = orjson.loads(line)
    except ValueError:
        return "nul" if b"\0" in line else "garbled"
    if isinstance(record, dict) and record.get("record") in KINDS and _is_number(record.get("t_s")):
        return record
    return "garbled"


def read_header(run: Path) -> Record:
    """Return the first record of a run: what ran.

    Raises:
        BadInput: there is no log, or it does not begin with such a record.
    """
    for record in RunReader(run):
        if record["record"] == "run":
            return record
        break
    raise BadInput(f"{run / FILE_NAME} is no field log: its first record does not say what ran")


def log_parts(run: Path) -> list[Path]:
    """Return the files of a run's log, oldest first.

    Raises:
        BadInput: the folder cannot be read, or there is no log in it.
    """
    try:
        older = sorted(path for path in run.glob("run.*.jsonl") if path.name != FILE_NAME)
        newest = [run / FILE_NAME] if (run / FILE_NAME).exists() else []
    except OSError as error:
        raise BadInput(f"{run}: cannot be read: {error.strerror}") from None
    if not older and not newest:
        raise BadInput(f"{run} is no run: there is no {FILE_NAME} in it")
    return [*older, *newest]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
