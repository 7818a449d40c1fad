"""Allowed ranges of settings, by unit.

A two-sided range is also what keeps NaN and infinity out, and it is quoted to the user when a value is refused.
"""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

Metres = Annotated[float, Interval(gt=0, le=1000)]
MetresOrZero = Annotated[float, Interval(ge=0, le=1000)]
MetresPerSecond = Annotated[float, Interval(gt=0, le=10)]
Seconds = Annotated[float, Interval(gt=0, le=86_400)]
SecondsOrZero = Annotated[float, Interval(ge=0, le=86_400)]
Hertz = Annotated[float, Interval(ge=0.1, le=1000)]
Degrees = Annotated[float, Interval(gt=0, le=180)]
DegreesOrZero = Annotated[float, Interval(ge=0, le=180)]
SignedDegrees = Annotated[float, Interval(ge=-180, le=180)]
DegreesPerSecond = Annotated[float, Interval(gt=0, le=1080)]
Fraction = Annotated[float, Interval(ge=0, le=1)]
Gain = Annotated[float, Interval(ge=0, le=100)]
Count = Annotated[int, Interval(ge=1, le=10_000)]
