"""What ``status`` says of a rover: its mode, what is wrong and what it does about that, its mission. Pure."""

from __future__ import annotations

from typing import Any

from wayfarer.control.controller import Controller, Mode
from wayfarer.control.tick_record import TickRecord
from wayfarer.safety.responses import said_of


def rover_status(controller: Controller, now_s: float, *, being_checked: bool) -> dict[str, Any]:
    """Return the state of the rover at ``now_s``, on the loop's clock; for ``being_checked`` see ``Supervisor``."""
    health, last = controller.board.health, controller.last
    return {
        "mode": controller.mode.value,
        "why_disarmed": controller.why_disarmed if controller.mode is Mode.DISARMED else None,
        "being_checked": being_checked,
        "held": controller.held,
        "driver": controller.manual.driver if controller.mode is Mode.MANUAL else None,
        "conditions": [condition.value for condition in controller.conditions],
        "battery_v": health and health.battery_v,
        "motor_faults": list(health.faults) if health else [],
        **({} if last is None else _seen(last)),
        **({} if last is None else _response(controller, last, now_s)),
        **_mission(controller, now_s),
    }


def _seen(last: TickRecord) -> dict[str, Any]:
    seen, decision = last.observation, last.decision
    return {
        "level": last.level.name.lower(),
        "cause": last.cause and last.cause.value,
        "phase": decision.phase.value,
        "why": decision.why,
        "wheels": list(last.applied),
        "heading_deg": seen and seen.heading_deg,
        "pitch_deg": seen and seen.pitch_deg,
        "roll_deg": seen and seen.roll_deg,
        "anomalies": [anomaly.value for anomaly in seen.anomalies] if seen else [],
        **last.memory(),
    }


def _response(controller: Controller, last: TickRecord, now_s: float) -> dict[str, Any]:
    """Return for how long the worst condition has been there, what the rover does about it, and until when."""
    if last.cause is None:
        return {}
    for_s = round(now_s - controller.cause_since_s, 1)
    if controller.mode not in {Mode.ARMED, Mode.MANUAL}:
        return {"cause_for_s": for_s}
    by_hand = controller.mode is Mode.MANUAL
    return {"cause_for_s": for_s, **said_of(last.cause, last.level, by_hand=by_hand)._asdict()}


def _mission(controller: Controller, now_s: float) -> dict[str, Any]:
    mission = controller.mission
    if mission is None:
        return {}
    return {
        "goal_heading_deg": controller.goal_heading_deg,
        "mission_s": round(now_s - mission.starts_s, 1),
        "travelled_m": round(mission.travelled_m, 2),
        "north_m": round(mission.north_m, 2),
        "east_m": round(mission.east_m, 2),
    }
