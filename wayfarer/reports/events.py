"""Anomalies and events of a run, as layers that can be shown and hidden."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from math import radians
from typing import Any, NamedTuple

from wayfarer.fieldlog.record import Event
from wayfarer.fieldlog.run_fold import Silence
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview import palette
from wayfarer.logview.run_narrator import happened
from wayfarer.reports.data import RunData
from wayfarer.reports.page.html import PlotLayer
from wayfarer.vocabulary import in_words

LAYERS = (
    PlotLayer("anomaly", "anomalies", palette.ANOMALY),
    PlotLayer("mark", "marks", palette.MARK),
    PlotLayer("trouble", "trouble", palette.TROUBLE),
    PlotLayer("person", "operator", palette.PERSON),
    PlotLayer("other", "other", palette.OTHER, shown=False),
)
EDGE: Mapping[str, Any] = {"line_color": palette.EDGE, "line_width": 0.8}
LOOK: Mapping[str, Any] = {"marker": "shape", "angle": "turned", **EDGE}


class EventMark(NamedTuple):
    """Something at a time: its layer, what a pointer is told of it, and the shape and the turn of its mark."""

    t_s: float
    layer: str
    text: str
    shape: str = "diamond"
    turned_deg: float = 0.0


def columns(found: Sequence[EventMark]) -> dict[str, Any]:
    """Return what marks show, by column of Bokeh's; ``LOOK`` reads them."""
    return {
        "t": [each.t_s for each in found], "what": [each.text for each in found],
        "shape": [each.shape for each in found], "turned": [radians(each.turned_deg) for each in found],
    }  # fmt: skip


def event_marks(data: RunData) -> list[EventMark]:
    """Return all that a run's panels mark, by time."""
    return sorted([*_anomalies(data), *_events(data)])


def _anomalies(data: RunData) -> Iterator[EventMark]:
    for onset in data.onsets:
        shape, turned_deg = palette.ANOMALY_MARKERS[onset.kind]
        yield EventMark(onset.elapsed_s, "anomaly", in_words(onset.kind), shape, turned_deg)


def _events(data: RunData) -> Iterator[EventMark]:
    for event, text in told_events(data):
        at_s = event.began_s if isinstance(event, Silence) else event.elapsed_s
        if _is_mark(event):
            yield EventMark(at_s, "mark", text, "hex")
        elif is_trouble(event):
            yield EventMark(at_s, "trouble", text)
        else:
            yield EventMark(at_s, "person" if _told(event)[1] is Tone.PERSON else "other", text)


def told_events(data: RunData) -> Iterator[tuple[Event | Silence, str]]:
    """Give the events of a run, each with the words of a terminal; a person's marks with their numbers."""
    marks = count(1)
    for event in data.events:
        text = _told(event)[0]
        yield event, f"{next(marks)}. {text}" if _is_mark(event) else text


def is_trouble(event: Event | Silence) -> bool:
    """Return whether an event tells of something that went wrong; a hold that an operator asked for did not."""
    operator_hold = isinstance(event, Event) and event.data.get("cause") == "operator_hold"
    return _told(event)[1] in (Tone.WARNING, Tone.FAULT) and not operator_hold


def _is_mark(event: Event | Silence) -> bool:
    return isinstance(event, Event) and event.name == "mark"


def _told(event: Event | Silence) -> tuple[str, Tone]:
    ((text, tone),) = happened(event)  # of these two kinds always one line
    return text, tone
