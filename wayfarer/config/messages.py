"""Validation of tables that people write, and what is said of a bad one: key, what was found, what is allowed."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from math import isfinite
from typing import Any, TypeVar, cast, get_type_hints

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError, with_config
from pydantic_core import ErrorDetails

from wayfarer.errors import BadConfig, near_names, one_line
from wayfarer.setting_ranges import allowed_range

T = TypeVar("T")

_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_OUT_OF_RANGE = {"greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number", "multiple_of"}
_SHOWN = 80  # characters of a value, or a key, that is quoted
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
    hint = get_type_hints(model, include_extras=True).get(key) if problem["type"] in _OUT_OF_RANGE else None
    allowed = allowed_range(key, problem["input"], hint)
    if isinstance(problem["input"], float) and not isfinite(problem["input"]):
        wanted = "input should be a finite number"
    return f"key '{dotted}' = {shown(problem['input'])}: {wanted}{allowed and f'; {allowed}'}"


def shown(value: object) -> str:
    """Return a value as it is quoted to a person: the middle of a long one is left out."""
    return shortened(one_line(repr(value)))


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
    """Return what says the ranges of a section's keys; the items of a list have no range."""
    tables = getattr(model, "model_fields", {})  # a settings dataclass has no tables within
    within = tables[section[0]].annotation if section and section[0] in tables else model
    return within if isinstance(within, type) else model


def _known_keys(model: Any) -> list[str]:
    fields = getattr(model, "model_fields", None) or getattr(model, "__dataclass_fields__", {})
    return list(fields)
