"""The rows of anomalies and events above the time lines: one row for each kind, and for each mark of a person."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from wayfarer.fieldlog.fields import name, number
from wayfarer.fieldlog.wording import Tone, event_tone
from wayfarer.views.run_report.data import GAP_S, LoggedEvent, RunData
from wayfarer.views.run_report.drawing import BLACK, GREY, VERMILION
from wayfarer.views.run_report.marks import ANOMALY_MARKS, is_trouble

MOST = 24  # rows; the list of events has all events
LONGEST = 18  # letters of a row's text; the list of events has all letters
NO_ROW = {"opened", "arming", "wheels_stopped"}
ANOMALY, MARK, TROUBLE, BY_HAND, OTHER = range(5)  # ranks: where there are too many rows, the last ones are left out


class EventRow(NamedTuple):
    """One row: its rank, its text, its colour, and the times in seconds."""

    rank: int
    text: str
    colour: str
    times_s: list[float]


def event_rows(data: RunData) -> list[EventRow]:
    """Return all rows of a run by rank, then by the time at which each begins; a figure shows the first ``MOST``."""
    rows: dict[str, EventRow] = {}
    for t_s, rank, text, colour in sorted([*_anomalies(data), *_events(data), *_silences(data)]):
        rows.setdefault(text, EventRow(rank, text, colour, [])).times_s.append(t_s)
    return sorted(rows.values(), key=lambda row: row.rank)


def _anomalies(data: RunData) -> Iterator[tuple[float, int, str, str]]:
    for onset in data.onsets:
        yield onset.t_s, ANOMALY, onset.kind.replace("_", " "), ANOMALY_MARKS[onset.kind][1]


def _events(data: RunData) -> Iterator[tuple[float, int, str, str]]:
    for event in data.events:
        if _has_row(event):
            trouble, by_hand = is_trouble(event), event_tone(event.record) is Tone.PERSON
            rank = MARK if event.mark else TROUBLE if trouble else BY_HAND if by_hand else OTHER
            text = event_label(event)
            text = text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
            yield event.t_s, rank, text, VERMILION if trouble else BLACK


def _silences(data: RunData) -> Iterator[tuple[float, int, str, str]]:
    """Yield the times from which nothing was logged of the control loop."""
    for before_s, t_s in pairwise(data.ticks["t_s"].tolist()):
        if t_s - before_s > GAP_S:
            yield before_s, TROUBLE, f"no ticks for {t_s - before_s:.0f} s", GREY


def _has_row(event: LoggedEvent) -> bool:
    """Leave out what another row or the bar of holds says as well."""
    if event.name == "health":
        return event.record.get("level") != "well" and event.record.get("cause") != "operator_hold"
    return event.name not in NO_ROW


def event_label(event: LoggedEvent) -> str:
    """Return an event in a few words."""
    record = event.record
    if event.mark:
        return f"{event.mark} {name(record, 'text') or ''}".rstrip()
    if event.name == "goal" and (goal_deg := number(record, "goal_heading_deg")) is not None:
        return f"goal {goal_deg:.0f}°"
    if event.name == "health":
        return (name(record, "cause") or "health").replace("_", " ")
    if event.name == "sensor_failed":
        return f"{name(record, 'sensor') or 'sensor'} failed"
    if event.name == "clock_step" and (by_s := number(record, "by_s")) is not None:
        return f"clock {by_s:+.0f} s"
    return event.name.replace("_", " ")
