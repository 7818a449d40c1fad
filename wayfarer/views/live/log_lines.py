"""The log of a run as the live page tells it: sentences, no names of keys. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from wayfarer.fieldlog.fields import name, names, number, span, table
from wayfarer.fieldlog.log import Record
from wayfarer.views.text.run_narrator import Line, RunNarrator
from wayfarer.views.text.wording import Tone, whole_deg
from wayfarer.views.vocabulary import CAUSES, PHASES, because, level_text, reason_text


class LogLines:
    """Turns the records of a run into lines: what the narrator of the terminal tells, in whole sentences."""

    def __init__(self) -> None:
        self._narrator = RunNarrator()

    def take(self, record: Record) -> list[Line]:
        """Return the lines for a record; how things are now is shown elsewhere on the page."""
        lines = [line for line in self._narrator.take(record) if line.tone is not Tone.QUIET]
        if lines and (sentence := _sentence(record)):
            lines[-1] = lines[-1]._replace(text=sentence)  # before it there may be one that records are missing
        return lines


def page_line(line: Line) -> list[str]:
    """Return a line as the page takes it: when it was, its text, and what its colour follows from."""
    return [span(line.at_s, 1), line.text, line.tone.value]


def _sentence(record: Record) -> str | None:
    """Return what a record says in words; None where the narrator's words are as good."""
    if record["record"] == "tick":
        return _phase_sentence(record)
    if record["record"] == "outcome":
        return f"The run has ended: {name(record, 'text')}"
    say = _EVENTS.get(name(record, "name") or "") if record["record"] == "event" else None
    return None if say is None else say(record)


def _phase_sentence(tick: Record) -> str:
    phase, why = name(tick, "phase") or "", name(tick, "why") or ""
    doing, cause = PHASES.get(phase, phase), because(why, names(tick, "anomalies")) if why != phase else ""
    return f"{doing}, because {cause}" if cause else doing


def _arming(event: Record) -> str:
    delay_s, towards = number(event, "start_delay_s"), _towards(event)
    return f"Arming: in {delay_s:.0f} s it drives {towards}" if delay_s else f"Arming: it drives {towards}"


def _towards(event: Record) -> str:
    goal_deg = number(event, "goal_heading_deg")
    return "straight ahead" if goal_deg is None else f"towards {whole_deg(goal_deg)}°"


def _health(event: Record) -> str:
    cause = name(event, "cause")
    told = level_text(name(event, "level") or "", cause)
    return f"{told}: {CAUSES.get(cause, cause)}" if cause else told


def _counted(event: Record) -> str:
    counts = ", ".join(f"{count} {str(what).replace('_', ' ')}" for what, count in table(event, "counts").items())
    return f"The {name(event, 'part')} carried on after {counts}"


def _said(before: str, key: str, after: str = "") -> Callable[[Record], str]:
    """Return what puts a text of the event into a sentence."""
    return lambda event: f"{before}{name(event, key) or 'not known'}{after}"


_EVENTS: Mapping[str, Callable[[Record], str]] = {
    "opened": lambda event: f"Its parts are open: {', '.join(names(event, 'parts'))}",
    "arming": _arming,
    "arming_refused": lambda event: f"Not armed, because these checks failed: {', '.join(names(event, 'failed'))}",
    "armed": lambda event: f"Armed: drives {_towards(event)}",
    "disarmed": lambda event: f"Disarmed: {reason_text(name(event, 'reason') or 'not known')}",
    "hold": lambda _: "Held by an operator",
    "resume": lambda _: "Resumed by an operator",
    "goal": lambda event: f"A new goal: drives {_towards(event)}",
    "mark": _said("Mark: ", "text"),
    "health": _health,
    "sensor_failed": lambda event: (
        f"The {name(event, 'sensor')} failed: {name(event, 'error')}; it is tried again in"
        f" {number(event, 'retry_in_s') or 0.0:.1f} s"
    ),
    "part_failed": lambda event: f"The {name(event, 'part')} did not open: {name(event, 'error')}",
    "part_troubles": _counted,
    "board_silent": _said("The motor board did not answer: ", "error"),
    "motors_failed": _said("The motors did not answer: ", "error"),
    "light_failed": _said("The status light did not answer: ", "error"),
    "power": _said("The computer's supply: ", "text"),
    "clock_step": lambda event: f"The computer's clock was set by {number(event, 'by_s') or 0.0:+.0f} s",
    "log_gap": lambda event: f"{number(event, 'dropped') or 0:.0f} records could not be written into the log",
    "loop_stalled": lambda event: f"The control loop stood still for {number(event, 'stall_s') or 0.0:.1f} s",
    "stop_not_confirmed": lambda event: f"The {name(event, 'part')} did not confirm the stop: {name(event, 'error')}",
    "close_hangs": _said("The ", "part", " did not close in time"),
    "control_error": _said("An error inside wayfarer, in a command: ", "error"),
    "viewer_failed": _said("An error inside wayfarer, in a viewer: ", "error"),
    "wheels_stopped": lambda _: "The wheels are stopped",
}
