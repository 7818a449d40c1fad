"""Shows a run on the terminal of its daemon, or in the journal: what happens, in the words of ``wayfarer logs``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from shlex import quote

from wayfarer.fieldlog.clock import duration_text, local_time
from wayfarer.fieldlog.record import AnyRecord, Event, Header, Outcome
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.logview.colour import painted
from wayfarer.logview.run_narrator import RunNarrator, Verbosity


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
        self._fold, self._narrator = RunFold(), RunNarrator(Verbosity.CHANGES)

    def show(self, record: AnyRecord) -> None:
        """Take a record; if nothing has changed, nothing is written."""
        if isinstance(record, Outcome) and record.reason == "failed":
            return  # the command itself tells of its error
        told = self._narrator.tell(self._fold.take(record))
        in_trial = self._fold.state.header.trial is not None
        at = duration_text(record.elapsed_s, 1) if in_trial else local_time(record.t_wall, "%H:%M:%S")
        for line in told:
            self._write(f"{at}  {painted(line.text, line.tone.value, sys.stderr)}")
        match record:
            case Header(log=str(log)):
                self._log = log
            case Event(name="opened") if self._hint:
                self._write(f"{at}  disarmed. {self._hint}")
            case Outcome() if self._then:
                self._write(f"Next: {self._then} {quote(self._log)}")
