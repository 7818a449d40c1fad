"""Texts for control ticks, in one line of a terminal. Pure."""

from __future__ import annotations

from wayfarer.fieldlog.typed import Tick
from wayfarer.fieldlog.vocabulary import ANOMALY_TEXTS, CAUSE_TEXTS, PHASE_TEXTS, because, met
from wayfarer.fieldlog.wording import NOTHING, detail_text, sentence, whole_deg


def phase_text(tick: Tick) -> str:
    """Say in a sentence what the rover does from this tick on, and why."""
    doing, reason = PHASE_TEXTS.get(tick.phase or "", tick.phase or "?"), reason_text(tick)
    return _placed(f"{doing}, because {reason}" if reason else doing, tick)


def anomaly_text(tick: Tick) -> str:
    """Say in a sentence what the rover met, where that does not change what it does."""
    return _placed(sentence(met(tick.anomalies, tick.phase)), tick)


def reason_text(tick: Tick) -> str:
    """Return why the rover does something else now, or else what it meets; an anomaly says that by itself."""
    why = why_text(tick)
    reason, unmet = because(why, tick.anomalies), because(why, ())
    met_now = [ANOMALY_TEXTS.get(anomaly, anomaly) for anomaly in tick.anomalies] if reason == unmet else []
    return ", ".join(filter(None, [reason, *met_now]))


def why_text(tick: Tick) -> str:
    """Return the event that began a phase, in the tick in which it began; else nothing."""
    return tick.why if tick.why and tick.why != tick.phase else ""


def state_text(tick: Tick) -> str:
    """Return phase, heading, counter and distance, in columns."""
    counter = "" if tick.counter_deg is None else f"counter {tick.counter_deg:+4.0f}"
    return f"{tick.phase or '?':<9}  {heading_text(tick)}  {counter:<12}  {_travelled(tick):>8}"


def heading_text(tick: Tick) -> str:
    """Return the heading in whole degrees."""
    return "no heading " if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg):>3}"


def aim_text(tick: Tick, battery_v: float | None) -> str:
    """Return the goal heading and the battery, as far as they are known."""
    goal_deg = tick.goal_heading_deg
    told = [] if goal_deg is None else [f"goal {whole_deg(goal_deg)}"]
    return ", ".join(told if battery_v is None else [*told, f"{battery_v:.1f} V"])


def tick_text(tick: Tick) -> str:
    """Say everything about a single tick that fits a line."""
    held = f"{tick.level}: {CAUSE_TEXTS.get(tick.cause, tick.cause)}" if tick.cause else ""
    wanted, applied = _duties(tick.wanted_left, tick.wanted_right), _duties(tick.applied_left, tick.applied_right)
    wheels = f"wanted {wanted}, applied {applied}"
    told = filter(None, [reason_text(tick), held, *further_texts(tick)])
    return ", ".join([f"{tick.phase or '?':<9}  {heading_text(tick)}  {wheels}", *told])


def further_texts(tick: Tick) -> list[str]:
    """Say what else the log has of a tick."""
    return [detail_text(key, value) for key, value in tick.further.items() if value not in NOTHING]


def _placed(told: str, tick: Tick) -> str:
    heading = "" if tick.heading_deg is None else f"heading {whole_deg(tick.heading_deg)}"
    where = ", ".join(filter(None, [heading, _travelled(tick)]))
    return f"{told} ({where})" if where else told


def _travelled(tick: Tick) -> str:
    return "" if tick.travelled_m is None else f"{tick.travelled_m:.1f} m"


def _duties(*duties: float | None) -> str:
    return "/".join("?" if duty is None else f"{duty:+.2f}" for duty in duties)
