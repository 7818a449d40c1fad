"""Integrity of a log: complete, partial (damaged records left out), or unreadable."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import Outcome
from wayfarer.fieldlog.wording import plural

NO_OUTCOME = "no outcome: the run was cut off, or is still running"


class LogIntegrity(IntEnum):
    """How much of a log is left; the later, the worse."""

    COMPLETE = 0
    PARTIAL = 1
    UNREADABLE = 2

    @property
    def exit_code(self) -> int:
        """0 for complete, 3 for partial, 1 for unreadable: as ``mcap recover`` has it."""
        return (0, 3, 1)[self]


class LogVerdict(NamedTuple):
    """What was found in one log; ``wrong`` says what is not as it should be."""

    integrity: LogIntegrity
    records: int
    wrong: tuple[str, ...]

    def __str__(self) -> str:
        readable = "" if self.integrity is LogIntegrity.COMPLETE else "readable "
        records = plural(self.records, f"{readable}record")
        return "; ".join([f"{self.integrity.name.lower()}: {records}", *self.wrong])


def check_log(run: Path) -> LogVerdict:
    """Read a whole run and return its integrity; an unfinished run has no outcome, and is at best partial."""
    records, ended = 0, False
    try:
        reader = RunReader(run)
        for record in reader:
            ended = ended or isinstance(record, Outcome)
            records += 1
    except BadInput as error:
        return LogVerdict(LogIntegrity.UNREADABLE, records, (str(error),))
    wrong = tuple(filter(None, (str(reader.damage) if reader.damage else "", "" if ended else NO_OUTCOME)))
    return LogVerdict(LogIntegrity.PARTIAL if wrong else LogIntegrity.COMPLETE, records, wrong)
