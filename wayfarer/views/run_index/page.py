"""Writes the index of all runs in a folder: one page that needs no network, and without scripts is a plain table."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

from markupsafe import Markup

from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import local_time
from wayfarer.fieldlog.folders import run_folders
from wayfarer.views.page import html
from wayfarer.views.page.frame import PAGE, write_page
from wayfarer.views.run_index.findings import RunFindings, findings_of
from wayfarer.views.text.listing import CELLS, CUT_OFF, UNREADABLE, RunRow, row_of

INDEX = "index.html"
MARKS, MARK_CHARS = 10, 120  # shown of a run; its report has all
UNKNOWN = RunFindings()

_filters, _link = html.macros("wayfarer.views.run_index", "filters", "link")


def write_index(logs: Path, now_wall_s: float, out: Path | None = None) -> Path:
    """Write the index of all runs, the newest first, and return its path: ``out``, or ``index.html`` in the folder.

    Args:
        logs: the folder of all runs. Those that cannot be read have a row that says so.
        now_wall_s: the wall time, which tells a run that goes on from one that was cut off.
        out: the file that a person chose instead; the page's links lead from there to the runs.

    Raises:
        BadInput: the folder cannot be read or holds no run, or the page cannot be written.
    """
    runs = run_folders(logs)
    if not runs:
        raise BadInput(f"{logs} holds no run; give the folder of the logs with --log-dir DIR")
    begin = Path(os.path.relpath(logs, out.parent if out else logs))
    rows = [_row(run, begin / run.name, now_wall_s) for run in reversed(runs)]
    caption = (
        f"As of {local_time(now_wall_s, '%Y-%m-%d %H:%M')}. A run without a report gets one by wayfarer report RUN."
    )
    body = [_filters(), html.table(caption, tuple(_columns(RunRow(""), UNKNOWN)), rows)]
    return write_page(logs / INDEX, "Runs", body, script=_index_js(), out=out)


def _row(run: Path, place: Path, now_wall_s: float) -> tuple[str, list[str]]:
    """Return the class and the cells of a run's row; ``place`` is its folder as seen from the page."""
    row = row_of(run, now_wall_s)
    cells = dict(_columns(row, None if row.outcome == UNREADABLE else findings_of(run)))
    cells["run"] = _link(f"{_address(place)}/", cells["run"])
    if (run / PAGE).is_file():
        cells["report"] = _link(_address(place / PAGE), "report")
    return "indexed damaged" if row.outcome in {UNREADABLE, CUT_OFF} else "indexed", list(cells.values())


def _columns(row: RunRow, found: RunFindings | None) -> Mapping[str, str]:
    """Return what the index tells of a run, by the titles of its columns."""
    known = found or UNKNOWN
    told = {title: cell(row) for title, cell in CELLS.items()}
    run, outcome = told.pop("run"), told.pop("outcome")
    del told["MB"]
    return {
        "run": run,
        "report": "",
        **told,
        "anomalies": f"{known.anomalies}" if found else "",
        "outcome": outcome,
        "marks": "\n".join(_marks(known.marks)),
        "version": row.version or "",
    }


def _marks(texts: Sequence[str]) -> Iterator[str]:
    for text in texts[:MARKS]:
        yield text if len(text) <= MARK_CHARS else f"{text[:MARK_CHARS]}…"
    if len(texts) > MARKS:
        yield f"and {len(texts) - MARKS} more"


def _address(place: Path) -> str:
    """Return a relative address: a name may hold any bytes."""
    return quote(os.fsencode(place))


def _index_js() -> Markup:
    return Markup((files("wayfarer.views.run_index") / "index.js").read_text(encoding="utf-8"))
