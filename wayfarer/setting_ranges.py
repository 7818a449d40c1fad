"""Allowed ranges of settings, one type for each unit and size.

A range with two bounds also rejects NaN and infinity. Those of a rover file are so narrow that they reject its usual
wrong units: millimetres and centimetres for metres, milliseconds for seconds, radians for degrees, percent for a share
(``config.messages`` says which one it may be). Limits that are wider are for programs.
"""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

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
