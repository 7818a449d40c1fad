"""Texts for what happened in a run, in one line of a terminal. Pure.

The one place for them: terminal, journal, live page, Foxglove, reports and exports take them from here. The words for
names of phases, anomalies, levels and conditions are in ``vocabulary``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from enum import Enum
from itertools import starmap
from typing import Any

from wayfarer.fieldlog.clock import local_time
from wayfarer.fieldlog.fields import MAX_PLAUSIBLE, escape_control_chars
from wayfarer.fieldlog.run_events import Ended, FaultInjected, Silence, event_name
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Fix, Header
from wayfarer.fieldlog.vocabulary import disarmed_text, ends_text, in_words, level_text


class Tone(Enum):
    """The meaning of a line, from which its colour follows."""

    PLAIN = "plain"
    QUIET = "quiet"  # nothing has changed
    PHASE = "phase"
    PERSON = "person"  # somebody asked for it
    WARNING = "warning"
    FAULT = "fault"
    END = "end"


PERSON = {"arming", "armed", "disarmed", "hold", "resume", "manual", "manual_ended", "goal", "mark"}
WARNINGS = {
    "arming_refused", "sensor_failed", "board_silent", "motors_not_opened", "light_failed", "part_failed", "clock_step",
    "log_gap", "viewer_failed", "close_hangs", "unclean_shutdown", "power", "card", "runs_not_deleted",
    "link_lost",
}  # fmt: skip
FAULTS = {"motors_failed", "loop_stalled", "stop_not_confirmed", "control_error"}
GROUPS = ((PERSON, Tone.PERSON), (WARNINGS, Tone.WARNING), (FAULTS, Tone.FAULT))
LEVEL_TONES = {"degrade": Tone.WARNING, "hold": Tone.WARNING, "fault": Tone.FAULT}

STAMP = {"record", "n", "t_s", "t_wall", "name"}  # what every event has
NOTHING: tuple[object, ...] = (None, "", [], {})
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
    what = event_name(event)
    details = {key: value for key, value in event.items() if key not in STAMP and value not in NOTHING}
    if what == "health":
        details["ends_when"] = ends_text(event.get("level"), event.get("cause"))
    if what in SENTENCES:
        told = [_filled(SENTENCES[what], details), *starmap(detail_text, details.items())]
        return escape_control_chars(", ".join(told))
    told = [detail_text(key.removeprefix(f"{what}_"), value) for key, value in details.items()]
    return f"{what.replace('_', ' ')}{': ' if told else ''}{', '.join(told)}"


def last_mission_text(mission: Mapping[str, Any]) -> str:
    """Say how the last mission ended, given the fields of ``daemon.last_mission.LastMission``."""
    return event_text({"name": "unclean_shutdown" if mission["mission_ended"] is None else "last_mission", **mission})


def event_tone(event: Record) -> Tone:
    """Return how an event is meant."""
    what = event_name(event)
    if what == "health":
        return LEVEL_TONES.get(str(event.get("level")), Tone.PLAIN)
    for group, tone in GROUPS:
        if what in group:
            return tone
    return Tone.PLAIN


def fault_text(fault: FaultInjected) -> str:
    """Say which fault a scenario injects now, or takes away."""
    told = [detail_text(key, value) for key, value in fault.params.items()] if fault.begins else []
    what = " ".join(filter(None, [fault.target, fault.kind])) or "?"
    lasting = "" if fault.for_s is None or not fault.begins else f" for {fault.for_s:g} s"
    return ", ".join([f"a fault {'begins' if fault.begins else 'ends'}: {what}{lasting}", *told])


def silence_text(silence: Silence) -> str:
    """Say for how long the log has no control tick."""
    return f"no ticks for {silence.for_s:.1f} s"


def detail_text(key: str, value: object) -> str:
    """Return a detail as a person says it: ``start_delay_s`` 10 is a start delay of 10 s."""
    stem, _, unit = key.rpartition("_")
    text = _degrees(value) if unit == "deg" else _value(value)
    if stem and unit in UNITS:
        text = f"{stem.replace('_', ' ')} {text} {UNITS[unit]}"
    elif key not in BARE:
        text = f"{key.replace('_', ' ')} {text}"
    return escape_control_chars(text)


def sentence(clause: str) -> str:
    """Return a part of a sentence as the beginning of one."""
    return clause[:1].upper() + clause[1:]


def plural(count: int, noun: str) -> str:
    """Return how many there are: ``1 record``, ``2 records``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def outcome_text(end: Ended) -> str:
    """Say how a run ended."""
    lost = f", {plural(end.dropped, 'record')} could not be written" if end.dropped else ""
    return f"The run has ended: {end.text or end.reason or UNKNOWN}{lost}"


def place_text(fix: Fix) -> str:
    """Return a position as people type it into a map."""
    error = "" if fix.error_m is None else f" (error {fix.error_m:.0f} m)"
    return f"{fix.latitude_deg:.6f}, {fix.longitude_deg:.6f}{error}"


