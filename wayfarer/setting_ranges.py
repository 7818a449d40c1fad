"""Allowed ranges of settings, one type for each unit and size.

A range with two bounds also rejects NaN and infinity. Those of a rover file are so narrow that they reject its usual
wrong units: millimetres and centimetres for metres, milliseconds for seconds, radians for degrees, percent for a share
(``config.messages`` says which one it may be). Limits that are wider are for programs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from math import degrees, inf
from numbers import Real
from typing import Annotated, Any, get_args, get_type_hints

from annotated_types import Interval

from wayfarer.errors import OutOfRange

# -- of a rover file ---------------------------------------------------------------------------------------------------

BodyMetres = Annotated[float, Interval(ge=0.1, le=5)]
"""Length, width and track of a rover."""
PartMetres = Annotated[float, Interval(ge=0.005, le=2)]
"""A wheel, or the height of something above the ground."""
StrideMetres = Annotated[float, Interval(ge=0.01, le=12)]
"""A piece of a manoeuvre."""
MetresPerSecond = Annotated[float, Interval(ge=0.01, le=5)]
"""Speeds in km/h are seen only beyond that."""
ShortSeconds = Annotated[float, Interval(ge=0.02, le=10)]
"""From a tick to a manoeuvre."""
ShortSecondsOrZero = Annotated[float, Interval(ge=0, le=10)]
"""As ``ShortSeconds``; 0 for at once."""
LongSeconds = Annotated[float, Interval(ge=0.5, le=600)]
"""What a person would wait for."""
Angle = Annotated[float, Interval(ge=5, le=180)]
"""Degrees; in radians no angle has so many."""
SmallAngle = Annotated[float, Interval(ge=0.5, le=180)]
"""Degrees, of a tolerance."""
DegreesPerSecond = Annotated[float, Interval(ge=10, le=1080)]
Hertz = Annotated[float, Interval(ge=0.1, le=500)]
Volts = Annotated[float, Interval(ge=3, le=60)]

# -- of anything -------------------------------------------------------------------------------------------------------

Metres = Annotated[float, Interval(gt=0, le=1000)]
MetresOrZero = Annotated[float, Interval(ge=0, le=1000)]
Seconds = Annotated[float, Interval(gt=0, le=86_400)]
SecondsOrZero = Annotated[float, Interval(ge=0, le=86_400)]
Degrees = Annotated[float, Interval(gt=0, le=180)]
DegreesOrZero = Annotated[float, Interval(ge=0, le=180)]
SignedDegrees = Annotated[float, Interval(ge=-180, le=180)]
DegreesPerSecondOrZero = Annotated[float, Interval(ge=0, le=1080)]
Fraction = Annotated[float, Interval(ge=0, le=1)]
Gain = Annotated[float, Interval(ge=0, le=100)]
Count = Annotated[int, Interval(ge=1, le=10_000)]


# -- what is said of a number outside of its range ---------------------------------------------------------------------

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
_TOO_LARGE = 1e15  # a whole number as large as this may be beyond every float once it is in another unit
_SHARE = ("", {"percent": 0.01})  # a key without a unit, with a range up to 1


def allowed_range(key: str, value: Any, hint: Any) -> str:
    """Return the whole range of a key, if its type ``hint`` has one, and in which wrong unit the value may be."""
    number: Any = value if isinstance(value, Real) else inf
    for interval in _intervals(hint):
        least = f"above {interval.gt:.10g}" if interval.gt is not None else f"{interval.ge:.10g}"
        most = f"below {interval.lt:.10g}" if interval.lt is not None else f"{interval.le:.10g}"
        unit, others = next((row for end, row in _UNITS.items() if key.endswith(end)), _SHARE)
        if unit == "" and (interval.le if interval.lt is None else interval.lt) != 1:
            others = {}  # a mere number
        meant = [
            f"; if it is in {other}, write {number * factor:.4g}"
            for other, factor in others.items()
            if abs(number) < _TOO_LARGE and _holds(interval, number * factor)
        ]
        return f"allowed is {least} to {most}{unit}{''.join(meant)}"
    return ""


def check_number(where: str, key: str, value: object, hint: Any) -> float:
    """Return a number that a program gave, which may be NumPy's, as Python's own; ``where`` is who takes it.

    Raises:
        OutOfRange: it is not a number, or outside of the range that the type ``hint`` says.
    """
    if getattr(value, "shape", None) == () and (item := getattr(value, "item", None)):
        value = item()  # NumPy's scalars, and its arrays of no dimension
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and all(_holds(interval, value) for interval in _intervals(hint)):
        return float(value)  # type: ignore[arg-type]
    wrong = "" if is_number else "not a number; "
    raise OutOfRange(f"{where}: {key} = {value!r:.80}: {wrong}{allowed_range(key, value, hint)}")


def check_fields(settings: object) -> None:
    """Check each number of a frozen settings dataclass as ``check_number`` does; for its ``__post_init__``.

    A rover file's settings were checked before, with the file's name. This is for those that a program makes.

    Raises:
        OutOfRange: one is not a number, or outside of its range.
    """
    kind: type = type(settings)
    for key, hint in _hints(kind).items():
        value = getattr(settings, key)
        number = check_number(kind.__name__, key, value, hint)
        if number is not value:
            object.__setattr__(settings, key, number)


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _holds(interval: Interval, value: Any) -> bool:
    """Return whether a value is within a two-sided range."""
    least: Any = interval.gt if interval.ge is None else interval.ge
    most: Any = interval.lt if interval.le is None else interval.le
    return bool(least <= value <= most) and value not in (interval.gt, interval.lt)


def _intervals(hint: Any) -> Iterator[Any]:
    """Give the two-sided ranges within a type, also if it may be None."""
    for annotation in getattr(hint, "__metadata__", ()):
        if isinstance(annotation, Interval):
            yield annotation
    for part in get_args(hint):
        yield from _intervals(part)
