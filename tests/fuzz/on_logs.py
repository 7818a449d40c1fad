"""Logs of runs, and everything that is made of them."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
from hypothesis import strategies as st

from tests.fuzz.damage import as_json, bytes_of, json_of
from tests.fuzz.on_files import MEMORY, check_finite
from tests.fuzz.target import Case, Target, Try, reading
from tests.logview.records import RUN, SAMPLE_LOGS, event, narrated, numbered, record
from wayfarer.errors import BadInput
from wayfarer.export import ExportFormat, export
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.replay import replay
from wayfarer.logview.listing import lines, rows
from wayfarer.logview.narrator import Verbosity
from wayfarer.logview.summary import check_log, summarise, summary_text
from wayfarer.logview.tail import RunTail
from wayfarer.reports.data import read_run

(SAMPLE,) = SAMPLE_LOGS.glob("00001-*")
WHOLE = [msgspec.json.decode(line) for line in (SAMPLE / "run.00001.jsonl").read_bytes().splitlines()]
DRIVEN = next(count for count, each in enumerate(WHOLE) if each.get("phase") == "back_off")
BEGAN_S = WHOLE[0]["t_s"] - 100.0  # where tests.logview.records begin
TOLD = [
    {**each, "t_s": each["t_s"] + BEGAN_S}
    for each in (
        record("position", 0.5, latitude_deg=51.5, longitude_deg=-0.1, error_m=3.0),
        record("board", 0.5, battery_v=11.0, faults=["motor A: too hot"]),
        record("computer", 0.5, cpu_c=80.0, throttled="0x50005", load_1min=1.0, disk_free_mb=100.0, log_dropped=3),
        event("disarmed", 0.5, reason="asked"),
        event("sensor_failed", 0.5, sensor="motion", error="no answer"),
        event("clock_step", 0.5, by_s=3600.0),
        event("hold", 0.5),
        event("resume", 0.5),
        event("goal", 0.5, goal_heading_deg=90.0),
        event("mark", 0.5, note="hit log"),
        event("arming", 0.5, goal_heading_deg=10.0),
        event("board_silent", 0.5, error="no answer"),
        event("motors_failed", 0.5, error="no answer"),
    )
]
# As replaying needs it, whole up to somewhere; and some of each kind, for everything else.
DRIVING = [each for each in WHOLE[:24] if each["record"] != "truth"]
BEGINNING = [
    WHOLE[:DRIVEN],
    numbered([WHOLE[0], *TOLD[1:], *DRIVING[4:8]]),
]
KINDS = [[WHOLE[0], *WHOLE[1:12], *TOLD, *WHOLE[DRIVEN - 2 : DRIVEN + 6], WHOLE[-1]], [WHOLE[0], *WHOLE[-8:]]]


def _as_lines(log: Any) -> bytes:
    return b"".join(as_json(each) + b"\n" for each in log) if isinstance(log, list) else as_json(log)


def _shuffled(log: list[Any], picks: Sequence[int]) -> list[Any]:
    """Return a log in which some records stand a second time, elsewhere."""
    log = list(log)
    for pick in picks:
        log.insert(pick % 97 % len(log), log[pick % len(log)])
    return log


def logs_of(whole: Sequence[list[Any]], most: int = 6) -> st.SearchStrategy[Case]:
    """Make logs as bytes: damaged ones, ones of which values were changed, and ones in another order."""
    contents = [_as_lines(log) for log in whole]
    changed = json_of(whole, most).map(_as_lines)
    shuffled = st.builds(_shuffled, st.sampled_from(whole), st.lists(st.integers(0, 9_999), max_size=4)).map(_as_lines)
    return bytes_of(contents) | changed | changed | shuffled


@contextmanager
def _runs(use: Callable[[Path], str]) -> Iterator[Try]:
    """Make each case the log of a run, in a folder of its own name."""
    with tempfile.TemporaryDirectory(prefix="wf-", dir=MEMORY) as folder:
        run = Path(folder) / RUN
        run.mkdir()

        def attempt(content: bytes) -> str:
            (run / "run.00001.jsonl").write_bytes(content)
            return reading(lambda: use(run))

        yield attempt


# -- what is told in words -------------------------------------------------------------------------------------------


def _tell(run: Path) -> str:
    """See that what is told of a log is fit for a terminal, and that it is told to the end."""
    for verbosity in Verbosity:
        assert all(str(line).isprintable() for line in narrated(RunReader(run), verbosity))
    reader = RunReader(run)
    found = summarise(reader)
    assert all(line.isprintable() for line in summary_text("17", found, reader.damage).splitlines())
    json.dumps(msgspec.to_builtins(asdict(found)), allow_nan=False)
    assert all(line.isprintable() for line in lines(rows(run.parent, 0.0), 80))
    verdict = check_log(run)
    assert str(verdict).isprintable()
    assert sum(1 for _ in _followed(run)) <= len(run.joinpath("run.00001.jsonl").read_bytes().split(b"\n"))
    return f"{verdict.integrity.name}, {found.reason is None} {bool(reader.damage.lines)} {found.where is None}"


def _followed(run: Path) -> Iterator[Any]:
    tail = RunTail(run)
    try:
        yield from tail.read()
    finally:
        tail.close()


STORY = Target(
    "log",
    logs_of(KINDS),
    lambda: _runs(_tell),
)  # fmt: skip


# -- what is written -------------------------------------------------------------------------------------------------


def _export(run: Path) -> str:
    out = run.parent / "out.mcap"
    with suppress(BadInput):  # no position
        ExportFormat.gpx.write(run, io.StringIO())
    ExportFormat.csv.write(run, io.StringIO())
    export(run, ExportFormat.mcap, out, overwrite=True)
    return f"mcap, {len(str(out.stat().st_size))} digits of bytes"


EXPORT = Target(
    "export",
    logs_of(KINDS),
    lambda: _runs(_export),
)  # fmt: skip


def _replay(run: Path) -> str:
    result = replay(run)
    if result.difference is not None:
        return f"{result.difference.key} differs"
    return f"{'cut' if result.cut_elapsed_s is not None else 'whole'}, {'some' if result.ticks else 'no'} decisions"


def _told_while_driving(told: Any) -> bytes:
    """Return the log of a rover that drives, up to a few ticks after something was told."""
    return b"".join(map(_as_lines, ([WHOLE[0]], numbered([*DRIVING[1:-4]]), [told], numbered(DRIVING[-4:]))))


REPLAY = Target(
    "replay",
    logs_of(BEGINNING, most=2) | json_of([*TOLD, DRIVING[-5]], 2).map(_told_while_driving),
    lambda: _runs(_replay),
)


def _read_run(run: Path) -> str:
    data = read_run(run)
    check_finite(data.batteries["battery_v"].tolist())
    return f"{data.has_way} {len(data.episodes)} {bool(data.fixes)} {len(data.sensors)}"


RUN_READING = Target(
    "run-reading",
    logs_of([*KINDS, WHOLE[:DRIVEN]]),
    lambda: _runs(_read_run),
)


def _report(run: Path) -> str:
    from wayfarer.reports.run import write_run_report  # and Bokeh with it, which few fuzz

    write_run_report(run, run.parent / "report.html")
    return "a page"


REPORT = Target(
    "report",
    logs_of(KINDS),
    lambda: _runs(_report),
    quick=2,
)  # fmt: skip
