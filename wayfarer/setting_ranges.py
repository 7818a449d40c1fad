"""Allowed ranges of settings, one type for each unit.

A range with two bounds also rejects NaN and infinity. The message about a rejected value quotes the range.
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
DegreesPerSecondOrZero = Annotated[float, Interval(ge=0, le=1080)]
Fraction = Annotated[float, Interval(ge=0, le=1)]
Gain = Annotated[float, Interval(ge=0, le=100)]
Count = Annotated[int, Interval(ge=1, le=10_000)]
