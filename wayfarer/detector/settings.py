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
    # The rover stands if it moved, over this time, by less than this share of what was possible from its speed before.
    # All three from no source.
    immobilised_s: Seconds = 0.3
    immobilised_below: Fraction = 0.3
    immobilised_from_m_s: MetresPerSecond = 0.1  # commanded; below it nothing is claimed
    # It gets nowhere if the same holds over this time, at least immobilised_s (ArduPilot's crash check takes 2 s).
    nowhere_s: Seconds = 2.0
    # How fast this body gains or loses speed on the most slippery ground that it meets: a friction of 0.05, half of
    # that of mud; from no measurement. It limits what a body that starts, coasts or turns can do.
    gain_m_s2: Annotated[float, Interval(gt=0, le=20)] = 0.5

    # -- tilt -------------------------------------------------------------------------------------------------------
    # Counted from the ground. The released field code stops beyond 15 degrees of pitch; this limit is for both axes and
    # both signs, with a margin for rough ground. PX4's attitude trigger takes 0.3 s.
    tilt_deg: Degrees = 20.0
    tilt_s: SecondsOrZero = 0.2
    # A body that climbs fast tips over within those 0.2 s. One that will reach this angle within this time, at its
    # present rate, counts as tilted at once. The shipped bodies tip at 51 degrees (docs/explanation/physics.md); the
    # time is a reading, a tick and the motors' lag together.
    tipping_deg: Degrees = 45.0
    tipping_s: SecondsOrZero = 0.2
    overturned_deg: Degrees = 60.0
    overturned_s: SecondsOrZero = 0.1  # longer than one reading with a flipped bit

    # -- ages of readings -------------------------------------------------------------------------------------------
    # PX4 gives a compass 0.3 s, ArduPilot gives flow 0.5 s and a failed link 1.5 s (faults 1, 15 and 22). These are
    # less by one reading and one tick.
    compass_stale_s: Seconds = 0.25
    compass_lost_s: Seconds = 5.0
    motion_stale_s: Seconds = 0.4  # silent
    motion_unknown_s: Seconds = 0.9  # answers, but sees nothing
    motion_lost_s: Seconds = 10.0  # either, for so long
    contact_stale_s: Seconds = 0.5
    touch_s: SecondsOrZero = 0.0

    # -- motion sensor ----------------------------------------------------------------------------------------------
    quality_min: Fraction = 0.2  # of a reading that counts
    motion_speed_max_m_s: MetresPerSecond = 5.0  # no rover goes faster: such a reading is wrong
    # Driven ahead without sight, before the rover turns away as if it were stuck. At 1 m/s it pushes against what it
    # did not see for 3 s, which is the bound of faults 29 and 58 for a held motor.
    blind_stride_m: Metres = 3.0

    # -- compass ----------------------------------------------------------------------------------------------------
    # A heading is rejected if it is further from the last one than this, and further than this rate (twice the fastest
    # commanded turn) allows in the time between (fault 5: 45 degrees in 50 ms).
    heading_jump_deg: Degrees = 45.0
    heading_rate_max_deg_s: DegreesPerSecond = 360.0
    # The rover stops while so many of the last readings were rejected (fault 5: 5 of 10). If every reading was, for
    # this time, because of such a jump, it believes the newest one, but stops first.
    implausible_rejected: Count = 5
    implausible_of: Count = 10
    implausible_s: Seconds = 0.5
    # A heading that stays the same during this time of commanded turns, faster than this, is frozen (fault 4). It
    # counts while the rover is seen to move; a rover that stands may be held, so then pitch and roll must stay as
    # well.
    frozen_s: Seconds = 1.0
    frozen_turn_deg_s: DegreesPerSecond = 20.0
    # A compass that is calibrated less than arming demands is reported after this time. After that, each rejected
    # reading makes it implausible for as long (fault 10).
    uncalibrated_s: Seconds = 0.9

    # -- runaway ----------------------------------------------------------------------------------------------------
    # It moves at this speed for this time, counted from this time after the last command to move: together the 0.5 s of
    # fault 30. Before that it may coast; later too, as long as it loses gain_m_s2 or more of its speed.
    runaway_after_s: Seconds = 0.3
    runaway_for_s: Seconds = 0.2
    runaway_from_m_s: MetresPerSecond = 0.1

    # -- turning on the spot ----------------------------------------------------------------------------------------
    # Full duty that hardly turns the rover for this time is a failed try. So many in a row are reported; after so many
    # it makes no progress, as after that number of anomalies in the fault catalogue (fault 57).
    cannot_turn_s: Seconds = 0.5
    cannot_turn_tries: Count = 3
    cannot_turn_max: Count = 12

    def __post_init__(self) -> None:
        if self.implausible_rejected > self.implausible_of:
            raise ValueError(
                f"implausible_rejected = {self.implausible_rejected} must not exceed"
                f" implausible_of = {self.implausible_of}"
            )
