"""Channels of plain numbers and words for plots and tables, from one table of fields. Pure.

Each field has its unit in its name and its meaning in the channel's JSON schema; its type is that of the log's key. A
value that is missing or not a number is left out of its message, and a message without any value is not sent. So a gap
in a plot is all that a part without data causes, or an algorithm that remembers other things.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

from wayfarer.angles import wrap180
from wayfarer.fieldlog.record import AnyRecord, Board, Computer, Tick, Truth
from wayfarer.vocabulary import ANOMALY_TEXTS, response_text

NOTHING = "none"  # a separate state: in a strip of states, a missing value would look like the previous one


class Plot(NamedTuple):
    """One channel: the view of the records that it shows, what it is about, and its fields with their meanings."""

    view: type[AnyRecord]
    meaning: str
    fields: Mapping[str, str]

    def schema(self, topic: str) -> dict[str, Any]:
        """Return the channel's JSON schema; of the types only plain ones, which every reader of schemas knows."""
        properties = {
            name: {"type": _kind(self.view, name), "description": meaning} for name, meaning in self.fields.items()
        }
        name = f"wayfarer.{topic.removeprefix('/')}"
        return {"type": "object", "title": name, "description": self.meaning, "properties": properties}

    def message(self, view: AnyRecord) -> dict[str, object]:
        """Return what a record says of the fields."""
        values = ((name, _value(view, name)) for name in self.fields)
        return {
            name: value
            for name, value in values
            if value is not None and not (isinstance(value, float) and not isfinite(value))
        }


FURTHER: Mapping[str, Any] = {
    "type": "object",
    "title": "wayfarer.further",
    "description": "Other keys of a tick's record, such as the memory of another algorithm.",
}


def _kind(view: type[AnyRecord], name: str) -> str:
    """Return the type of a field in JSON schema, from the log's record; what an algorithm remembers are numbers."""
    types = str(view.__annotations__.get(name, "float"))
    if "bool" in types or name in ANOMALY_TEXTS:
        return "boolean"
    return "string" if "str" in types or name == "response" else "number"


def _value(view: Any, name: str) -> object:
    """Return a field: worked out, a key of the record, or else what the algorithm remembers."""
    if name in _DERIVED:
        return _DERIVED[name](view)
    return getattr(view, name) if name in view.__struct_fields__ else view.remembered(name)


def _error_deg(tick: Any) -> float | None:
    heading_deg, goal_deg = tick.heading_deg, tick.goal_heading_deg
    return None if heading_deg is None or goal_deg is None else wrap180(goal_deg - heading_deg)


def _moved(name: str) -> Callable[[Any], object]:
    return lambda tick: getattr(tick.motion, name, None)


def _felt(kind: str) -> Callable[[Any], object]:
    return lambda tick: kind in tick.anomalies


_DERIVED: Mapping[str, Callable[[Any], object]] = {
    "error_deg": _error_deg,
    "cause": lambda tick: tick.cause or NOTHING,
    "response": lambda tick: response_text(tick.level, tick.cause, by_hand=tick.phase == "manual") or NOTHING,
    "faults": lambda board: ", ".join(board.faults) or NOTHING,
    **{name: _moved(name) for name in ("forward_m", "right_m", "quality")},
    **{kind: _felt(kind) for kind in ANOMALY_TEXTS},
}

PLOTS: Mapping[str, Plot] = {
    "/heading": Plot(
        Tick,
        "Heading of the rover and of its goal, in degrees clockwise from magnetic north.",
        {
            "heading_deg": "heading, 0 to 360",
            "goal_heading_deg": "goal heading, 0 to 360",
            "error_deg": "remaining turn to the goal, -180 to 180, clockwise positive",
        },
    ),
    "/tilt": Plot(
        Tick, "Tilt of the body.", {"pitch_deg": "positive: nose up", "roll_deg": "positive: right side down"}
    ),
    "/phase": Plot(
        Tick,
        "Phase and health of the rover.",
        {
            "phase": "what the rover does",
            "why": "the phase, or in its first tick the event that began it",
            "level": "the worst condition of the rover itself: well, note, degrade, hold or fault",
            "cause": "which condition that is",
            "response": "what an armed rover does because of it, and until when",
        },
    ),
    "/counter": Plot(
        Tick,
        "Memory of the escape handler; algorithms other than the paper's may remember other things.",
        {
            "counter_deg": "C: heading gained since the episode began, clockwise positive",
            "side": "tau: the side to turn to, 1 clockwise, -1 counter-clockwise",
            "turn_deg": "theta: the angle of the present turn",
            "episodes": "episodes so far",
            "blocked_turns": "blocked turns in a row",
            "turn_from_duty": "the dead zone of turning that was learnt, as a turn duty",
        },
    ),
    "/wheels": Plot(
        Tick,
        "Duty of the wheels, -1 to 1.",
        {
            "wanted_left": "duty that the algorithm wants, left",
            "wanted_right": "duty that the algorithm wants, right",
            "applied_left": "duty that the motors took, left",
            "applied_right": "duty that the motors took, right",
        },
    ),
    "/anomalies": Plot(Tick, "Anomalies that the rover has detected.", ANOMALY_TEXTS),
    "/motion": Plot(
        Tick,
        "Readings of the motion sensor since the last tick, and the distance so far.",
        {
            "forward_m": "displacement ahead",
            "right_m": "displacement to the right",
            "quality": "0 (unusable) to 1",
            "path_m": "distance by dead reckoning, forwards and backwards added up",
            "travelled_m": "distance as commanded",
            "covered_m": "distance by the motion sensor, as commanded if the sensor is not usable",
        },
    ),
    "/battery": Plot(
        Board,
        "Status that the motor board reports.",
        {"battery_v": "battery, volts", "faults": f"what is wrong with the board, or {NOTHING}"},
    ),
    "/computer": Plot(
        Computer,
        "The computer that runs wayfarer.",
        {
            "cpu_c": "temperature of the processor, degrees Celsius",
            "throttled": "power and heat bits of a Raspberry Pi, hexadecimal",
            "load_1min": "processes that run or wait, mean of a minute",
            "disk_free_mb": "free disk space for logs, MB",
            "disk_read_only": "whether the disk of the logs cannot be written",
            "disk_memory": f"what keeps the logs in memory only, or {NOTHING}",
            "log_dropped": "records that could not be written so far",
            "log_sync_ms": "longest time in which the card stored records, ms",
        },
    ),
    "/truth_contact": Plot(
        Truth,
        "Ground truth of slips and contacts; only in simulated runs.",
        {"slipping": "the wheels slip", "touching": "the body touches something"},
    ),
    "/time": Plot(
        Tick,
        "Times and number of this tick, as other tools show them.",
        {
            "elapsed_s": "seconds since the log began, as in tables and in wayfarer replay",
            "t_s": "the rover's monotonic clock, seconds",
            "n": "the number of the record",
        },
    ),
}
