"""Thresholds of the detector: when a rover counts as stuck, tilted or running away, and a sensor as stale or wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from wayfarer.setting_ranges import (
    Count,
    Degrees,
    DegreesPerSecond,
    Fraction,
    Metres,
    MetresPerSecond,
    Seconds,
    SecondsOrZero,
)


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """Thresholds; "fault" is a row of the fault catalogue. What has no source says so, or explains its choice."""

    # -- stuck ------------------------------------------------------------------------------------------------------

    immobilised_s: Seconds = 0.3
    """The rover is immobilised if over this time it moved by less than ``immobilised_below`` of what was possible from
    its speed before. Chosen by us."""
    immobilised_below: Fraction = 0.3
    """Share of the possible distance below which it is immobilised. Chosen by us."""
    immobilised_from_m_s: MetresPerSecond = 0.1
    """Commanded speed below which nothing is claimed. Chosen by us."""
    nowhere_s: Seconds = 2.0
    """It gets nowhere if the same as in ``immobilised_s`` holds over this time, at least ``immobilised_s`` (ArduPilot's
    crash check takes 2 s)."""
    gain_m_s2: Annotated[float, Interval(gt=0, le=20)] = 0.5
    """How fast this body gains or loses speed on the most slippery ground that it meets: a friction of 0.05, half of
    that of mud; from no measurement. It limits what a body that starts, coasts or turns can do."""

    # -- tilt -------------------------------------------------------------------------------------------------------

    tilt_deg: Degrees = 20.0
    """Pitch or roll, counted from the ground, from which the rover is tilted. The released field code stops beyond 15
    degrees of pitch; this limit is for both axes and both signs, with a margin for rough ground."""
    tilt_s: SecondsOrZero = 0.2
    """For how long it must be tilted. PX4's attitude trigger takes 0.3 s."""
    tipping_deg: Degrees = 45.0
    """A body that climbs fast tips over within ``tilt_s``. One that will reach this angle within ``tipping_s``, at its
    present rate, counts as tilted at once. The shipped bodies tip at 51 degrees (docs/explanation/physics.md)."""
    tipping_s: SecondsOrZero = 0.2
    """See ``tipping_deg``: a reading, a tick and the motors' lag together."""
    overturned_deg: Degrees = 60.0
    """Pitch or roll from which the rover lies on its side or its back."""
    overturned_s: SecondsOrZero = 0.1
    """For how long it must; longer than one reading with a flipped bit."""

    # -- ages of readings -------------------------------------------------------------------------------------------
    # PX4 gives a compass 0.3 s, ArduPilot gives flow 0.5 s and a failed link 1.5 s (faults 1, 15 and 22). These are
    # less by one reading and one tick.

    compass_stale_s: Seconds = 0.25
    """Without a reading for so long the compass is silent."""
    compass_lost_s: Seconds = 5.0
    """Without a reading for so long the compass is lost."""
    motion_stale_s: Seconds = 0.4
    """Without a reading for so long the motion sensor is silent."""
    motion_unknown_s: Seconds = 0.9
    """If it answers but sees nothing for so long, the motion of the rover is unknown."""
    contact_stale_s: Seconds = 0.5
    """Without a reading for so long the contact sensor is silent."""
    touch_s: SecondsOrZero = 0.0
    """For how long a contact must last to count."""

    # -- motion sensor ----------------------------------------------------------------------------------------------

    quality_min: Fraction = 0.2
    """Lowest quality of a reading that counts, 0 to 1."""
    motion_speed_max_m_s: MetresPerSecond = 5.0
    """No rover goes faster: a reading of more is wrong."""
    blind_stride_m: Metres = 3.0
    """Driven ahead without sight, before the rover turns away as if it were stuck. At 1 m/s it pushes against what it
    did not see for 3 s, which is the bound of faults 29 and 58 for a held motor."""

    # -- compass ----------------------------------------------------------------------------------------------------

    heading_jump_deg: Degrees = 45.0
    """A heading is rejected if it is further from the last one than this, and further than ``heading_rate_max_deg_s``
    allows in the time between (fault 5: 45 degrees in 50 ms)."""
    heading_rate_max_deg_s: DegreesPerSecond = 360.0
    """See ``heading_jump_deg``; twice the fastest commanded turn."""
    implausible_rejected: Count = 5
    """The rover stops while this number of the last ``implausible_of`` readings were rejected (fault 5: 5 of 10)."""
    implausible_of: Count = 10
    """See ``implausible_rejected``; a number of readings."""
    implausible_s: Seconds = 0.5
    """If every reading was rejected for this time, because of a jump, the rover believes the newest one, but stops
    first."""
    frozen_s: Seconds = 1.0
    """A heading that stays the same during this time of commanded turns is frozen (fault 4). It counts while the rover
    is seen to move; a rover that stands may be held, so then pitch and roll must stay as well. A compass that repeats
    all three for 5 s in which the rover is seen to drive is frozen without a turn."""
    frozen_turn_deg_s: DegreesPerSecond = 20.0
    """Commanded turns that are faster than this count for ``frozen_s``."""
    uncalibrated_s: Seconds = 0.9
    """A compass that is calibrated less than arming demands is reported after this time. After that, each rejected
    reading makes it implausible for as long (fault 10)."""

    # -- runaway ----------------------------------------------------------------------------------------------------

    runaway_after_s: Seconds = 0.3
    """A rover runs away if it moves although the last command to move is this time ago. ``runaway_for_s`` and this are
    together the 0.5 s of fault 30. Before that it may coast; later too, as long as it loses ``gain_m_s2`` or more of
    its speed."""
    runaway_for_s: Seconds = 0.2
    """For how long it must move."""
    runaway_from_m_s: MetresPerSecond = 0.1
    """Speed from which it moves."""

    # -- turning on the spot ----------------------------------------------------------------------------------------

    cannot_turn_s: Seconds = 0.5
    """Full duty that hardly turns the rover for this time is a failed try."""
    cannot_turn_tries: Count = 3
    """Number of failed tries in a row that is reported."""
    cannot_turn_max: Count = 12
    """Number of failed tries in a row after which it makes no progress, as after that number of anomalies in the fault
    catalogue (fault 57)."""

    def __post_init__(self) -> None:
        if self.implausible_rejected > self.implausible_of:
            raise ValueError(
                f"implausible_rejected = {self.implausible_rejected} must not exceed"
                f" implausible_of = {self.implausible_of}"
            )
