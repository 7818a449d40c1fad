"""Axes of a sweep, parsed from ``KEY=FIRST:LAST:STEP`` or ``KEY=VALUE,VALUE``."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal

from wayfarer.errors import BadInput

Value = bool | int | float | str

MOST_AXES = 2  # a curve or a map; more cannot be drawn
MOST_VALUES = 1000  # of one key; more is a mistyped step
MOST_DIGITS = 15  # before or after the point


@dataclass(frozen=True, slots=True)
class Axis:
    """A key and the values that it takes, at least one, each once, in the order in which they were asked for."""

    key: str
    values: tuple[Value, ...]


def parse_axis(text: str) -> Axis:
    """Return the axis that a text names; a range includes its last value where a step ends there.

    Raises:
        BadInput: it is neither a list nor a range, or its values are too many.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (key and equals and values):
        raise BadInput(f"'{text}': write KEY=VALUES, such as escape.turn_angle_deg=10:180:10 or sim.trees_per_ha=40,80")
    found = _range(text, values.split(":")) if ":" in values else [_value(part.strip()) for part in values.split(",")]
    if "" in found:
        raise BadInput(f"'{text}': a value is missing between two commas, or at an end")
    return Axis(key, tuple(dict.fromkeys(found)))


def _range(text: str, parts: list[str]) -> list[Value]:
    try:
        first, last, step = (_decimal(part) for part in parts)
        count = int((last - first) / step) + 1
    except (ValueError, ArithmeticError):
        raise BadInput(
            f"'{text}': a range is FIRST:LAST:STEP, three numbers and a step that is not 0, such as 10:180:10"
        ) from None
    if not 1 <= count <= MOST_VALUES:
        why = f"{count} values, allowed are {MOST_VALUES}" if count > 1 else "the step leads away from the last value"
        raise BadInput(f"'{text}': {why}; a range is FIRST:LAST:STEP")
    return [_number(first + step * number) for number in range(count)]


def _value(text: str) -> Value:
    if text in {"true", "false"}:
        return text == "true"
    try:
        return _number(_decimal(text))
    except (ArithmeticError, ValueError):
        return text


def _decimal(text: str) -> Decimal:
    """Return a number that can be a setting.

    Raises:
        ArithmeticError: it is no number.
        ValueError: it is not finite, or so large or small that a whole number of it would fill the memory.
    """
    value = Decimal(text.strip())
    if not value.is_finite() or (value and abs(value.adjusted()) > MOST_DIGITS):
        raise ValueError(text)
    return value


def _number(value: Decimal) -> int | float:
    """Return a whole number as an int, which a key that counts something needs."""
    return int(value) if value == value.to_integral_value() else float(value)
