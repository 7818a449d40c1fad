"""Texts for records, in one line of a terminal. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any

from wayfarer.fieldlog.fields import ABSURD, name
from wayfarer.fieldlog.header import Header
from wayfarer.fieldlog.last_run import unclean_text
from wayfarer.fieldlog.printable import clean
from wayfarer.fieldlog.run_events import Ended, FaultInjected
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Fix, Tick


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
UNITS = {"deg": "degrees", "s": "s"}


def run_text(header: Header) -> str:
    """Say what ran."""
    about = [header.rover, header.algorithm, *marks(header.record), f"wayfarer {header.version}"]
    return f"run of {', '.join(text for text in about if text)}"


def marks(header: Mapping[str, Any]) -> list[str]:
    """Say in what a run is not one of a rover with its wheels on the ground."""
    known = (("simulated", "simulated"), ("dry_run", "dry run"))
    return [text for key, text in known if header.get(key) is True]


def event_text(event: Record) -> str:
    """Say what happened, with its details."""
    what = event_name(event)
    if what == "unclean_shutdown":
        return unclean_text(event)
    details = {key.removeprefix(f"{what}_"): value for key, value in event.items() if key not in STAMP}
    told = [_detail(key, value) for key, value in details.items() if value not in (None, [])]
    return f"{what.replace('_', ' ')}{': ' if told else ''}{', '.join(told)}"


def event_name(event: Record) -> str:
    """Return the name of an event, whatever has become of it."""
    return name(event, "name") or "event"


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


def outcome_text(end: Ended) -> str:
    """Say how a run ended."""
    lost = f"; {end.dropped} records could not be written" if end.dropped else ""
    return f"ended: {end.reason}: {end.text}{lost}"


def place_text(fix: Fix) -> str:
    """Return a position as people type it into a map."""
    error = "" if fix.error_m is None else f" (error {fix.error_m:.0f} m)"
    return f"{fix.latitude_deg:.6f}, {fix.longitude_deg:.6f}{error}"


def why_text(tick: Tick) -> str:
    """Return the event that began a phase, in the tick in which it began; else nothing."""
    return tick.why if tick.why and tick.why != tick.phase else ""


def reason_text(tick: Tick) -> str:
    """Return why the rover does something else now; an anomaly says that by itself."""
    why = why_text(tick)
    told = [] if tick.anomalies and why.endswith(".anomaly") else [why]
    return ", ".join(filter(None, [*told, *tick.anomalies]))


def state_text(tick: Tick) -> str:
    """Return phase, heading, counter and distance, in columns."""
    counter = "" if tick.counter_deg is None else f"counter {tick.counter_deg:+4.0f}"
    travelled = "" if tick.travelled_m is None else f"{tick.travelled_m:.1f} m"
    return f"{tick.phase or '?':<9}  {heading_text(tick)}  {counter:<12}  {travelled:>8}"


def heading_text(tick: Tick) -> str:
    """Return the heading in whole degrees."""
    return "no heading " if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg):>3}"


def aim_text(tick: Tick, battery_v: float | None) -> str:
    """Return the goal heading and the battery, as far as they are known."""
    goal_deg = tick.goal_heading_deg
    told = [] if goal_deg is None else [f"goal {whole_deg(goal_deg)}"]
    return ", ".join(told if battery_v is None else [*told, f"{battery_v:.1f} V"])


def whole_deg(angle_deg: float) -> str:
    """Return an angle in whole degrees; 359.7 is north, not 360."""
    return f"{float(f'{angle_deg:.0f}') % 360.0:.0f}"


def tick_text(tick: Tick) -> str:
    """Say everything about a single tick that fits a line."""
    told = [why_text(tick), *tick.anomalies, f"{tick.level} {tick.cause}" if tick.cause else ""]
    wanted, applied = _duties(tick.wanted_left, tick.wanted_right), _duties(tick.applied_left, tick.applied_right)
    wheels = f"wanted {wanted}, applied {applied}"
    return ", ".join([f"{tick.phase or '?':<9}  {heading_text(tick)}  {wheels}", *filter(None, told)])


def _duties(*duties: float | None) -> str:
    return "/".join("?" if duty is None else f"{duty:+.2f}" for duty in duties)


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
