"""Channels of plain numbers and words for plots and tables, from one table of fields. Pure.

Each field has its unit in its name and its meaning in the channel's JSON schema. A value that is not there, is ``null``
or has another type than the schema says is left out of its message, and a message without any value is not sent: so
another algorithm's memory, or a part that says nothing, leaves gaps in a plot and breaks nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

from wayfarer.angles import wrap180
from wayfarer.escape.api import Anomaly
from wayfarer.fieldlog.reader import Record

NOTHING = "none"  # a separate state: in a strip of states, a missing value would look like the previous one


class Field(NamedTuple):
    """One value of a message: its name with its unit, its type as JSON schema has it, and where a record has it."""

    name: str
    kind: str
    meaning: str
    of: Callable[[Record], object]


class Plot(NamedTuple):
    """One channel: the kind of record that it shows, and its fields."""

    record: str
    meaning: str
    fields: tuple[Field, ...]

    def schema(self, topic: str) -> dict[str, Any]:
        """Return the channel's JSON schema; of the types only plain ones, which every reader of schemas knows."""
        properties = {field.name: {"type": field.kind, "description": field.meaning} for field in self.fields}
        name = f"wayfarer.{topic.removeprefix('/')}"
        return {"type": "object", "title": name, "description": self.meaning, "properties": properties}

    def message(self, record: Record) -> dict[str, object]:
        """Return what a record says of the fields; a record that is not as its schema says may raise anything."""
        values = ((field, field.of(record)) for field in self.fields)
        return {field.name: value for field, value in values if _IS[field.kind](value)}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


_IS: Mapping[str, Callable[[object], bool]] = {
    "number": _is_number,
    "boolean": lambda value: isinstance(value, bool),
    "string": lambda value: isinstance(value, str),
}


def _field(name: str, kind: str, meaning: str, of: Callable[[Record], object] | None = None) -> Field:
    return Field(name, kind, meaning, of or (lambda record: record.get(name)))


def _number(name: str, meaning: str, of: Callable[[Record], object] | None = None) -> Field:
    return _field(name, "number", meaning, of)


def _moved(name: str, meaning: str) -> Field:
    return _number(name, meaning, lambda record: (record.get("motion") or {}).get(name))


def _shows(anomaly: Anomaly) -> Field:
    name = anomaly.value
    return _field(name, "boolean", _ANOMALIES[anomaly], lambda record: name in record["anomalies"])


def _error_deg(record: Record) -> float | None:
    """Return the turn that would bring the rover to its goal heading."""
    heading_deg, goal_deg = record.get("heading_deg"), record.get("goal_heading_deg")
    return None if heading_deg is None or goal_deg is None else wrap180(goal_deg - heading_deg)


_ANOMALIES: Mapping[Anomaly, str] = {
    Anomaly.IMMOBILISED: "the rover should move and does not",
    Anomaly.NOSE_UP: "the nose is tilted up",
    Anomaly.NOSE_DOWN: "the nose is tilted down",
    Anomaly.RIGHT_DOWN: "the right side is tilted down",
    Anomaly.LEFT_DOWN: "the left side is tilted down",
    Anomaly.TOUCHED: "a bumper is touched",
}

PLOTS: Mapping[str, Plot] = {
    "/heading": Plot(
        "tick",
        "Where the rover looks and where it wants to go, in degrees clockwise from magnetic north.",
        (
            _number("heading_deg", "heading, 0 to 360"),
            _number("goal_heading_deg", "goal heading, 0 to 360"),
            _number("error_deg", "turn that is left to the goal, -180 to 180, clockwise positive", _error_deg),
        ),
    ),
    "/tilt": Plot(
        "tick",
        "Tilt of the body.",
        (
            _number("pitch_deg", "positive: nose up"),
            _number("roll_deg", "positive: right side down"),
        ),
    ),
    "/phase": Plot(
        "tick",
        "What the rover does, and whether it is well.",
        (
            _field("phase", "string", "what the rover does"),
            _field("why", "string", "the phase, or in its first tick the event that began it"),
            _field("level", "string", "the worst condition of the rover itself: well, note, degrade, hold or fault"),
            _field(
                "cause", "string", "which condition that is", lambda record: record.get("cause", NOTHING) or NOTHING
            ),
        ),
    ),
    "/counter": Plot(
        "tick",
        "What the escape handler remembers; other algorithms than the paper's may remember other things.",
        (
            _number("counter_deg", "C: heading gained since the episode began, clockwise positive"),
            _number("side", "tau: the side to turn to, 1 clockwise, -1 counter-clockwise"),
            _number("turn_deg", "theta: the angle of the present turn"),
            _number("episodes", "episodes so far"),
            _number("blocked_turns", "blocked turns in a row"),
            _number("turn_from_duty", "the dead zone of turning that was learnt, as a turn duty"),
        ),
    ),
    "/wheels": Plot(
        "tick",
        "Duty of the wheels, -1 to 1.",
        (
            _number("wanted_left", "duty that the algorithm wants, left"),
            _number("wanted_right", "duty that the algorithm wants, right"),
            _number("applied_left", "duty that the motors took, left"),
            _number("applied_right", "duty that the motors took, right"),
        ),
    ),
    "/anomalies": Plot("tick", "What is wrong in the forest, as the rover notices it.", tuple(map(_shows, Anomaly))),
    "/motion": Plot(
        "tick",
        "What the motion sensor saw since it was last asked, and how far the rover went.",
        (
            _moved("forward_m", "displacement ahead"),
            _moved("right_m", "displacement to the right"),
            _moved("quality", "0: nothing can be said, to 1"),
            _number("path_m", "way by dead reckoning, forwards and backwards both counted up"),
            _number("travelled_m", "way as the wheels were commanded"),
            _number("covered_m", "way as the motion sensor saw it, as commanded where that cannot be believed"),
        ),
    ),
    "/battery": Plot(
        "board",
        "What the motor board says of itself.",
        (
            _number("battery_v", "battery, volts"),
            _field(
                "faults",
                "string",
                f"what is wrong with the board, or {NOTHING}",
                lambda record: ", ".join(map(str, record["faults"])) or NOTHING,
            ),
        ),
    ),
    "/computer": Plot(
        "computer",
        "The computer that runs wayfarer.",
        (
            _number("cpu_c", "temperature of the processor, degrees Celsius"),
            _field("throttled", "string", "power and heat bits of a Raspberry Pi, hexadecimal"),
            _number("load_1min", "processes that want to run, mean of a minute"),
            _number("disk_free_mb", "room for logs, MB"),
            _number("log_dropped", "records that could not be written so far"),
        ),
    ),
    "/truth_contact": Plot(
        "truth",
        "What really holds the rover; only in simulated runs.",
        (
            _field("slipping", "boolean", "the wheels slip"),
            _field("touching", "boolean", "the body touches something"),
        ),
    ),
}
