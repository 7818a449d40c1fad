"""What a log panel of Foxglove or a ground station shows: one line an event, with a name to filter by. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from wayfarer.fieldlog.record import Event, FaultInjected, Outcome
from wayfarer.fieldlog.run_fold import AnomalyBegan, BoardFaults, Gap, PowerChanged, RunBegan, Silence, Told
from wayfarer.fieldlog.wording import Tone, sentence
from wayfarer.logview.run_narrator import happened
from wayfarer.vocabulary import met

# The kinds of events that have lines, and the names of the lines; a noted event has its own name.
LOG_NAMES: Mapping[type[Told], str] = {
    RunBegan: "run", AnomalyBegan: "anomaly", BoardFaults: "board", PowerChanged: "power", Gap: "gap",
    Silence: "silence", FaultInjected: "fault", Outcome: "outcome", Event: "event",
}  # fmt: skip


class LogLine(NamedTuple):
    """One line; a ``tone`` of WARNING means that the rover drives on, FAULT that it stops."""

    name: str
    text: str
    tone: Tone


def log_lines(event: Told) -> Iterator[LogLine]:
    """Yield the lines of an event, in the words of a terminal; none for a kind that is not in ``LOG_NAMES``."""
    if type(event) not in LOG_NAMES:
        return
    name = event.name if isinstance(event, Event) else LOG_NAMES[type(event)]
    if isinstance(event, AnomalyBegan):  # a terminal tells it with its tick
        yield LogLine(name, sentence(met([event.kind], event.phase)), Tone.WARNING)
    for text, tone in happened(event):
        yield LogLine(name, text, tone)
