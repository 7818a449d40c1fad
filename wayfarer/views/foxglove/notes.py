"""Messages of the Foxglove log panel: events, beginnings of anomalies, the end of the run. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foxglove.messages import LogLevel

from wayfarer.fieldlog.run_events import AnomalyBegan, Ended, FaultInjected, Noted, RunBegan
from wayfarer.fieldlog.typed import RunEvent
from wayfarer.fieldlog.vocabulary import met
from wayfarer.fieldlog.wording import Tone, event_text, event_tone, fault_text, outcome_text, run_text, sentence

LEVELS: Mapping[Tone, LogLevel] = {Tone.WARNING: LogLevel.Warning, Tone.FAULT: LogLevel.Error}  # else for information


class LogMessage(NamedTuple):
    """One line: how severe, what kind of thing it is about, and the text."""

    level: LogLevel
    name: str
    text: str


def note(event: RunEvent) -> LogMessage | None:
    """Return the line for something that happened; None for what the other channels show."""
    match event:
        case Noted(name=name, record=record):
            return LogMessage(LEVELS.get(event_tone(record), LogLevel.Info), name, event_text(record))
        case AnomalyBegan(kind=kind, phase=phase):
            return LogMessage(LogLevel.Warning, "anomaly", sentence(met([kind], phase)))
        case FaultInjected():
            return LogMessage(LogLevel.Warning, "fault", fault_text(event))
        case RunBegan(header=header):
            return LogMessage(LogLevel.Info, "run", run_text(header))
        case Ended():
            return LogMessage(LogLevel.Info, "outcome", outcome_text(event))
        case _:
            return None
