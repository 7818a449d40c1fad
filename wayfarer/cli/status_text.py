"""The text of ``wayfarer status``: a few lines, the most important first. Only that command pays for its imports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.wording import marks, plural
from wayfarer.logview.terminal import painted
from wayfarer.vocabulary import disarmed_text, in_words, level_text, whole_deg

WELL = level_text("well", None)
NO_DEADMAN = "none: nothing stops these wheels if the computer fails"


def status_text(status: Mapping[str, Any]) -> str:
    """Return what ``status`` answered, as lines."""
    return "\n".join(f"{name:<9} {text}" for name, text in _lines(status) if text)


def _lines(status: Mapping[str, Any]) -> list[tuple[str, str]]:
    heading = status.get("heading_deg")
    return [
        (status["rover"], f"{_mode(status)}{_marks(status)}"),
        ("health", _health(status)),
        ("so it", status.get("does", "")),
        ("until", status.get("ends_when", "")),
        ("doing", _doing(status)),
        ("heading", "" if heading is None else _heading(status, heading)),
        ("mission", _mission(status)),
        ("before", _last_mission(status)),
        ("deadman", painted(NO_DEADMAN, "warning") if status.get("board_deadman_s", 0) is None else ""),
        ("battery", _battery(status)),
        ("log", _log(status)),
        ("card", _storage(status)),
        ("live page", status.get("live_page", "")),
        ("MAVLink", status.get("mavlink", "")),
    ]


def _mode(status: Mapping[str, Any]) -> str:
    why = status.get("why_disarmed")
    if status["being_checked"]:
        return "being checked before its wheels may turn"
    if status["mode"] == "manual":
        return f"driven by hand, by {status['driver']}"
    return f"disarmed: {disarmed_text(why)}" if why else "held" if status["held"] else str(status["mode"])


def _marks(status: Mapping[str, Any]) -> str:
    words = ", ".join(marks(status.get("simulated"), status.get("dry_run")))
    return f" ({words})" if words else ""


def _health(status: Mapping[str, Any]) -> str:
    """Return what is wrong, and since when."""
    wrong = _wrong(status)
    since = f" (for {duration_text(status['cause_for_s'])})" if "cause_for_s" in status else ""
    return painted(f"{wrong}{since}", "warning") if wrong else painted(WELL, "good")


def _battery(status: Mapping[str, Any]) -> str:
    """Return the battery's voltage, empty if it is not known."""
    return "" if status.get("battery_v") is None else f"{status['battery_v']:.1f} V"


def _wrong(status: Mapping[str, Any]) -> str:
    return ", ".join([*map(in_words, status["conditions"]), *status["motor_faults"]])


def _doing(status: Mapping[str, Any]) -> str:
    if status["mode"] != "armed":
        return ""
    seen = [in_words(anomaly) for anomaly in status.get("anomalies") or ()]
    counter = f"counter {status.get('counter_deg', 0):.0f}"
    return ", ".join([f"{_phase(status)} ({status['algorithm']})", counter, *seen])


def _phase(status: Mapping[str, Any]) -> str:
    return in_words(status["phase"]) if status["mode"] == "armed" else ""


def _heading(status: Mapping[str, Any], heading_deg: float) -> str:
    goal = f", goal {whole_deg(status['goal_heading_deg'])}" if "goal_heading_deg" in status else ""
    return f"{whole_deg(heading_deg)}{goal}, pitch {status['pitch_deg']:+.0f}, roll {status['roll_deg']:+.0f}"


def _log(status: Mapping[str, Any]) -> str:
    lost = f", {plural(status['log_dropped'], 'record')} lost" if status.get("log_dropped") else ""
    deleted = f", {plural(status['runs_deleted'], 'old run')} deleted" if status.get("runs_deleted") else ""
    return f"{status['log']}{lost}{deleted}"


def _storage(status: Mapping[str, Any]) -> str:
    trouble = str(status.get("log_trouble") or "").removeprefix(f"{status['log']}: ")
    warnings = "; ".join(filter(None, [trouble, *status.get("storage_warnings", ())]))
    return painted(warnings, "warning") if warnings else ""


def _last_mission(status: Mapping[str, Any]) -> str:
    """Return how the last mission before this run ended: until the rover is armed, it stands as that one left it."""
    last_mission = status.get("last_mission")
    if not last_mission or status["mode"] != "disarmed" or "mission_s" in status:
        return ""
    return str(last_mission["text"])


def _mission(status: Mapping[str, Any]) -> str:
    if "mission_s" not in status:
        return ""
    return f"{status['mission_s']:.0f} s, {status['travelled_m']:.1f} m commanded"
