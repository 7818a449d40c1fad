"""Texts for the records of a log that are not events (an event has its own text), one terminal line each. Pure.

The one place for them: terminal, journal, live page, Foxglove, reports and exports take them from here. The words for
names of phases, anomalies, levels and conditions are in ``wayfarer.vocabulary``.
"""

from __future__ import annotations

from enum import Enum

from wayfarer.fieldlog.record import Event, FaultInjected, Fix, Header, Outcome


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
TONES = {"warning": Tone.WARNING, "error": Tone.FAULT}


def event_tone(event: Event) -> Tone:
    """Return how an event is meant."""
    return Tone.PERSON if event.name in PERSON else TONES.get(event.severity, Tone.PLAIN)


def run_text(header: Header) -> str:
    """Say what ran."""
    version = f"wayfarer {header.version}" if header.version else None
    about = [header.rover or "unknown rover", header.algorithm, *marks(header.simulated, header.dry_run), version]
    return f"run of {', '.join(text for text in about if text)}"


def marks(simulated: object, dry_run: object) -> list[str]:
    """Say in what a run is not one of a rover with its wheels on the ground."""
    return [text for known, text in ((simulated, "simulated"), (dry_run, "dry run")) if known is True]


def fault_text(fault: FaultInjected) -> str:
    """Say which fault a scenario injects now, or takes away."""
    told = [memory_text(key, value) for key, value in fault.params.items()] if fault.begins else []
    lasting = "" if fault.for_s is None or not fault.begins else f" for {fault.for_s:g} s"
    what = f"a fault {'begins' if fault.begins else 'ends'}: {fault.target} {fault.kind}{lasting}"
    return ", ".join([what, *told])


def memory_text(key: str, value: object) -> str:
    """Return what an algorithm remembers, or a parameter of a fault: its name and its value."""
    return f"{key.replace('_', ' ')} {value:.4g}" if isinstance(value, float) else f"{key.replace('_', ' ')} {value}"


def sentence(clause: str) -> str:
    """Return a part of a sentence as the beginning of one."""
    return clause[:1].upper() + clause[1:]


def plural(count: int, noun: str) -> str:
    """Return how many there are: ``1 record``, ``2 records``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def outcome_text(end: Outcome) -> str:
    """Say how a run ended."""
    lost = f", {plural(end.dropped, 'record')} could not be written" if end.dropped else ""
    return f"The run has ended: {end.text or end.reason}{lost}"


def place_text(fix: Fix) -> str:
    """Return a position as people type it into a map."""
    error = "" if fix.error_m is None else f" (error {fix.error_m:.0f} m)"
    return f"{fix.latitude_deg:.6f}, {fix.longitude_deg:.6f}{error}"
