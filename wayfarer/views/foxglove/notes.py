"""Messages of the Foxglove log panel, in the words of a terminal: what happened, and beginnings of anomalies. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from foxglove.messages import LogLevel

from wayfarer.fieldlog.run_events import (
    AnomalyBegan,
    BoardFaults,
    Ended,
    FaultInjected,
    Gap,
    Noted,
    PowerChanged,
    RunBegan,
    Silence,
)
from wayfarer.fieldlog.typed import RunEvent
from wayfarer.fieldlog.vocabulary import met
from wayfarer.fieldlog.wording import Tone, sentence
from wayfarer.views.text.run_narrator import happened

LOG_LEVELS: Mapping[Tone, LogLevel] = {
    Tone.WARNING: LogLevel.Warning,
    Tone.FAULT: LogLevel.Error,
}  # else for information
NAMES: Mapping[type[RunEvent], str] = {
    RunBegan: "run", AnomalyBegan: "anomaly", BoardFaults: "board", PowerChanged: "power", Gap: "gap",
    Silence: "silence", FaultInjected: "fault", Ended: "outcome",
}  # fmt: skip
KINDS = (*NAMES, Noted)  # what the panel tells; the other channels show the rest


class LogMessage(NamedTuple):
    """One line: how severe, what kind of thing it is about, and the text."""

    level: LogLevel
    name: str
    text: str


def notes(event: RunEvent) -> Iterator[LogMessage]:
    """Give the lines for something that happened, of one of the ``KINDS``."""
    name = event.name if isinstance(event, Noted) else NAMES[type(event)]
    for text, tone in _lines(event):
        yield LogMessage(LOG_LEVELS.get(tone, LogLevel.Info), name, text)


def _lines(event: RunEvent) -> Iterator[tuple[str, Tone]]:
    if isinstance(event, AnomalyBegan):  # a terminal tells it with its tick
        yield sentence(met([event.kind], event.phase)), Tone.WARNING
    yield from happened(event)
