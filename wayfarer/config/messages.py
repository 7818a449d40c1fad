"""Validation of tables that people write, and what is said of a bad one: key, what was found, what is allowed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from math import degrees, isfinite
from typing import Any, TypeVar, cast, get_args, get_type_hints

from annotated_types import Interval
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError, with_config
from pydantic_core import ErrorDetails

from wayfarer.errors import BadConfig, near_names, one_line

T = TypeVar("T")

_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_OUT_OF_RANGE = {"greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number", "multiple_of"}
_SHOWN = 80  # characters of a value, or a key, that is quoted
# The unit that the end of a key says, and the units that people take for it, with what makes the right one of them.
_UNITS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "bytes_per_s": (" bytes per second", {"kB per second": 1e3}),
    "_per_s": (" per second", {"percent per second": 0.01}),
    "_deg_s": (" degrees per second", {"radians per second": degrees(1.0)}),
    "_m_s": (" metres per second", {"km/h": 1 / 3.6, "mm/s": 0.001, "cm/s": 0.01}),
    "_n_m": (" newton metres", {"newton millimetres": 0.001, "newton centimetres": 0.01}),
    "_kg": (" kilograms", {"grams": 0.001}),
    "_deg": (" degrees", {"radians": degrees(1.0)}),
    "_us": (" microseconds", {"milliseconds": 1e3, "seconds": 1e6}),
    "_hz": (" hertz", {"kHz": 1e3, "millihertz": 0.001}),
    "_mb": (" MB", {"GB": 1e3, "kB": 0.001, "bytes": 1e-6}),
    "_m": (" metres", {"millimetres": 0.001, "centimetres": 0.01, "kilometres": 1e3}),
    "_s": (" seconds", {"milliseconds": 0.001, "minutes": 60.0}),
    "_v": (" volts", {"millivolts": 0.001}),
}
_ENDLESS = 1e15  # no float may come of more
_SHARE = ("", {"percent": 0.01})  # a key without a unit, with a range up to 1
_LONG_KEY = re.compile(rf"'([^']{{{_SHOWN + 1},}})'")


def validated(kind: type[T], table: Mapping[str, Any], prefix: str = "") -> T:
    """Return a table as a model, or as a settings dataclass that knows no other keys; ``prefix`` is put before a key.

    Raises:
        BadConfig: it cannot be one; the text names the key and what is allowed.
    """
    try:
        # By way of JSON, because pydantic's strict mode takes tables for dataclasses from there only.
        checked: T = _adapter(cast(Any, kind)).validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        raise BadConfig(explain(error, kind, prefix)) from None
    return checked


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    """Return what checks a table; making one takes milliseconds."""
    return TypeAdapter(kind if issubclass(kind, BaseModel) else with_config(ConfigDict(extra="forbid"))(kind))


def _most_specific(error: ValidationError) -> ErrorDetails:
    """Return one problem of several: a mistyped key before the key that it leaves missing."""
    return min(error.errors(), key=lambda problem: problem["type"] not in _UNKNOWN)


def key_and_problem(error: ValidationError) -> str:
    """Say in short what is wrong with a file that wayfarer itself has written."""
    problem = _most_specific(error)
    key = one_line(".".join(map(str, problem["loc"])))
    return f"{shortened(key) or 'the file'}: {problem['msg']}"


def explain(error: ValidationError, model: Any, prefix: str = "") -> str:
    """Say what is wrong with one key of a model or a settings class; ``prefix`` is put before the key."""
    problem = _most_specific(error)
    text = problem["msg"].removeprefix("Value error, ")
    if not problem["loc"]:
        return f"key '{prefix[:-1]}': {text}" if prefix else text
    if problem["type"] == "value_error" and text.startswith(("key '", "unknown key '")):
        return text
    *section, key = (str(part) for part in problem["loc"])
    model = _section_model(model, section)
    dotted = prefix + ".".join([*section, key])
    if problem["type"] in _UNKNOWN:
        near = near_names(key, _known_keys(model))
        return f"unknown key '{dotted}'" + (f"; did you mean '{near[0]}'?" if near else "")
    if problem["type"] in {"missing", "missing_argument"}:
        return f"key '{dotted}' is missing"
    wanted = (text[:1].lower() + text[1:]).replace("an object", "a table")  # JSON's word for it is not TOML's
    allowed = _allowed(model, key, problem["input"]) if problem["type"] in _OUT_OF_RANGE else ""
    if isinstance(problem["input"], float) and not isfinite(problem["input"]):
        wanted = "input should be a finite number"
    return f"key '{dotted}' = {shown(problem['input'])}: {wanted}{allowed}"


def shown(value: object) -> str:
    """Return a value as it is quoted to a person: the middle of a long one is left out."""
    return shortened(repr(value))


def shortened(text: str) -> str:
    """Return a text without the middle of a long one."""
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN // 2]}...{text[-_SHOWN // 4 :]}"


def located(where: str, said: str) -> str:
    """Return an explanation as one line, after the file."""
    return one_line(f"{where}: {with_short_keys(said)}")


def with_short_keys(said: str) -> str:
    """Return an explanation in which the middle of each long quoted key is left out."""
    return _LONG_KEY.sub(lambda quoted: f"'{shortened(quoted[1])}'", said)


def _section_model(model: Any, section: list[str]) -> Any:
    """Return what says the ranges of a section's keys; the items of a list have none of their own."""
    tables = getattr(model, "model_fields", {})  # a settings dataclass has no tables within
    within = tables[section[0]].annotation if section and section[0] in tables else model
    return within if isinstance(within, type) else model


def _known_keys(model: Any) -> list[str]:
    fields = getattr(model, "model_fields", None) or getattr(model, "__dataclass_fields__", {})
    return list(fields)


def _allowed(model: Any, key: str, value: Any) -> str:
    """Return the whole range of a key, if its type has one, and in which wrong unit the value may be."""
    for interval in _intervals(get_type_hints(model, include_extras=True).get(key)):
        least = f"above {interval.gt:.10g}" if interval.gt is not None else f"{interval.ge:.10g}"
        most = f"below {interval.lt:.10g}" if interval.lt is not None else f"{interval.le:.10g}"
        unit, others = next((row for end, row in _UNITS.items() if key.endswith(end)), _SHARE)
        if unit == "" and (interval.le if interval.lt is None else interval.lt) != 1:
            others = {}  # a mere number
        meant = [
            f"; if it is in {other}, write {value * factor:.4g}"
            for other, factor in others.items()
            if abs(value) < _ENDLESS and _holds(interval, value * factor)
        ]
        return f"; allowed is {least} to {most}{unit}{''.join(meant)}"
    return ""


def _holds(interval: Interval, value: float) -> bool:
    """Return whether a value is within a two-sided range."""
    least: Any = interval.gt if interval.ge is None else interval.ge
    most: Any = interval.lt if interval.le is None else interval.le
    return bool(least <= value <= most) and value not in (interval.gt, interval.lt)


def _intervals(hint: Any) -> Iterator[Any]:
    """Give the two-sided ranges within a type, also if it may be None."""
    for each in getattr(hint, "__metadata__", ()):
        if isinstance(each, Interval):
            yield each
    for part in get_args(hint):
        yield from _intervals(part)
