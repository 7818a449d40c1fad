"""Texts for what happened in a run, in one line of a terminal. Pure.

The one place for them: terminal, journal, live page, Foxglove, reports and exports take them from here. Those for
control ticks are in ``tick_wording``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, TypeVar

from wayfarer.fieldlog.fields import ABSURD, local_time, name, names, number, table
from wayfarer.fieldlog.header import Header
from wayfarer.fieldlog.printable import clean
from wayfarer.fieldlog.run_events import Ended, FaultInjected, event_name
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Fix
from wayfarer.fieldlog.vocabulary import CAUSES, PARTS, disarmed_text, level_text

T = TypeVar("T")


class Tone(Enum):
    """The meaning of a line, from which its colour follows."""

    PLAIN = "plain"
    QUIET = "quiet"  # nothing has changed
    PHASE = "phase"
    PERSON = "person"  # somebody asked for it
    WARNING = "warning"
    FAULT = "fault"
    END = "end"


PERSON = {"arming", "armed", "disarmed", "hold", "resume", "goal", "mark"}
WARNINGS = {
    "arming_refused", "sensor_failed", "board_silent", "light_failed", "part_failed", "clock_step", "log_gap",
    "viewer_failed", "close_hangs", "unclean_shutdown", "power",
}  # fmt: skip
FAULTS = {"motors_failed", "loop_stalled", "stop_not_confirmed", "control_error"}
LEVEL_TONES = {"degrade": Tone.WARNING, "hold": Tone.WARNING, "fault": Tone.FAULT}

STAMP = {"record", "n", "t_s", "t_wall", "name"}  # what every event has
BARE = {"text", "reason", "error", "level", "cause"}  # details that say what they are by themselves
UNKNOWN = "not known"
UNITS = {"deg": "degrees", "s": "s"}


def run_text(header: Header) -> str:
    """Say what ran."""
    version = f"wayfarer {header.version}" if header.version else None
    about = [header.rover or "unknown rover", header.algorithm, *marks(header.record), version]
    return f"run of {', '.join(text for text in about if text)}"


def marks(header: Mapping[str, Any]) -> list[str]:
    """Say in what a run is not one of a rover with its wheels on the ground."""
    known = (("simulated", "simulated"), ("dry_run", "dry run"))
    return [text for key, text in known if header.get(key) is True]


def event_text(event: Record) -> str:
    """Say what happened: in a sentence, and after it each detail that the sentence does not use.

    So a detail that is new in the log is told without a change here, and so is an event that is not known.
    """
    what, details = event_name(event), Details(event)
    say = SENTENCES.get(what)
    if say is not None:
        return ", ".join([say(details), *details.told()])
    told = details.told(drop_prefix=f"{what}_")
    return f"{what.replace('_', ' ')}{': ' if told else ''}{', '.join(told)}"


def event_tone(event: Record) -> Tone:
    """Return how an event is meant."""
    what = event_name(event)
    if what == "health":
        return LEVEL_TONES.get(str(event.get("level")), Tone.PLAIN)
    for group, tone in ((PERSON, Tone.PERSON), (WARNINGS, Tone.WARNING), (FAULTS, Tone.FAULT)):
        if what in group:
            return tone
    return Tone.PLAIN


def fault_text(fault: FaultInjected) -> str:
    """Say which fault a scenario injects now, or takes away."""
    told = [_detail(key, value) for key, value in fault.params.items()] if fault.begins else []
    what = " ".join(filter(None, [fault.target, fault.kind])) or "?"
    lasting = "" if fault.for_s is None or not fault.begins else f" for {fault.for_s:g} s"
    return ", ".join([f"a fault {'begins' if fault.begins else 'ends'}: {what}{lasting}", *told])


def sentence(clause: str) -> str:
    """Return a part of a sentence as the beginning of one."""
    return clause[:1].upper() + clause[1:]


def records_text(count: int) -> str:
    """Return how many records: ``1 record``, ``2 records``."""
    return f"{count} record{'' if count == 1 else 's'}"


def outcome_text(end: Ended) -> str:
    """Say how a run ended."""
    lost = f", {records_text(end.dropped)} could not be written" if end.dropped else ""
    return f"The run has ended: {end.text or end.reason or UNKNOWN}{lost}"


def place_text(fix: Fix) -> str:
    """Return a position as people type it into a map."""
    error = "" if fix.error_m is None else f" (error {fix.error_m:.0f} m)"
    return f"{fix.latitude_deg:.6f}, {fix.longitude_deg:.6f}{error}"


def whole_deg(angle_deg: float) -> str:
    """Return an angle in whole degrees; 359.7 is north, not 360."""
    return f"{float(f'{angle_deg:.0f}') % 360.0:.0f}"


def _detail(key: str, value: object) -> str:
    """Return a detail as a person says it: ``start_delay_s`` 10 is a start delay of 10 s."""
    stem, _, unit = key.rpartition("_")
    text = _degrees(value) if unit == "deg" else _value(value)
    if key in BARE:
        return text
    if stem and unit in UNITS:
        return f"{clean(stem).replace('_', ' ')} {text} {UNITS[unit]}"
    return f"{clean(key).replace('_', ' ')} {text}"


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.0f}" if 1e3 <= abs(value) < ABSURD else f"{value:.4g}"
    if isinstance(value, dict) and all(isinstance(count, int) for count in value.values()):
        return clean(", ".join(f"{count} {what}" for what, count in value.items()))
    return clean(", ".join(map(str, value)) if isinstance(value, list) else str(value))


def _degrees(value: object) -> str:
    """Return an angle with a decimal at most: no compass has more."""
    return f"{round(value, 1) + 0.0:g}" if isinstance(value, float) else _value(value)


# -- sentences for events --------------------------------------------------------------------------------------------


class Details:
    """The details of an event: a sentence takes those that it uses, ``told`` returns the others.

    A value of another type than is asked for is not taken.
    """

    def __init__(self, event: Record) -> None:
        self._left = {key: value for key, value in event.items() if key not in STAMP}

    def text(self, key: str) -> str:
        """Take a text."""
        return self._take(name, key) or UNKNOWN

    def part(self, key: str = "part") -> str:
        """Take the name of a part of the rover."""
        part = self.text(key)
        return PARTS.get(part, part)

    def number(self, key: str) -> float | None:
        """Take a number."""
        return self._take(number, key)

    def texts(self, key: str) -> str:
        """Take a list of texts."""
        return ", ".join(self._take(names, key)) or UNKNOWN

    def counts(self, key: str) -> str:
        """Take numbers by name."""
        return _value(self._take(table, key)).replace("_", " ") or UNKNOWN

    def told(self, drop_prefix: str = "") -> list[str]:
        """Return what nobody has taken, as key and value; nothing for what is empty."""
        left = self._left.items()
        return [_detail(key.removeprefix(drop_prefix), value) for key, value in left if value not in (None, [])]

    def _take(self, read: Callable[[Mapping[str, Any], str], T], key: str) -> T:
        value = read(self._left, key)
        if value not in (None, (), {}):
            del self._left[key]
        return value


def _arming(details: Details) -> str:
    delay_s, towards = details.number("start_delay_s"), _towards(details)
    return f"Arming: in {delay_s:.0f} s it drives {towards}" if delay_s else f"Arming: it drives {towards}"


def _towards(details: Details) -> str:
    goal_deg = details.number("goal_heading_deg")
    return "straight ahead" if goal_deg is None else f"towards {whole_deg(goal_deg)} degrees"


def _health(details: Details) -> str:
    level, cause = details.text("level"), details.text("cause")
    told = level_text(level, cause)
    return told if cause == UNKNOWN else f"{told}: {CAUSES.get(cause, cause)}"


def _disarmed(details: Details) -> str:
    return f"Disarmed: {disarmed_text(details.text('reason'))}"


def _sensor_failed(details: Details) -> str:
    sensor, error, retry_s = details.part("sensor"), details.text("error"), details.number("retry_in_s")
    return f"The {sensor} failed: {error}" + ("" if retry_s is None else f" (tried again in {retry_s:.1f} s)")


def _clock_step(details: Details) -> str:
    by_s = details.number("by_s")
    return "The computer's clock was set" + ("" if by_s is None else f" by {by_s:+.0f} s")


def _log_gap(details: Details) -> str:
    dropped = details.number("dropped")
    return f"{'Some records' if dropped is None else records_text(int(dropped))} could not be written into the log"


def _loop_stalled(details: Details) -> str:
    stall_s, where = details.number("stall_s"), details.text("where")
    lasted = "" if stall_s is None else f" for {stall_s:.1f} s"
    return f"The control loop stood still{lasted}" + ("" if where == UNKNOWN else f" in {where}")


def _unclean_shutdown(details: Details) -> str:
    run, error, mode, wall_s = (
        details.text("run"), details.text("error"), details.text("mode"), details.number("last_t_wall")
    )  # fmt: skip
    details.number("last_t_s")  # of a clock that says nothing to a person
    if error != UNKNOWN:
        return f"The run before ({run}) cannot be read: {error}"
    doing = "" if mode == UNKNOWN else f" while {mode}"
    at = local_time(wall_s, " at %Y-%m-%d %H:%M:%S") if wall_s else ""
    return f"The run before ({run}) was cut off{doing}{at}: killed, or without power"


def _wheels_stopped(details: Details) -> str:
    reason = details.text("reason")
    return "The wheels are stopped" + ("" if reason == UNKNOWN else f": {reason.replace('_', ' ')}")


SENTENCES: Mapping[str, Callable[[Details], str]] = {
    "opened": lambda details: f"The parts are open: {details.texts('parts')}",
    "arming": _arming,
    "arming_refused": lambda details: f"Not armed, because these checks failed: {details.texts('failed')}",
    "refused": lambda details: f"Refused: {details.texts('failed')}",
    "armed": lambda details: f"Armed: drives {_towards(details)}",
    "disarmed": _disarmed,
    "hold": lambda _: "Held by an operator",
    "resume": lambda _: "Resumed by an operator",
    "goal": lambda details: f"A new goal: drives {_towards(details)}",
    "mark": lambda details: f"Mark: {details.text('text')}",
    "health": _health,
    "sensor_failed": _sensor_failed,
    "part_failed": lambda details: f"The {details.part()} did not open: {details.text('error')}",
    "part_troubles": lambda details: f"The {details.part()} carried on after {details.counts('counts')}",
    "board_silent": lambda details: f"The motor board did not answer: {details.text('error')}",
    "motors_failed": lambda details: f"The motors did not answer: {details.text('error')}",
    "light_failed": lambda details: f"The status light did not answer: {details.text('error')}",
    "power": lambda details: f"The computer's supply: {details.text('text')}",
    "clock_step": _clock_step,
    "log_gap": _log_gap,
    "loop_stalled": _loop_stalled,
    "stop_not_confirmed": lambda details: f"The {details.part()} did not confirm the stop: {details.text('error')}",
    "close_hangs": lambda details: f"The {details.part()} did not close in time",
    "control_error": lambda details: f"An error inside wayfarer, in a command: {details.text('error')}",
    "viewer_failed": lambda details: f"An error inside wayfarer, in a viewer: {details.text('error')}",
    "unclean_shutdown": _unclean_shutdown,
    "wheels_stopped": _wheels_stopped,
}
