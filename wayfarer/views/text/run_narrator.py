"""The events of a run as lines of text, with its state now and then. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from wayfarer.fieldlog.clock import duration_text
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
from wayfarer.fieldlog.typed import Board, Fix, RunEvent, Tick
from wayfarer.fieldlog.vocabulary import PHASE_TEXTS, because, in_words, met
from wayfarer.fieldlog.wording import (
    NOTHING,
    Tone,
    detail_text,
    event_text,
    event_tone,
    fault_text,
    outcome_text,
    place_text,
    run_text,
    sentence,
    silence_text,
    whole_deg,
)

STATUS_S = 5.0  # a line at least so often while the rover drives
STANDING_S = 60.0  # and while it stands: enough to see that it lives
WIDEST = max(map(len, PHASE_TEXTS.values()))  # characters

Told = tuple[str, Tone]
Change = PhaseChanged | AnomalyBegan


class Verbosity(Enum):
    """What is told of the control ticks: changes, changes and a status now and then, or every tick."""

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
            return [(_tick_text(tick), Tone.PLAIN)]
        due_s = STANDING_S if tick.phase == "halt" else STATUS_S
        if change is None and tick.t_s - self._status_t_s < due_s:
            return []
        self._status_t_s = tick.t_s
        return [(self._status(tick), Tone.QUIET)] if change is None else [(_change_text(change, tick), Tone.PHASE)]

    def _status(self, tick: Tick) -> str:
        """Say how the rover is doing, with the goal heading and the battery as far as they are known."""
        goal = "" if tick.goal_heading_deg is None else f"goal {whole_deg(tick.goal_heading_deg)}"
        battery = "" if self._battery_v is None else f"{self._battery_v:.1f} V"
        return ", ".join(filter(None, [_placed(_doing(tick), tick), goal, battery]))

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


# -- control ticks ---------------------------------------------------------------------------------------------------


def reason_text(tick: Tick) -> str:
    """Return why the rover does something else from this tick on, and the anomalies that it meets."""
    why = tick.why if tick.why and tick.why != tick.phase else ""  # in later ticks of a phase it is the phase's name
    return because(why, tick.anomalies)


def further_texts(tick: Tick) -> list[str]:
    """Return what the log has of a tick under keys that no view names."""
    return [detail_text(key, value) for key, value in tick.further.items() if value not in NOTHING]


def _change_text(change: Change, tick: Tick) -> str:
    """Say what the rover does from this tick on, and why; or what it meets, where that changes nothing."""
    if isinstance(change, PhaseChanged):
        return _placed(": ".join(filter(None, [_doing(tick), reason_text(tick)])), tick)
    return _placed(sentence(met(tick.anomalies, tick.phase)), tick)


def _doing(tick: Tick) -> str:
    return in_words(tick.phase or "?")


def _placed(told: str, tick: Tick) -> str:
    """Add the heading, the counter C and the way, as far as they are known: the true one or else the commanded one."""
    heading = "" if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg)}"
    counter = "" if tick.counter_deg is None else f"C {round(tick.counter_deg):+}"
    way_m = tick.travelled_m if tick.driven_m is None else tick.driven_m
    way = "" if way_m is None else f"{way_m:.1f} m"
    known = ", ".join(filter(None, [heading, counter, way]))
    return f"{told} ({known})" if known else told


def _tick_text(tick: Tick) -> str:
    """Say everything about a single tick that fits a line; phase and heading stand in columns."""
    heading = "no heading" if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg):>3}"
    wanted, applied = _duties(tick.wanted_left, tick.wanted_right), _duties(tick.applied_left, tick.applied_right)
    wheels = f"wanted {wanted}, applied {applied}"
    held = f"{tick.level}: {in_words(tick.cause)}" if tick.cause else ""
    told = filter(None, [reason_text(tick), held, *further_texts(tick)])
    return ", ".join([f"{_doing(tick):<{WIDEST}}  {heading:<11}  {wheels}", *told])


def _duties(*duties: float | None) -> str:
    return "/".join("?" if duty is None else f"{duty:+.2f}" for duty in duties)
