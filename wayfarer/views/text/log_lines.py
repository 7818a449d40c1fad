"""What a log panel of Foxglove or a ground station shows: one line an event, with a name to filter by. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

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

# The kinds of events that have lines, and the names of the lines; a noted event has its own name.
LOG_NAMES: Mapping[type[RunEvent], str] = {
    RunBegan: "run", AnomalyBegan: "anomaly", BoardFaults: "board", PowerChanged: "power", Gap: "gap",
    Silence: "silence", FaultInjected: "fault", Ended: "outcome", Noted: "event",
}  # fmt: skip


class LogLine(NamedTuple):
    """One line; a ``tone`` of WARNING means that the rover drives on, FAULT that it stops."""

    name: str
    text: str
    tone: Tone


def log_lines(event: RunEvent) -> Iterator[LogLine]:
    """Yield the lines of an event, in the words of a terminal; none for a kind that is not in ``LOG_NAMES``."""
    if type(event) not in LOG_NAMES:
        return
    name = event.name if isinstance(event, Noted) else LOG_NAMES[type(event)]
    if isinstance(event, AnomalyBegan):  # a terminal tells it with its tick
        yield LogLine(name, sentence(met([event.kind], event.phase)), Tone.WARNING)
    for text, tone in happened(event):
        yield LogLine(name, text, tone)
