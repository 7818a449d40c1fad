"""The events of a run as lines of text, with its state now and then. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from wayfarer.fieldlog.fields import span
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
)
from wayfarer.fieldlog.typed import Board, Fix, RunEvent, Tick
from wayfarer.views.text.wording import (
    Tone,
    aim_text,
    event_text,
    event_tone,
    fault_text,
    outcome_text,
    place_text,
    reason_text,
    run_text,
    state_text,
    tick_text,
)

STATUS_S = 5.0  # a line at least so often while the rover drives
STANDING_S = 60.0  # and while it stands: enough to see that it lives

Told = Iterator[tuple[str, Tone]]


class Line(NamedTuple):
    """One line: seconds since the run began, a text that is fit for a terminal, and its tone."""

    at_s: float
    text: str
    tone: Tone

    def __str__(self) -> str:
        return f"{span(self.at_s, 2)}  {self.text}"


class RunNarrator:
    """Turns what ``RunFold`` yields of a run into lines.

    Args:
        ticks: tell every control tick, instead of changes of phase and a status now and then.
    """

    def __init__(self, *, ticks: bool = False) -> None:
        self._every_tick = ticks
        self._battery_v: float | None = None
        self._status_t_s = self._position_t_s = float("-inf")

    def tell(self, events: Sequence[RunEvent]) -> list[Line]:
        """Return the lines for what a record tells; most records have none."""
        changed = len(events) > 1 and any(isinstance(event, PhaseChanged | AnomalyBegan) for event in events)
        return [Line(event.elapsed_s, text, tone) for event in events for text, tone in self._told(event, changed)]

    def _told(self, event: RunEvent, changed: bool) -> Told:
        match event:
            case Tick():
                yield from self._tick(event, changed)
            case Board(battery_v=battery_v):
                self._battery_v = battery_v
            case Fix() if event.t_s - self._position_t_s >= STANDING_S:
                self._position_t_s = event.t_s
                yield f"position {place_text(event)}", Tone.QUIET
            case _:
                yield from _happened(event)

    def _tick(self, tick: Tick, changed: bool) -> Told:
        if self._every_tick:
            yield tick_text(tick), Tone.PLAIN
        elif changed:
            yield f"{state_text(tick)}  {reason_text(tick)}".rstrip(), Tone.PHASE
        elif tick.t_s - self._status_t_s >= (STANDING_S if tick.phase == "halt" else STATUS_S):
            yield f"{state_text(tick)}  {aim_text(tick, self._battery_v)}".rstrip(), Tone.QUIET
        else:
            return
        self._status_t_s = tick.t_s


def _happened(event: RunEvent) -> Told:
    """Give what stands in a line whenever it happens."""
    match event:
        case Noted(record=record):
            yield event_text(record), event_tone(record)
        case Gap(missing=missing, announced=False):
            yield str(Damage(missing=missing)), Tone.WARNING
        case BatteryChanged(battery_v=battery_v):
            yield f"battery {battery_v:.1f} V", Tone.QUIET
        case BoardFaults(faults=faults):
            yield f"motor board: {', '.join(faults) or 'well again'}", Tone.FAULT if faults else Tone.PLAIN
        case PowerChanged(bits=""):
            yield "computer: power and heat are well again", Tone.PLAIN
        case PowerChanged(bits=bits):
            yield f"computer: power and heat bits {bits} (see vcgencmd get_throttled)", Tone.WARNING
        case FaultInjected():
            yield fault_text(event), Tone.WARNING
        case RunBegan(header=header):
            yield run_text(header), Tone.PLAIN
            if event.late:
                yield f"the log begins with part {header.part}: what came before is gone", Tone.WARNING
        case Ended():
            yield outcome_text(event), Tone.END
