"""What happens in a run, as lines of text: for ``wayfarer logs``, the daemon's terminal or journal, and log panels."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from shlex import quote
from typing import Any, NamedTuple

from wayfarer.fieldlog.clock import duration_text, local_time
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.record import AnyRecord, Board, Event, FaultInjected, Fix, Header, Outcome, Tick, Truth
from wayfarer.fieldlog.run_fold import (
    AnomalyBegan,
    BatteryChanged,
    BoardFaults,
    Gap,
    PhaseChanged,
    PowerChanged,
    RunBegan,
    RunFold,
    Silence,
    Told,
)
from wayfarer.fieldlog.wording import (
    Tone,
    event_tone,
    fault_text,
    memory_text,
    outcome_text,
    place_text,
    run_text,
    sentence,
)
from wayfarer.logview.terminal import painted
from wayfarer.vocabulary import PHASE_TEXTS, because, in_words, met, whole_deg

STATUS_S = 5.0  # a line at least so often while the rover drives
STANDING_S = 60.0  # and while it stands: enough to see that it lives
WIDEST = max(map(len, PHASE_TEXTS.values()))  # characters

TextAndTone = tuple[str, Tone]
Change = PhaseChanged | AnomalyBegan
# What algorithms of the catalogue remember; all viewers have separate names for it.
NAMED = {"counter_deg", "side", "turn_deg", "episodes", "blocked_turns", "turn_from_duty"}


class Verbosity(Enum):
    """What is printed of the control ticks: changes, changes and a status now and then, or every tick."""

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
        verbosity: what is printed of the control ticks. With ``CHANGES`` a line is printed only if something has
        changed.
    """

    def __init__(self, verbosity: Verbosity) -> None:
        self._verbosity = verbosity
        self._battery_v: float | None = None
        self._driven_m: float | None = None
        self._status_t_s = self._position_t_s = float("-inf")

    def tell(self, events: Sequence[Told]) -> list[Line]:
        """Return the lines for a record; most records have none."""
        change = next((event for event in events if isinstance(event, Change)), None) if len(events) > 1 else None
        lines = [Line(event.elapsed_s, *text) for event in events for text in self._texts(event, change)]
        return [line for line in lines if line.tone is not Tone.QUIET or self._verbosity is not Verbosity.CHANGES]

    def _texts(self, event: Told, change: Change | None) -> Iterable[TextAndTone]:
        match event:
            case Tick():
                return self._tick(event, change)
            case Board(battery_v=battery_v):
                self._battery_v = battery_v
            case Truth(driven_m=driven_m):
                self._driven_m = driven_m
            case Fix(t_s=t_s) if t_s - self._position_t_s >= STANDING_S:
                self._position_t_s = t_s
                return [(f"position {place_text(event)}", Tone.QUIET)]
            case _:
                return happened(event)
        return ()

    def _tick(self, tick: Tick, change: Change | None) -> Iterable[TextAndTone]:
        if self._verbosity is Verbosity.TICKS:
            return [(_tick_text(tick), Tone.PLAIN)]
        due_s = STANDING_S if tick.phase == "halt" else STATUS_S
        if change is None and tick.t_s - self._status_t_s < due_s:
            return []
        self._status_t_s = tick.t_s
        if change is None:  # how the rover is doing
            goal = "" if tick.goal_heading_deg is None else f"goal {whole_deg(tick.goal_heading_deg)}"
            battery = "" if self._battery_v is None else f"{self._battery_v:.1f} V"
            status = ", ".join(filter(None, [self._placed(in_words(tick.phase), tick), goal, battery]))
            return [(status, Tone.QUIET)]
        text = sentence(met(tick.anomalies, tick.phase))  # what it meets, if that changes nothing
        if isinstance(change, PhaseChanged):  # what it does from this tick on, and why
            text = ": ".join(filter(None, [in_words(tick.phase), reason_text(tick)]))
        return [(self._placed(text, tick), Tone.PHASE)]

    def _placed(self, text: str, tick: Tick) -> str:
        """Add the heading, the counter C and the way, as far as they are known: the true or else the commanded one."""
        counter_deg = tick.remembered("counter_deg")
        heading = "" if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg)}"
        counter = "" if counter_deg is None else f"C {round(counter_deg):+}"
        way_m = tick.travelled_m if self._driven_m is None else self._driven_m
        way = "" if way_m is None else f"{way_m:.1f} m"
        known = ", ".join(filter(None, [heading, counter, way]))
        return f"{text} ({known})" if known else text


def happened(event: Told) -> Iterator[TextAndTone]:
    """Give the text and the tone of what stands in a line whenever it happens."""
    match event:
        case Event(text=text):
            yield text, event_tone(event)
        case Gap(missing=missing):
            yield str(Damage(missing=missing)), Tone.WARNING
        case Silence():
            yield event.text, Tone.WARNING
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
        case Outcome():
            yield outcome_text(event), Tone.END


def reason_text(tick: Tick) -> str:
    """Return why the rover does something else from this tick on, and the anomalies that it meets."""
    why = tick.why if tick.why != tick.phase else ""  # in later ticks of a phase it is the phase's name
    return because(why, tick.anomalies)


def further_texts(tick: Tick) -> list[str]:
    """Return what an algorithm remembers under other keys than ``NAMED``, as text."""
    return [memory_text(key, value) for key, value in further(tick).items()]


def further(tick: Tick) -> dict[str, Any]:
    """Return what else an algorithm remembers, as far as it is anything."""
    named = {key for key in NAMED if tick.remembered(key) is not None}
    return {key: value for key, value in tick.memory.items() if key not in named and value not in (None, "", [], {})}


def _tick_text(tick: Tick) -> str:
    """Say everything about a single tick that fits a line; phase and heading have columns."""
    heading = "no heading" if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg):>3}"
    wanted, applied = _duties(tick.wanted_left, tick.wanted_right), _duties(tick.applied_left, tick.applied_right)
    wheels = f"wanted {wanted}, applied {applied}"
    held = f"{tick.level}: {in_words(tick.cause)}" if tick.cause else ""
    more = filter(None, [reason_text(tick), held, *further_texts(tick)])
    return ", ".join([f"{in_words(tick.phase):<{WIDEST}}  {heading:<11}  {wheels}", *more])


def _duties(*duties: float | None) -> str:
    return "/".join("?" if duty is None else f"{duty:+.2f}" for duty in duties)


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
    if isinstance(event, AnomalyBegan):  # a terminal prints it with its tick
        yield LogLine(name, sentence(met([event.kind], event.phase)), Tone.WARNING)
    for text, tone in happened(event):
        yield LogLine(name, text, tone)


class Console:
    """Takes the records of a run and writes a line with the wall time for each thing that happens.

    A trial has virtual time: its lines have the time since it began, as everywhere else.

    Args:
        hint: what to do with a rover that is ready; printed when it is. Empty for none.
        write: takes a line for stderr, and must not wait.
        then: the command that comes next, printed with the run's folder at its end; empty for none.
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
            return  # the command itself prints its error
        lines = self._narrator.tell(self._fold.add(record))
        in_trial = self._fold.state.header.trial is not None
        at = duration_text(record.elapsed_s, 1) if in_trial else local_time(record.t_wall, "%H:%M:%S")
        for line in lines:
            self._write(f"{at}  {painted(line.text, line.tone.value, sys.stderr)}")
        match record:
            case Header(log=str(log)):
                self._log = log
            case Event(name="opened") if self._hint:
                self._write(f"{at}  disarmed. {self._hint}")
            case Outcome() if self._then:
                self._write(f"Next: {self._then} {quote(self._log)}")
