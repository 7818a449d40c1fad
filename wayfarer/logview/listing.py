"""Lists all runs of a folder, one row each, from the first and last records of each log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import began_wall_s, duration_text, local_time
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.fieldlog.folders import MB, run_folders, run_number
from wayfarer.fieldlog.reader import CANNOT_BE_READ, Lines, find_header, go_to_last, log_segments, open_log
from wayfarer.fieldlog.record import AnyRecord, Outcome, Tick, Truth
from wayfarer.fieldlog.run_fold import NO_HEADER
from wayfarer.vocabulary import outcome_in_words

UNREADABLE, CUT_OFF = "unreadable", "cut off"
TAIL_BYTES = 65_536  # about a hundred ticks: the last one, the outcome and what stood between them
ALIVE_S = 5.0  # a log without an outcome that was written to so recently is of a run that goes on


class RunRow(NamedTuple):
    """One run in a few words; a value that its log does not have is None.

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


# The columns by their titles.
CELLS: Mapping[str, Callable[[RunRow], str]] = {
    "run": lambda row: row.run if row.number is None else str(row.number),
    "began": _began,
    "lasted": lambda row: duration_text(row.lasted_s),
    "rover": lambda row: "".join([row.rover or "", " (sim)" * bool(row.simulated), " (dry)" * bool(row.dry_run)]),
    "algorithm": lambda row: row.algorithm or "",
    "m": lambda row: "" if (m := row.commanded_m if row.driven_m is None else row.driven_m) is None else f"{m:.0f}",
    "episodes": lambda row: "" if row.episodes is None else str(row.episodes),
    "outcome": lambda row: outcome_in_words(row.outcome),
    "MB": lambda row: "" if row.size_bytes is None else f"{row.size_bytes / MB:.1f}",
}
RIGHT = {"run", "lasted", "m", "episodes", "MB"}
SPARED = ("MB", "rover", "algorithm", "episodes")  # what a narrow terminal goes without, first to last


def rows(logs: Path, now_wall_s: float) -> list[RunRow]:
    """Return a row for each run in the folder of all runs, in the order of ``run_folders``.

    ``now_wall_s`` is the wall time; it distinguishes a run that goes on from one that was cut off.
    """
    return [row_of(run, now_wall_s) for run in run_folders(logs)]


def lines(table: Sequence[RunRow], width: int | None) -> list[str]:
    """Return rows as lines under their titles, with as many columns as ``width`` characters hold (None: all)."""
    columns = {title: [title, *map(cell, table)] for title, cell in CELLS.items()}
    for title, texts in columns.items():
        widest = max(map(len, texts))
        columns[title] = [text.rjust(widest) if title in RIGHT else text.ljust(widest) for text in texts]
    for spared in ("", *SPARED):
        columns.pop(spared, None)
        laid_out = ["  ".join(cells).rstrip() for cells in zip(*columns.values(), strict=True)]
        if width is None or max(map(len, laid_out)) <= width:
            break
    return laid_out


def row_of(run: Path, now_wall_s: float) -> RunRow:
    """Return the row of the run in a folder; of one that cannot be read, ``unreadable``."""
    title, count = escape_control_chars(run.name), run_number(run)
    try:
        segments = log_segments(run)
        size_bytes, written_s = sum(segment.stat().st_size for segment in segments), segments[-1].stat().st_mtime
        header, last = find_header(run) or NO_HEADER, _last(segments)
    except (BadInput, *CANNOT_BE_READ):
        return RunRow(title, count)
    end, tick, truth, outcome = (last.get(kind) for kind in (None, Tick, Truth, Outcome))
    episodes = tick.remembered("episodes") if isinstance(tick, Tick) else None
    without_end = "running" if abs(now_wall_s - written_s) < ALIVE_S else CUT_OFF
    return RunRow(
        title, count, header.trial,
        began_wall_s=began_wall_s(end) if header.trial is None else None,
        lasted_s=None if end is None else end.elapsed_s,
        rover=header.rover, algorithm=header.algorithm, simulated=header.simulated, dry_run=header.dry_run,
        commanded_m=tick.travelled_m if isinstance(tick, Tick) else None,
        episodes=None if episodes is None else round(episodes),
        outcome=outcome.reason if isinstance(outcome, Outcome) else without_end,
        size_bytes=size_bytes, version=header.version,
        driven_m=truth.driven_m if isinstance(truth, Truth) else None,
    )  # fmt: skip


def _last(segments: Sequence[Path]) -> dict[type[AnyRecord] | None, AnyRecord]:
    """Return the last record of each kind, and under None the last of all, from the end of a log.

    If the newest segment has no tick, the end of the one before counts as well.
    """
    newest: dict[type[AnyRecord] | None, AnyRecord] = {}
    lines: list[bytes] = []
    for segment in reversed(segments[-2:]):
        with open_log(segment) as file:
            go_to_last(file, TAIL_BYTES)
            tail = file.read(TAIL_BYTES) or b""  # None for a file of the kernel that would have to be waited for
        lines = tail.splitlines(keepends=True) + lines
        log_lines = Lines()
        newest = {}
        for record in map(log_lines.parse, lines):
            if record is not None:
                newest[None] = newest[type(record)] = record
        if Tick in newest:
            break
    return newest
