"""When the clock of a log was zero, found in one pass over its records. Pure."""

from __future__ import annotations

from wayfarer.errors import BadInput
from wayfarer.fieldlog.fields import clock_zero_s
from wayfarer.fieldlog.reader import Record, RunReader


class ClockZero:
    """Follows the records of a log; ``zero_s`` is the time since 1970 at which its ``t_s`` was zero.

    So every time of an export is ``zero_s + t_s``: in order, and right at the end of the log, where the rover's
    computer is most likely to know the time.
    """

    def __init__(self) -> None:
        self._header: Record = {}
        self._first: Record = {}
        self._last: Record = {}

    def take(self, record: Record) -> None:
        """Take the next record."""
        if record["record"] == "run":
            self._header = self._header or record
        if record.get("t_wall") is not None:
            self._first, self._last = self._first or record, record

    @property
    def zero_s(self) -> float | None:
        """Return it as every tool tells it; None where no record has a wall time."""
        return clock_zero_s(self._header, self._first, self._last)


def read_clock_zero_s(reader: RunReader) -> float:
    """Read a run to its end, and return when its clock was zero, seconds since 1970.

    Raises:
        BadInput: the run cannot be read, or no record has a wall time.
    """
    clock = ClockZero()
    for record in reader:
        clock.take(record)
    if clock.zero_s is None:
        raise BadInput(f"{reader.run}: nothing in this log can be read (see wayfarer logs check)")
    return clock.zero_s
