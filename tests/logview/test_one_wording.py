"""An event is told in the same words everywhere, and so is what a log says of it that no view has heard of."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.logview.records import HEADER, Json, event, narrated, read, record, tick, write
from wayfarer.export.tables import csv_rows, further_columns
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.logview.narrator import Console, Verbosity, log_lines
from wayfarer.remote.live.model import PageModel
from wayfarer.reports.data import read_run
from wayfarer.reports.panels import panels_of

TICK = tick(0.5)
NEW_EVENT = event("moon_rose", 1.0, "The moon rose", height_deg=12.0)


def logs_show(*records: Json) -> str:
    return narrated(records)[-1].text


def logs_show_ticks(*records: Json) -> str:
    return narrated(records, Verbosity.TICKS)[-1].text


def console(*records: Json) -> str:
    lines: list[str] = []
    shown = Console("Say go", lines.append)
    for each in map(read, records):
        shown.show(each)
    return lines[-1].partition("  ")[2]


def live_page(*records: Json) -> str:
    model = PageModel()
    for each in map(read, records):
        model.add(each)
    text: str = model.snapshot()["lines"][-1][1]
    return text


def log_panel(*records: Json) -> str:
    fold = RunFold()
    return [line.text for taken in map(read, records) for each in fold.add(taken) for line in log_lines(each)][-1]


def csv(*records: Json) -> str:
    titles, *_, last = csv_rows(map(read, records))
    return last[titles.index("event")]


@pytest.mark.parametrize("view", [logs_show, logs_show_ticks, console, live_page, log_panel, csv])
def test_every_view_tells_a_new_event(view: Callable[..., str]) -> None:
    assert view(HEADER, TICK, NEW_EVENT) == "The moon rose"


@pytest.mark.parametrize(
    ("remembered", "told"),
    [({"side": "left"}, "side left"), ({"side": 1, "path": [], "mood": {}, "name": "", "n2": 0}, "n2 0")],
)
def test_what_is_no_number_where_others_remember_one_is_told_and_nothing_is_not(remembered: Json, told: str) -> None:
    assert logs_show_ticks(HEADER, tick(0.5)) + f", {told}" == logs_show_ticks(HEADER, tick(0.5, **remembered))


@pytest.mark.parametrize("view", [console, live_page, log_panel])
def test_every_view_tells_missing_records_and_ticks(view: Callable[..., str]) -> None:
    assert view(HEADER, {**TICK, "n": 1}, {**tick(0.55), "n": 5}) == "3 records are missing"
    assert view(HEADER, TICK, tick(9.0)) == "no ticks for 8.5 s"


@pytest.mark.parametrize("view", [console, live_page, log_panel])
def test_every_view_tells_what_is_wrong_with_board_and_computer(view: Callable[..., str]) -> None:
    assert view(HEADER, record("board", 1.0, faults=["overheated"])) == "motor board: overheated"
    assert view(HEADER, record("computer", 1.0, throttled="0x0"), record("computer", 2.0, throttled="0x1")) == (
        "computer: power and heat bits 1 (see vcgencmd get_throttled)"
    )


def test_every_view_has_a_new_key_of_a_tick(tmp_path: Path) -> None:
    records = [HEADER, tick(0.5, moon_deg=12.0), tick(0.55, moon_deg=13.0)]
    assert logs_show_ticks(*records).endswith(", moon deg 13")
    titles, *rows = csv_rows(map(read, records), further_columns(map(read, records)))
    assert [row[titles.index("moon_deg")] for row in rows] == ["12.0", "13.0"]
    model = PageModel()
    for each in map(read, records):
        model.add(each)
    assert model.state()["further"] == "moon deg 13"
    model.add(read(tick(0.6, stars="x" * 10_000)))
    assert len(model.state()["further"]) == 500, "a page is for a telephone"
    assert panels_of(read_run(write(tmp_path, records)))[-1].title == "moon_deg"
