"""Console output of a run, for the terminal or the journal: one line for each event and change of phase."""

from __future__ import annotations

from collections.abc import Callable

from wayfarer.control.run_log import PartialLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Phase
from wayfarer.fieldlog.printable import clean
from wayfarer.fieldlog.vocabulary import PHASES, because
from wayfarer.fieldlog.wording import event_text, whole_deg


class ConsoleLog(PartialLog):
    """Writes one line for what a person wants to know; ``hint`` says what to do with a rover that stands ready."""

    def __init__(self, write: Callable[[str], None], hint: str) -> None:
        self._write = write
        self._hint = hint
        self._phase = Phase.HALT

    def tick(self, record: TickRecord) -> None:
        """Tell of a change of phase."""
        phase, seen = record.decision.phase, record.observation
        if phase is not self._phase and seen is not None:
            why = because(record.decision.why, [anomaly.value for anomaly in seen.anomalies])
            told = f"{PHASES[phase.value]}{'' if why == phase.value else f' ({why})'}"
            self._write(clean(f"{told}: heading {whole_deg(seen.heading_deg)}, {seen.travelled_m:.1f} m"))
        self._phase = phase

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002
        """Tell of an event; the terminal's own clock, or the journal's, says when."""
        self._write(event_text({"name": name, **details}))
        if name == "opened":
            self._write(f"disarmed. {self._hint}")

    def close(self, reason: str, text: str) -> None:
        """Tell how the run ended; an error is told by the command itself."""
        if reason != "failed":
            self._write(f"ended: {reason}: {text}")
