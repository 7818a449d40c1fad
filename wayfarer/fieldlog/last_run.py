"""Reads only the end of a log: an hour of log is 50 MB, too much to read at each start."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.fieldlog.folders import newest_run
from wayfarer.fieldlog.lines import LogLines
from wayfarer.fieldlog.reader import log_segments
from wayfarer.fieldlog.schema import Record
from wayfarer.files import open_regular

TAIL_BYTES = 65_536  # about a hundred ticks: the last one, the outcome and what stood between them
MODES = ("arming", "armed", "disarmed", "manual")  # each begins with the event of its name


class UnfinishedRun(NamedTuple):
    """A run without an outcome: the process was killed, the power went, or another daemon still writes it.

    ``last_t_s`` and ``last_t_wall`` are the times of its last record. ``mode`` is what it was in then, as far as the
    end of its log tells; ``error`` is why it cannot be read. What is not known is None.
    """

    run: str
    last_t_s: float | None = None
    last_t_wall: float | None = None
    mode: str | None = None
    error: str | None = None


def unfinished_run(logs: Path) -> UnfinishedRun | None:
    """Return the newest run in a folder of logs if it has no outcome, or cannot be read; never raises."""
    try:
        newest = newest_run(logs)
    except BadInput:  # starting the next run there reports the error
        return None
    return None if newest is None else _unfinished(newest)


def _unfinished(run: Path) -> UnfinishedRun | None:
    name = escape_control_chars(run.name)
    try:
        tail = end_of_log(log_segments(run))
    except BadInput as error:
        return UnfinishedRun(name, error=escape_control_chars(str(error)))
    except OSError as error:
        return UnfinishedRun(name, error=error.strerror)
    if not tail:
        return UnfinishedRun(name, error="nothing at the end of its log can be read")
    if any(record["record"] == "outcome" for record in tail):
        return None
    t_s, t_wall = tail[-1]["t_s"], tail[-1].get("t_wall")
    return UnfinishedRun(name, t_s, t_wall if isinstance(t_wall, int | float) else None, _mode(tail))


def end_of_log(segments: Sequence[Path]) -> list[Record]:
    """Return the last records of a log, in their order; those of the segment before as well where one has just begun.

    Raises:
        OSError: a segment cannot be read.
    """
    tail: list[Record] = []
    lines: list[bytes] = []
    for segment in reversed(segments[-2:]):
        lines = _last_lines(segment) + lines
        log_lines = LogLines()
        tail = [record for line in lines if isinstance(record := log_lines.take(line), dict)]
        if any(record["record"] == "tick" for record in tail):
            break
    return tail


def _last_lines(segment: Path) -> list[bytes]:
    with open_regular(segment) as file:
        size_b = file.seek(0, 2)
        file.seek(max(0, size_b - TAIL_BYTES))
        tail = file.read(TAIL_BYTES) or b""  # None for a file of the kernel that would have to be waited for
    return tail.splitlines(keepends=True)


def _mode(tail: Sequence[Record]) -> str | None:
    """Return what the run was in at last: what the last event says, or a tick that decided anything."""
    for record in reversed(tail):
        if record["record"] == "event" and record.get("name") in MODES:
            return str(record["name"])
        if record["record"] == "event" and record.get("name") == "manual_ended":
            return str(record.get("mode"))
        if record["record"] == "tick" and record.get("phase") not in (None, "halt"):
            return "manual" if record["phase"] == "manual" else "armed"
    return None
