"""The events of a run as lines of text, with its state now and then. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from wayfarer.fieldlog.fields import duration_text
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.run_events import (
    AnomalyBegan,
    BatteryChanged,
    BoardFaults,
    Ended,
    FaultInjected,
    Gap,
    Noted,
    PhaseChanged,
    PowerChanged,
    RunBegan,
    Silence,
)
from wayfarer.fieldlog.tick_wording import aim_text, anomaly_text, phase_text, reason_text, state_text, tick_text
from wayfarer.fieldlog.typed import Board, Fix, RunEvent, Tick
from wayfarer.fieldlog.wording import (
    Tone,
    event_text,
    event_tone,
    fault_text,
    outcome_text,
    place_text,
    run_text,
    silence_text,
)

STATUS_S = 5.0  # a line at least so often while the rover drives
STANDING_S = 60.0  # and while it stands: enough to see that it lives

Told = tuple[str, Tone]
Change = PhaseChanged | AnomalyBegan


class Verbosity(Enum):
    """What is told of the control ticks: changes in sentences, changes and a status in columns, or every tick."""

    CHANGES = "changes"
    STATUS = "status"
    TICKS = "ticks"


class Line(NamedTuple):
    """One line: ``elapsed_s`` of its record, a text that is fit for a terminal, and its tone."""

    elapsed_s: float
    text: str
    tone: Tone

    def __str__(self) -> str:
        return f"{duration_text(self.elapsed_s, 2)}  {self.text}"


class RunNarrator:
    """Turns what ``RunFold`` yields of a run into lines.

    Args:
        verbosity: what is told of the control ticks. With ``CHANGES`` a line is told only where something has changed.
    """

    def __init__(self, verbosity: Verbosity) -> None:
        self._verbosity = verbosity
        self._battery_v: float | None = None
        self._status_t_s = self._position_t_s = float("-inf")

    def tell(self, events: Sequence[RunEvent]) -> list[Line]:
        """Return the lines for what a record tells; most records have none."""
        change = next((event for event in events if isinstance(event, Change)), None) if len(events) > 1 else None
        lines = [Line(event.elapsed_s, *told) for event in events for told in self._told(event, change)]
        return [line for line in lines if line.tone is not Tone.QUIET or self._verbosity is not Verbosity.CHANGES]

    def _told(self, event: RunEvent, change: Change | None) -> Iterable[Told]:
        match event:
            case Tick():
                return self._tick(event, change)
            case Board(battery_v=battery_v):
                self._battery_v = battery_v
                return ()
            case Fix():
                return self._fix(event)
            case _:
                return happened(event)

    def _tick(self, tick: Tick, change: Change | None) -> Iterable[Told]:
        if self._verbosity is Verbosity.TICKS:
            return [(tick_text(tick), Tone.PLAIN)]
        if self._verbosity is Verbosity.CHANGES:
            tell = phase_text if isinstance(change, PhaseChanged) else anomaly_text
            return [] if change is None else [(tell(tick), Tone.PHASE)]
        due_s = STANDING_S if tick.phase == "halt" else STATUS_S
        if change is None and tick.t_s - self._status_t_s < due_s:
            return []
        self._status_t_s = tick.t_s
        if change is not None:
            return [(f"{state_text(tick)}  {reason_text(tick)}".rstrip(), Tone.PHASE)]
        return [(f"{state_text(tick)}  {aim_text(tick, self._battery_v)}".rstrip(), Tone.QUIET)]

    def _fix(self, fix: Fix) -> Iterable[Told]:
        if fix.t_s - self._position_t_s < STANDING_S:
            return ()
        self._position_t_s = fix.t_s
        return [(f"position {place_text(fix)}", Tone.QUIET)]


def happened(event: RunEvent) -> Iterator[Told]:
    """Give the text and the tone of what stands in a line whenever it happens."""
    match event:
        case Noted(record=record):
            yield event_text(record), event_tone(record)
        case Gap(missing=missing, announced=False):
            yield str(Damage(missing=missing)), Tone.WARNING
        case Silence():
            yield silence_text(event), Tone.WARNING
        case BatteryChanged(battery_v=battery_v):
            yield f"battery {battery_v:.1f} V", Tone.QUIET
        case BoardFaults(faults=faults):
            yield f"motor board: {', '.join(faults) or 'well again'}", Tone.FAULT if faults else Tone.PLAIN
        case PowerChanged(bits=""):
            yield "computer: power and heat are normal again", Tone.PLAIN
        case PowerChanged(bits=bits):
            yield f"computer: power and heat bits {bits} (see vcgencmd get_throttled)", Tone.WARNING
        case FaultInjected():
            yield fault_text(event), Tone.WARNING
        case RunBegan(header=header):
            yield run_text(header), Tone.PLAIN
            if event.late:
                yield f"the log begins with part {header.part}: earlier parts are missing", Tone.WARNING
        case Ended():
            yield outcome_text(event), Tone.END