def whole_deg(angle_deg: float) -> str:
    """Return an angle in whole degrees; 359.7 is north, not 360."""
    return f"{float(f'{angle_deg:.0f}') % 360.0:.0f}"


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.0f}" if 1e3 <= abs(value) < MAX_PLAUSIBLE else f"{value:.4g}"
    if isinstance(value, dict) and all(isinstance(count, int) for count in value.values()):
        return ", ".join(f"{count} {what}" for what, count in value.items())
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _degrees(value: object) -> str:
    """Return an angle with a decimal at most: no compass has more."""
    return f"{round(value, 1) + 0.0:g}" if isinstance(value, float) else _value(value)


# -- sentences for events --------------------------------------------------------------------------------------------

# Details of an event are in braces. A piece in brackets is told only if its details are known, and not zero.
_OF_MISSION = "{mission_s:.0f} s][, {mission_m:.0f} m][, anomalies: {mission_anomalies}]"
SENTENCES: Mapping[str, str] = {
    "opened": "The parts are open: {parts}",
    "arming": "Arming:[ in {start_delay_s:.0f} s] it drives {goal_heading_deg}",
    "arming_refused": "Not armed, because these checks failed: {failed}",
    "refused": "Refused: {failed}",
    "armed": "Armed: drives {goal_heading_deg}",
    "disarmed": "Disarmed: {reason}",
    "hold": "Held by an operator",
    "resume": "Resumed by an operator",
    "manual": "A person drives {driver}",
    "manual_ended": "Nobody drives by hand any more, the rover is {mode}: {reason}",
    "goal": "A new goal: drives {goal_heading_deg}",
    "mark": "Mark: {text}",
    "link_lost": "The link is lost: {text}",
    "health": "{level}[: {cause}][. This ends when {ends_when}]",
    "sensor_failed": "The {sensor} failed: {error}[ (tried again in {retry_in_s:.1f} s)]",
    "part_failed": "The {part} did not open: {error}",
    "part_troubles": "The {part} carried on after {counts}",
    "board_silent": "The motor board did not answer: {error}",
    "motors_failed": "The motors did not answer: {error}",
    "motors_opened": "The motor board was opened again: it answers, and its deadman is on",
    "motors_not_opened": "The motor board could not be opened again: {error}[ (tried again in {retry_in_s:.0f} s)]",
    "light_failed": "The status light did not answer: {error}",
    "power": "The computer's supply: {text}",
    "clock_step": "The computer's clock was set[ by {by_s:+.0f} s]",
    "log_gap": "{dropped} could not be written into the log",
    "card": "The card with the logs: {text}",
    "runs_deleted": "Old runs were deleted[, {deleted_mb:.0f} MB][, {left_mb:.0f} MB are left]: {runs}",
    "runs_not_deleted": "Old runs were not deleted: {text}",
    "loop_stalled": "The control loop stood still[ for {stall_s:.1f} s][ in {where}]",
    "stop_not_confirmed": "The {part} did not confirm the stop: {error}",
    "close_hangs": "The {part} did not close in time",
    "control_error": "An error inside wayfarer, in a command: {error}",
    "viewer_failed": "An error inside wayfarer, in a viewer: {error}",
    "unclean_shutdown": "The last mission[{armed_t_wall}] (run {run}) was cut off: killed, or without power",
    "last_mission": "The last mission[{armed_t_wall}] (run {run}) is over[ after "
    + _OF_MISSION
    + "[: {mission_ended}]",
    "mission_ended": f"The mission is over[ after {_OF_MISSION}[: {{mission_ended}}]",
    "wheels_stopped": "The wheels are stopped[: {reason}]",
}
DETAIL = re.compile(r"{(\w+)")
OPTIONAL = re.compile(r"\[(.*?)\]")
MISSING = {"goal_heading_deg": "straight ahead", "dropped": "Some records"}  # else ``UNKNOWN``
WORDS: Mapping[str, Callable[[Any], str]] = {
    "goal_heading_deg": lambda angle_deg: f"towards {whole_deg(angle_deg)} degrees",
    **dict.fromkeys(("part", "sensor", "cause"), in_words),
    **dict.fromkeys(("reason", "mission_ended"), lambda reason: disarmed_text(reason).replace("_", " ")),
    "driver": lambda driver: "on the live page" if driver == "page" else f"with {_value(driver)}",
    "counts": lambda counts: _value(counts).replace("_", " "),
    "dropped": lambda count: plural(count, "record"),
    "armed_t_wall": lambda wall_s: local_time(wall_s, " of %Y-%m-%d %H:%M"),
}


def _filled(template: str, details: dict[str, Any]) -> str:
    """Return a sentence with its details, and take them from the others."""
    words = {key: _word(key, details) for key in DETAIL.findall(template)}
    text = OPTIONAL.sub(lambda piece: piece[1] if all(map(details.get, DETAIL.findall(piece[1]))) else "", template)
    for key in words:
        details.pop(key, None)
    return text.format_map(words)


def _word(key: str, details: Mapping[str, Any]) -> Any:
    """Return a detail as a sentence has it; a number as it is, because the sentence says how many digits."""
    if key not in details:
        return MISSING.get(key, UNKNOWN)
    value = details[key]
    if key == "level":
        return level_text(value, details.get("cause"))
    if key in WORDS:
        return WORDS[key](value)
    return value if isinstance(value, int | float) else _value(value)
