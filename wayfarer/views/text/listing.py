"""Lists all runs of a folder, one row each, from the first and last records of each log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.fields import began_wall_s, local_time, name, number, span, whole
from wayfarer.fieldlog.folders import run_folders, run_number
from wayfarer.fieldlog.last_run import end_of_log
from wayfarer.fieldlog.printable import clean
from wayfarer.fieldlog.reader import Record, RunReader, log_segments, read_header
from wayfarer.fieldlog.wording import marks

ALIVE_S = 5.0  # a log without an outcome that was written to so recently is of a run that goes on


class RunRow(NamedTuple):
    """One run in a few words; what its log does not tell is empty."""

    run: str
    began: str
    lasted: str
    rover: str
    algorithm: str
    metres: str
    episodes: str
    outcome: str
    size: str


SHORT = {"simulated": " (sim)", "dry run": " (dry)"}
TITLES = RunRow("run", "began", "lasted", "rover", "algorithm", "m", "episodes", "outcome", "MB")
RIGHT = {"run", "lasted", "m", "episodes", "MB"}
SPARED = ("size", "rover", "algorithm", "episodes")  # what a narrow terminal goes without, first to last


def rows(logs: Path, now_wall_s: float) -> list[RunRow]:
    """Return a row for each run, in the order of ``run_folders``.

    Args:
        logs: the folder of all runs.
        now_wall_s: the wall time, which tells a run that goes on from one that was cut off.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    return [_row(run, now_wall_s) for run in run_folders(logs)]


def lines(table: Sequence[RunRow], width: int | None) -> list[str]:
    """Return rows as lines under their titles, with as many columns as ``width`` characters hold (None: all)."""
    shown = list(RunRow._fields)
    for spared in ("", *SPARED):
        shown = [column for column in shown if column != spared]
        laid_out = _laid_out(shown, [TITLES, *table])
        if width is None or max(map(len, laid_out)) <= width:
            break
    return laid_out


def _laid_out(columns: Sequence[str], table: Sequence[RunRow]) -> list[str]:
    widths = {column: max(len(getattr(row, column)) for row in table) for column in columns}
    return ["  ".join(_cell(row, column, widths[column]) for column in columns).rstrip() for row in table]


def _cell(row: RunRow, column: str, width: int) -> str:
    text = str(getattr(row, column))
    return text.rjust(width) if getattr(TITLES, column) in RIGHT else text.ljust(width)


def _row(run: Path, now_wall_s: float) -> RunRow:
    title = _title(run)
    try:
        segments = log_segments(run)
        size_b, written_s = sum(segment.stat().st_size for segment in segments), segments[-1].stat().st_mtime
        first, last = next(iter(RunReader(run)), None), _last(segments)
    except (BadInput, OSError):
        first = None
    if first is None:
        return RunRow(title, "", "", "", "", "", "", "unreadable", "")
    header, end, tick = _header(run, first), last.get("any", {}), last.get("tick", {})
    return RunRow(
        title,
        _began(header, first, end),
        _lasted(first, end),
        "".join([name(header, "rover") or "", *(SHORT[mark] for mark in marks(header))]),
        name(header, "algorithm") or "",
        _rounded(tick, "travelled_m"),
        _rounded(tick, "episodes"),
        _outcome(last.get("outcome"), alive=abs(now_wall_s - written_s) < ALIVE_S),
        f"{size_b / 1e6:.1f}",
    )


def _title(run: Path) -> str:
    """Return a run's number, or the name of its folder where that has none."""
    count = run_number(run)
    return clean(run.name) if count is None else str(count)


def _header(run: Path, first: Record) -> Record:
    """Return what says what ran; where the first record does not, a later part of the log may."""
    if first["record"] == "run":
        return first
    try:
        return read_header(run)
    except BadInput:
        return {}


def _outcome(outcome: Record | None, *, alive: bool) -> str:
    if outcome is None:
        return "goes on" if alive else "cut off"
    return name(outcome, "reason") or "unknown"


def _lasted(first: Record, end: Record) -> str:
    first_t_s, end_t_s = number(first, "t_s"), number(end, "t_s")
    return "" if first_t_s is None or end_t_s is None else span(end_t_s - first_t_s)


def _rounded(record: Record, key: str) -> str:
    value = number(record, key)
    return "" if value is None else f"{value:.0f}"


def _began(header: Record, first: Record, end: Record) -> str:
    trial = whole(header, "trial")
    if trial is not None:
        return f"trial {trial}"  # in virtual time
    wall_s = began_wall_s(header, first, end)
    return "clock not set" if wall_s is None else local_time(wall_s, "%Y-%m-%d %H:%M")


def _last(segments: Sequence[Path]) -> dict[str, Record]:
    """Return the last record of each kind, and the last of ``any``."""
    found: dict[str, Record] = {}
    for record in reversed(end_of_log(segments)):
        found.setdefault("any", record)
        found.setdefault(record["record"], record)
    return found
