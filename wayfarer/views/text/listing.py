"""Lists all runs of a folder, one row each, from the first and last records of each log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import began_wall_s, duration_text, local_time
from wayfarer.fieldlog.fields import escape_control_chars, integer, number, safe_text
from wayfarer.fieldlog.folders import MB, run_folders, run_number
from wayfarer.fieldlog.lines import LogLines
from wayfarer.fieldlog.reader import first_record, log_segments, read_header
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Header
from wayfarer.fieldlog.vocabulary import outcome_in_words
from wayfarer.files import open_regular

UNREADABLE, CUT_OFF = "unreadable", "cut off"
TAIL_BYTES = 65_536  # about a hundred ticks: the last one, the outcome and what stood between them
ALIVE_S = 5.0  # a log without an outcome that was written to so recently is of a run that goes on


class RunRow(NamedTuple):
    """One run in a few words; a value that its log does not tell is None.

    ``run`` is the name of the folder and ``number`` the number in it. ``trial`` is the number of a simulated trial,
    which has virtual time and no ``began_wall_s``, seconds since 1970. ``outcome`` is the reason why it ended, or
    ``running``, ``cut off`` or ``unreadable``. ``episodes`` are those of the last mission, as the
    algorithm counted them. ``driven_m`` is the true distance of a simulated rover.
    """

    run: str
    number: int | None = None
    trial: int | None = None
    began_wall_s: float | None = None
    lasted_s: float | None = None
    rover: str | None = None
    algorithm: str | None = None
    simulated: bool | None = None
    dry_run: bool | None = None
    commanded_m: float | None = None
    episodes: int | None = None
    outcome: str = UNREADABLE
    size_bytes: int | None = None
    version: str | None = None
    driven_m: float | None = None


def _began(row: RunRow) -> str:
    if row.trial is not None:
        return f"trial {row.trial}"  # in virtual time
    if row.began_wall_s is None:
        return "" if row.outcome == UNREADABLE else "clock not set"
    return local_time(row.began_wall_s, "%Y-%m-%d %H:%M")


def _whole_metres(distance_m: float | None) -> str:
    """Return a distance in a few characters; empty if it is not known."""
    return "" if distance_m is None else f"{distance_m:.0f}"


# The columns by their titles.
CELLS: Mapping[str, Callable[[RunRow], str]] = {
    "run": lambda row: row.run if row.number is None else str(row.number),
    "began": _began,
    "lasted": lambda row: duration_text(row.lasted_s),
    "rover": lambda row: "".join([row.rover or "", " (sim)" * bool(row.simulated), " (dry)" * bool(row.dry_run)]),
    "algorithm": lambda row: row.algorithm or "",
    "m": lambda row: _whole_metres(row.commanded_m if row.driven_m is None else row.driven_m),
    "episodes": lambda row: "" if row.episodes is None else str(row.episodes),
    "outcome": lambda row: outcome_in_words(row.outcome),
    "MB": lambda row: "" if row.size_bytes is None else f"{row.size_bytes / MB:.1f}",
}
RIGHT = {"run", "lasted", "m", "episodes", "MB"}
SPARED = ("MB", "rover", "algorithm", "episodes")  # what a narrow terminal goes without, first to last


def rows(logs: Path, now_wall_s: float) -> list[RunRow]:
    """Return a row for each run, in the order of ``run_folders``.

    Args:
        logs: the folder of all runs.
        now_wall_s: the wall time, which tells a run that goes on from one that was cut off.

    Raises:
        BadInput: the logs' folder cannot be read.
    """
    return [row_of(run, now_wall_s) for run in run_folders(logs)]


def lines(table: Sequence[RunRow], width: int | None) -> list[str]:
    """Return rows as lines under their titles, with as many columns as ``width`` characters hold (None: all)."""
    shown = dict(CELLS)
    for spared in ("", *SPARED):
        shown.pop(spared, None)
        laid_out = _laid_out([list(shown), *([cell(row) for cell in shown.values()] for row in table)])
        if width is None or max(map(len, laid_out)) <= width:
            break
    return laid_out


def _laid_out(table: Sequence[Sequence[str]]) -> list[str]:
    """Return cells as lines; the first are the titles."""
    titles, widths = table[0], [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(map(_cell, row, titles, widths)).rstrip() for row in table]


def _cell(text: str, title: str, width: int) -> str:
    return text.rjust(width) if title in RIGHT else text.ljust(width)


def row_of(run: Path, now_wall_s: float) -> RunRow:
    """Return the row of the run in a folder; of one that cannot be read, ``unreadable``."""
    title, count = escape_control_chars(run.name), run_number(run)
    try:
        segments = log_segments(run)
        size_bytes, written_s = sum(segment.stat().st_size for segment in segments), segments[-1].stat().st_mtime
        first, last = first_record(run), _last(segments)
    except (BadInput, OSError):
        return RunRow(title, count)
    header, end, tick = _header(run, first), last.get("any", {}), last.get("tick", {})
    return RunRow(
        title,
        count,
        header.trial,
        began_wall_s(first, end) if header.trial is None else None,
        end["t_s"] - first["t_s"] if end else None,
        header.rover,
        header.algorithm,
        header.simulated,
        header.dry_run,
        number(tick, "travelled_m"),
        integer(tick, "episodes"),
        _outcome(last.get("outcome"), alive=abs(now_wall_s - written_s) < ALIVE_S),
        size_bytes,
        header.version,
        number(last.get("truth", {}), "driven_m"),
    )


def _header(run: Path, first: Record) -> Header:
    """Return what says what ran; where the first record does not, a later part of the log may."""
    try:
        return Header.of(first if first["record"] == "run" else read_header(run))
    except BadInput:
        return Header.of({})


def _outcome(outcome: Record | None, *, alive: bool) -> str:
    if outcome is None:
        return "running" if alive else CUT_OFF
    return safe_text(outcome, "reason") or "unknown"


def _last(segments: Sequence[Path]) -> dict[str, Record]:
    """Return the last record of each kind, and the last of ``any``, from the end of a log.

    Where the newest segment has no tick, the end of the one before counts as well.
    """
    found: dict[str, Record] = {}
    lines: list[bytes] = []
    for segment in reversed(segments[-2:]):
        lines = _last_lines(segment) + lines
        log_lines = LogLines()
        found = {}
        for record in map(log_lines.take, lines):
            if isinstance(record, dict):
                found["any"] = found[record["record"]] = record
        if "tick" in found:
            break
    return found


def _last_lines(segment: Path) -> list[bytes]:
    with open_regular(segment) as file:
        size_b = file.seek(0, 2)
        file.seek(max(0, size_b - TAIL_BYTES))
        tail = file.read(TAIL_BYTES) or b""  # None for a file of the kernel that would have to be waited for
    return tail.splitlines(keepends=True)
