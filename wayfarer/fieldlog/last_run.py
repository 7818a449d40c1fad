"""The run before this one: how it ended, and what its last mission came to.

Reads only the end of a log: an hour of log is 50 MB, too much to read at each start.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from wayfarer.control.status_light import LastEnd
from wayfarer.errors import BadInput
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.fieldlog.folders import newest_run
from wayfarer.fieldlog.lines import LogLines
from wayfarer.fieldlog.reader import log_segments
from wayfarer.fieldlog.run_events import Ended, Noted
from wayfarer.fieldlog.schema import Record, fields_of
from wayfarer.fieldlog.typed import Computer
from wayfarer.files import open_regular

TAIL_BYTES = 65_536  # about a hundred ticks: the last one, the outcome and what stood between them
# Twice the 10 s between two records of the computer's health, which have the totals of the last mission, at 14 kB a
# second.
LONG_TAIL_BYTES = 2 * 10 * 14_000
MODES = ("arming", "armed", "disarmed", "manual")  # each begins with the event of its name
MISSION_TOTALS = ("mission_s", "mission_m", "mission_anomalies", "mission_ended")
OUT = {"mission_radius", "escaped", "left_bounds"}  # ends of a rover that has left the wood


class LastRun(NamedTuple):
    """The newest run in a folder of logs.

    ``ended`` is the reason of its outcome, and ``text`` the same in words; None where it has no outcome: the process
    was killed, the power went, or another daemon still writes it. ``dropped`` records of it could not be written.
    ``last_t_s`` and ``last_t_wall`` are the times of its last record. ``mode`` is what it was in then, as far as the
    end of its log tells. ``mission_s``, ``mission_m`` (commanded), ``mission_anomalies`` and ``mission_ended``, the
    reason of disarming, are of its last mission, up to 10 s before it was cut off. ``error`` is why it cannot be read.
    What is not known is None.
    """

    run: str
    ended: str | None = None
    text: str | None = None
    dropped: int = 0
    last_t_s: float | None = None
    last_t_wall: float | None = None
    mode: str | None = None
    mission_s: float | None = None
    mission_m: float | None = None
    mission_anomalies: int | None = None
    mission_ended: str | None = None
    error: str | None = None

    @property
    def end(self) -> LastEnd | None:
        """Return how it ended, as the status light tells it; None where there was no mission."""
        why = self.mission_ended or (self.ended if self.mode == "armed" or self.mission_s is not None else None)
        if self.error is not None or self.ended == "failed" or (why or "").startswith("fault"):
            return LastEnd.FAILED
        if self.ended is None and (self.mode in {"arming", "armed"} or (self.mission_s is not None and why is None)):
            return LastEnd.UNFINISHED
        if why is None:
            return None
        return LastEnd.OUT if why in OUT else LastEnd.STOPPED


def last_run(logs: Path) -> LastRun | None:
    """Return the newest run in a folder of logs, None where there is none; never raises."""
    try:
        newest = newest_run(logs)
    except BadInput:  # starting the next run there reports the error
        return None
    return None if newest is None else _told_of(newest)


def _told_of(run: Path) -> LastRun:
    name = escape_control_chars(run.name)
    try:
        tail = end_of_log(log_segments(run), LONG_TAIL_BYTES, "computer")
    except BadInput as error:
        return LastRun(name, error=escape_control_chars(str(error)))
    except OSError as error:
        return LastRun(name, error=error.strerror)
    if not tail:
        return LastRun(name, error="nothing at the end of its log can be read")
    last = tail[-1]
    outcome = next((each for each in reversed(tail) if each["record"] == "outcome"), None)
    found: dict[str, Any] = _totals(tail)
    if outcome is not None:
        told = fields_of(Ended, outcome)
        found |= {"ended": told.get("reason", "unknown"), "text": told.get("text"), "dropped": told.get("dropped", 0)}
    wall_s = last.get("t_wall")
    return LastRun(
        name,
        last_t_s=last["t_s"],
        last_t_wall=wall_s if isinstance(wall_s, int | float) else None,
        mode=_mode(tail),
        **found,
    )


def _totals(tail: Sequence[Record]) -> dict[str, Any]:
    """Return the totals of the last mission: what was said last, unless another one has begun since."""
    found: dict[str, Any] = {}
    for record in tail:
        name = record.get("name")
        if record["record"] == "computer":
            found = fields_of(Computer, record)
        elif record["record"] == "event" and name in {"armed", "mission_ended"}:
            found = fields_of(Noted, record) if name == "mission_ended" else {}
    return {key: found[key] for key in MISSION_TOTALS if key in found}


def end_of_log(segments: Sequence[Path], tail_bytes: int = TAIL_BYTES, until: str = "tick") -> list[Record]:
    """Return the last records of a log, in their order.

    Args:
        segments: the files of the log, oldest first.
        tail_bytes: how much of the newest is read.
        until: a kind of record; those of the segment before are read as well where the newest has none.

    Raises:
        OSError: a segment cannot be read.
    """
    tail: list[Record] = []
    lines: list[bytes] = []
    for segment in reversed(segments[-2:]):
        lines = _last_lines(segment, tail_bytes) + lines
        log_lines = LogLines()
        tail = [record for line in lines if isinstance(record := log_lines.take(line), dict)]
        if any(record["record"] == until for record in tail):
            break
    return tail


def _last_lines(segment: Path, tail_bytes: int) -> list[bytes]:
    with open_regular(segment) as file:
        size_b = file.seek(0, 2)
        file.seek(max(0, size_b - tail_bytes))
        tail = file.read(tail_bytes) or b""  # None for a file of the kernel that would have to be waited for
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
