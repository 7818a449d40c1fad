"""Messages of the Foxglove log panel: events, beginnings of anomalies, the end of the run. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from foxglove.messages import LogLevel

from wayfarer.fieldlog.reader import Record
from wayfarer.views.text.wording import Tone, event_name, event_text, event_tone, fault_text, outcome_text, run_text

LEVELS: Mapping[Tone, LogLevel] = {Tone.WARNING: LogLevel.Warning, Tone.FAULT: LogLevel.Error}  # else for information


class LogMessage(NamedTuple):
    """One line: how severe, what kind of thing it is about, and the text."""

    level: LogLevel
    name: str
    text: str


class Notes:
    """Turns the records of one run, in their order, into lines."""

    def __init__(self) -> None:
        self._anomalies: frozenset[str] = frozenset()

    def take(self, record: Record) -> Iterator[LogMessage]:
        """Give the lines of one record; a tick that is not as its schema says may raise anything."""
        match record["record"]:
            case "run" if record.get("part", 1) == 1:
                yield LogMessage(LogLevel.Info, "run", run_text(record))
            case "event":
                level = LEVELS.get(event_tone(record), LogLevel.Info)
                yield LogMessage(level, event_name(record), event_text(record))
            case "fault":
                yield LogMessage(LogLevel.Warning, "fault", fault_text(record))
            case "outcome":
                yield LogMessage(LogLevel.Info, "outcome", outcome_text(record))
            case "tick":
                yield from self._begun(record)

    def _begun(self, tick: Record) -> Iterator[LogMessage]:
        before, self._anomalies = self._anomalies, frozenset(tick.get("anomalies", ()))
        for name in sorted(self._anomalies - before):
            yield LogMessage(LogLevel.Warning, "anomaly", f"{name} in {tick.get('phase')}")
