"""Thresholds of the detector: when a rover counts as stuck, tilted or running away, and a sensor as stale or wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from wayfarer.setting_ranges import (
    Angle,
    DegreesPerSecond,
    Fraction,
    MetresPerSecond,
    ShortSeconds,
    ShortSecondsOrZero,
    StrideMetres,
)


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """Thresholds; "fault" is a row of the fault catalogue. What we chose says so, or explains why."""

    # -- stuck ------------------------------------------------------------------------------------------------------

    immobilised_s: ShortSeconds = 0.3
    """The rover is immobilised if over this time it moved by less than ``immobilised_below`` of what was possible from
    its speed before. Chosen by us."""
    immobilised_below: Fraction = 0.3
    """Share of the possible distance below which it is immobilised. Chosen by us."""
    immobilised_from_m_s: MetresPerSecond = 0.1
    """Commanded speed below which nothing is claimed. Chosen by us."""
    nowhere_s: ShortSeconds = 2.0
    """It gets nowhere if the same as in ``immobilised_s`` holds over this time, at least ``immobilised_s`` (ArduPilot's
    crash check takes 2 s)."""
    stall_current_a: Annotated[float, Interval(ge=0.1, le=500)] | None = None
    """What the motors of one side draw that are held at full duty, in amperes; only `current` in `anomaly_source` needs
    it. Of a Pololu 37D of 12 V it is 5.5 A each (data sheet)."""
    gain_m_s2: Annotated[float, Interval(ge=0.01, le=20)] = 0.5
    """How fast this body gains or loses speed on the most slippery ground that it meets: a friction of 0.05, half of
    that of mud; chosen by us, not measured. It limits what a body that starts, coasts or turns can do."""

    # -- tilt -------------------------------------------------------------------------------------------------------

    tilt_deg: Angle = 20.0
    """Pitch or roll, counted from the ground, from which the rover is tilted. The released field code stops beyond 15
    degrees of pitch; this limit is for both axes and both signs, with a margin for rough ground."""
    tilt_s: ShortSecondsOrZero = 0.2
    """For how long it must be tilted. PX4's attitude trigger takes 0.3 s."""
    tipping_deg: Angle = 45.0
    """A body that climbs fast tips over within ``tilt_s``. One that will reach this angle within ``tipping_s``, at its
    current rate, counts as tilted at once. The shipped bodies tip at 51 degrees."""
    tipping_s: ShortSecondsOrZero = 0.2
    """See ``tipping_deg``: a reading, a tick and the motors' lag together."""

    # -- ages of readings -------------------------------------------------------------------------------------------
    # PX4 gives a compass 0.3 s, ArduPilot gives flow 0.5 s and a failed link 1.5 s (faults 1, 15 and 22). These are
    # less by one reading and one tick.

    compass_stale_s: ShortSeconds = 0.25
    """Without a reading for so long the compass is silent."""
    motion_stale_s: ShortSeconds = 0.4
    """Without a reading for so long the motion sensor is silent."""
    contact_stale_s: ShortSeconds = 0.5
    """Without a reading for so long the contact sensor is silent."""
    wheels_stale_s: ShortSeconds = 0.5
    """Without a reading for so long the wheel sensor is silent."""
    touch_s: ShortSecondsOrZero = 0.0
    """For how long a contact must last to count."""

    # -- motion sensor ----------------------------------------------------------------------------------------------

    quality_min: Fraction = 0.2
    """Lowest quality of a reading that counts, 0 to 1."""
    motion_speed_max_m_s: Annotated[float, Interval(ge=0.5, le=10)] = 5.0
    """No rover goes faster: a reading of more is wrong."""
    blind_stride_m: StrideMetres = 3.0
    """Driven ahead without sight, before the rover turns away as if it were stuck. At 1 m/s it pushes against what it
    did not see for 3 s, which is the bound of faults 29 and 58 for a held motor."""

    # -- compass ----------------------------------------------------------------------------------------------------

    heading_rate_max_deg_s: DegreesPerSecond = 360.0
    """Twice the fastest commanded turn: a heading that is 45 degrees from the last one, and got there faster, is
    rejected (fault 5)."""

    # -- wheels that do not obey ------------------------------------------------------------------------------------

    runaway_from_m_s: MetresPerSecond = 0.1
    """A rover that is commanded to stop and moves faster than this runs away."""
    cannot_turn_s: ShortSeconds = 0.5
    """Full duty that hardly turns the rover for this time is a failed try."""
