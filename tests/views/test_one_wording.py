"""An event is told in the same words everywhere, and so is what a log says of it that no view has heard of."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.views.text.records import HEADER, event, narrated, tick
from wayfarer.fieldlog.reader import Record
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.views.export.tables import csv_rows
from wayfarer.views.live.page_model import PageModel
from wayfarer.views.text.console import Console
from wayfarer.views.text.run_narrator import Telling

TICK = tick(0.5)
NEW_KEY = event("armed", 1.0, goal_heading_deg=12.0, moon="full")
NEW_EVENT = event("moon_rose", 1.0, height_deg=12.0)


def logs_show(*records: Record) -> str:
    return narrated(records)[-1].text


def logs_show_ticks(*records: Record) -> str:
    return narrated(records, Telling.TICKS)[-1].text


def console(*records: Record) -> str:
    lines: list[str] = []
    shown = Console("Say go", lines.append)
    for record in records:
        shown.show(record)
    return lines[-1].partition("  ")[2]


def live_page(*records: Record) -> str:
    model = PageModel()
    for record in records:
        model.take(record)
    text: str = model.snapshot()["lines"][-1][1]
    return text


def foxglove(*records: Record) -> str:
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    from wayfarer.views.foxglove.notes import KINDS, notes

    fold = RunFold()
    happened = [each for record in records for each in fold.take(record) if isinstance(each, KINDS)]
    told = [message for each in happened for message in notes(each)]
    return told[-1].text


def csv(*records: Record) -> str:
    titles, *_, last = csv_rows(records)
    return last[titles.index("event")]


@pytest.mark.parametrize("view", [logs_show, logs_show_ticks, console, live_page, foxglove, csv])
def test_every_view_tells_a_new_key_and_a_new_event(view: Callable[..., str]) -> None:
    assert view(HEADER, TICK, NEW_KEY) == "Armed: drives towards 12 degrees, moon full"
    assert view(HEADER, TICK, NEW_EVENT) == "moon rose: height 12 degrees"


@pytest.mark.parametrize("view", [console, live_page, foxglove])
def test_every_view_tells_missing_records_and_ticks(view: Callable[..., str]) -> None:
    assert view(HEADER, {**TICK, "n": 1}, {**tick(0.55), "n": 5}) == "3 records are missing"
    assert view(HEADER, TICK, tick(9.0)) == "no ticks for 8.5 s"
