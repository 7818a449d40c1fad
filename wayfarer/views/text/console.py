"""Shows a run on the terminal of its daemon, or in the journal: what happens, in the words of ``wayfarer logs``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from shlex import quote

from wayfarer.fieldlog.clock import duration_text, local_time
from wayfarer.fieldlog.fields import safe_text
from wayfarer.fieldlog.run_events import event_name
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.views.text.colour import painted
from wayfarer.views.text.run_narrator import RunNarrator, Verbosity


class Console:
    """Takes the records of a run and writes a line with the wall time for each thing that happens.

    A trial has virtual time: its lines have the time since it began, as everywhere else.

    Args:
        hint: what to do with a rover that is ready; told once it is. Empty for none.
        write: takes a line for stderr, and must not wait.
        then: the command that comes next, told with the run's folder at its end; empty for none.
    """

    def __init__(self, hint: str, write: Callable[[str], None], then: str = "") -> None:
        self._hint = hint
        self._write = write
        self._then = then
        self._log = ""
        self._fold, self._narrator = RunFold(reckons=False), RunNarrator(Verbosity.CHANGES)

    def show(self, record: Record) -> None:
        """Take a record; where nothing has changed, nothing is written."""
        kind = record["record"]
        if kind == "outcome" and record["reason"] == "failed":
            return  # the command itself tells of its error
        told = self._narrator.tell(self._fold.take(record))
        state = self._fold.state
        in_trial = state.header.trial is not None
        at = duration_text(state.elapsed_s, 1) if in_trial else local_time(record["t_wall"], "%H:%M:%S")
        for line in told:
            self._write(f"{at}  {painted(line.text, line.tone.value, sys.stderr)}")
        if kind == "run":
            self._log = safe_text(record, "log") or ""
        elif kind == "event" and event_name(record) == "opened" and self._hint:
            self._write(f"{at}  disarmed. {self._hint}")
        elif kind == "outcome" and self._then:
            self._write(f"Next: {self._then} {quote(self._log)}")
