"""Schema of log records: the type of each key, and the range of each number.

``field_logs/README.md`` says what the keys mean. Ranges are far wider than any run needs: a value outside of them was
not written by a log, its bytes were changed later. What a sensor said has no range. A failing part may say anything,
and the log keeps it as it came. Nor is there one for the duties that a third party's algorithm wanted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

Record = dict[str, Any]
SCHEMA = 3  # each line has a checksum; schema 2 had none, and is read
OLDEST = 2

NUMBER = (float, int)  # exactly: in Python a bool is an int, in a log it is not


class Values(NamedTuple):
    """The types that a value may have, and for numbers the range. None, for "not known", may be but in ``STAMP``."""

    types: tuple[type, ...]
    least: float | None = None
    most: float | None = None


TEXT, FLAG, LIST, TABLE, ANY_NUMBER = (Values(types) for types in ((str,), (bool,), (list,), (dict,), NUMBER))
COUNT = Values((int,), 0, 2**53)
DUTY = Values(NUMBER, -1.01, 1.01)  # a driver may round
ANGLE = Values(NUMBER, -360.0, 360.0)
METRES = Values(NUMBER, -1e6, 1e6)
SINCE_BOOT = Values(NUMBER, 0.0, 1e9)  # seconds of a loop's clock: 31 years
SINCE_1970 = Values(NUMBER, 0.0, 1e10)  # seconds: up to the year 2286
LASTING = Values(NUMBER, 0.0, 1e9)  # seconds
CLOCK_STEP = Values(NUMBER, -1e10, 1e10)  # seconds: from any clock to any other

# By kind of record; ``STAMP`` is in each. What an algorithm remembers is in none: a third party's may be anything.
STAMP = {"n": COUNT, "t_s": SINCE_BOOT, "t_wall": SINCE_1970}
KEYS: Mapping[str, Mapping[str, Values]] = {
    "run": {
        "schema": Values((int,), 1, 2**53), "part": COUNT, "version": TEXT, "rover": TEXT, "algorithm": TEXT,
        "config": TABLE, "config_hash": TEXT, "parts": TABLE, "simulated": FLAG, "dry_run": FLAG, "log": TEXT,
        "start_delay_s": LASTING, "time_scale": Values(NUMBER, 1e-3, 1e6), "boot_id": TEXT,
        "trial": COUNT, "forest": COUNT, "noise": COUNT, "slip_mean_m": METRES, "budget_m": METRES, "mujoco": TABLE,
        "ground": TEXT, "slope": TABLE, "sim": TABLE,
    },
    "tick": {
        "compass": TABLE, "motion": TABLE, "contact": TABLE, "decision_t_s": SINCE_BOOT, "heading_deg": ANGLE,
        "pitch_deg": ANGLE, "roll_deg": ANGLE, "anomalies": LIST, "goal_heading_deg": ANGLE, "travelled_m": METRES,
        "covered_m": METRES,
        "phase": TEXT, "why": TEXT, "wanted_left": ANY_NUMBER, "wanted_right": ANY_NUMBER, "applied_left": DUTY,
        "applied_right": DUTY, "level": TEXT, "cause": TEXT,
    },
    "event": {
        "name": TEXT, "start_delay_s": LASTING, "goal_heading_deg": ANGLE, "failed": LIST, "reason": TEXT, "text": TEXT,
        "level": TEXT, "cause": TEXT, "sensor": TEXT, "error": TEXT, "retry_in_s": LASTING, "flags": TEXT, "part": TEXT,
        "counts": TABLE, "run": TEXT, "last_t_s": SINCE_BOOT, "last_t_wall": SINCE_1970, "mode": TEXT,
        "stall_s": LASTING, "by_s": CLOCK_STEP, "dropped": COUNT, "where": TEXT,
    },
    "position": {
        "latitude_deg": Values(NUMBER, -90.0, 90.0), "longitude_deg": Values(NUMBER, -180.0, 180.0),
        "error_m": Values(NUMBER, 0.0, 1e8),
    },
    "board": {"battery_v": ANY_NUMBER, "faults": LIST, "says_left": ANY_NUMBER, "says_right": ANY_NUMBER},
    "computer": {
        "cpu_c": Values(NUMBER, -273.0, 1000.0), "throttled": TEXT, "load_1min": Values(NUMBER, 0.0, 1e6),
        "disk_free_mb": Values(NUMBER, 0.0, 1e12), "log_dropped": COUNT,
    },
    "truth": {
        "x_m": METRES, "y_m": METRES, "heading_deg": ANGLE, "pitch_deg": ANGLE, "roll_deg": ANGLE, "slipping": FLAG,
        "touching": FLAG,
    },
    "fault": {"target": TEXT, "kind": TEXT, "begins": FLAG, "for_s": LASTING, "params": TABLE},
    "outcome": {"reason": TEXT, "text": TEXT, "dropped": COUNT},
}  # fmt: skip
READINGS: Mapping[str, Mapping[str, Values]] = {
    "compass": {
        "t_s": ANY_NUMBER, "heading_deg": ANY_NUMBER, "pitch_deg": ANY_NUMBER, "roll_deg": ANY_NUMBER,
        "calibration": ANY_NUMBER,
    },
    "motion": {
        "t_s": ANY_NUMBER, "forward_m": ANY_NUMBER, "right_m": ANY_NUMBER, "quality": ANY_NUMBER, "signed": FLAG,
    },
    "contact": {"t_s": ANY_NUMBER, "sides": LIST, "obstacle_bearing_deg": ANY_NUMBER},
}  # fmt: skip
KINDS = tuple(KEYS)

Rows = tuple[tuple[tuple[str, tuple[type, ...]], ...], tuple[tuple[str, tuple[type, ...], Any, Any], ...]]


def _rows(keys: Mapping[str, Values]) -> Rows:
    """Return a table as what is quickest to go through, types and ranges: an hour has 72,000 ticks of 30 values."""
    types = tuple((key, values.types) for key, values in keys.items() if values.least is None)
    ranges = tuple((key, *values) for key, values in keys.items() if values.least is not None)
    return types, ranges


_OF_KIND = {kind: _rows({**STAMP, **keys}) for kind, keys in KEYS.items()}
_OF_READING = {name: _rows(keys) for name, keys in READINGS.items()}


def is_record(value: object) -> bool:
    """Return whether a line's JSON is a record of a known kind with a time; what else is in it may still be wrong."""
    return isinstance(value, dict) and value.get("record") in KINDS and value.get("t_s") is not None


def is_newer(header: Record) -> bool:
    """Return whether a header says that a newer wayfarer has written the log."""
    return bool((header.get("schema") or 0) > SCHEMA)


def wrong_key(record: Record) -> str | None:
    """Return the first key of a record whose value cannot be, None where all can."""
    kind = record["record"]
    if (unsaid := _unsaid(record)) is not None:
        return unsaid
    wrong = _wrong(record, _OF_KIND[kind])
    if wrong is None and kind == "tick":
        for name, rows in _OF_READING.items():
            reading = record.get(name)
            if reading is not None and (key := _wrong(reading, rows)) is not None:
                return f"{name}.{key}"
    return wrong


def _unsaid(record: Record) -> str | None:
    """Return a key without a value that every log writes with one."""
    for key in STAMP:
        if record.get(key, 0) is None:
            return key
    return "schema" if record["record"] == "run" and record.get("schema") is None else None


def _wrong(values: Mapping[str, Any], rows: Rows) -> str | None:
    types, ranges = rows
    for key, allowed in types:
        value = values.get(key)
        if value is not None and type(value) not in allowed:
            return key
    for key, allowed, least, most in ranges:
        value = values.get(key)
        if value is not None and (type(value) not in allowed or not least <= value <= most):
            return key
    return None
