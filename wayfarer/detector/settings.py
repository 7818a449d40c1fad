"""Thresholds of the detector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from wayfarer.units import Count, Degrees, DegreesPerSecond, Fraction, Metres, MetresPerSecond, Seconds, SecondsOrZero


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """Thresholds, each with its own unit; "fault" is a row of the fault catalogue.

    ``stale`` ages: PX4 gives a compass 0.3 s, ArduPilot gives flow 0.5 s and a failed link 1.5 s; these, and the second
    of a sensor that sees nothing, are less by a reading and a tick, so that the wheels stand in time. A motion sensor
    that speaks and sees nothing is unknown and then lost; one that is silent for ``motion_lost_s`` is gone (faults 15
    and 22).
    Tilt persists 0.2 s as PX4's attitude trigger persists 0.3 s; the released field code stops beyond 15 degrees of
    pitch, here on both axes and both signs with margin for rough ground. A body that climbs fast tips over within those
    0.2 s: one that at its rate will be tilted by ``tipping_deg`` in ``tipping_s`` is tilted now. The shipped bodies tip
    at 51 degrees (closed form, docs/physics.md); a reading, a tick and the motors' lag (``simhal.Physics``) together
    are those 0.2 s. Beyond ``overturned_deg`` for ``overturned_s``, which one reading with a flipped bit is not, it
    lies on its side.

    ``gain_m_s2`` is how fast this body gains speed, and loses it, on the most slippery ground that it meets: a friction
    of 0.05, half of that of mud; from no measurement. What starts, coasts or turns on is judged by it. Over
    ``immobilised_s`` the rover stands when it moved by less than the share ``immobilised_below`` of what was possible
    from its speed before; over ``nowhere_s``, which is never taken as the shorter one, it gets nowhere (ArduPilot's
    crash check takes 2 s).

    A heading that is more than ``heading_jump_deg`` from the last one, and further than ``heading_rate_max_deg_s``
    (twice the fastest commanded turn) goes in the time between, is rejected; where ``implausible_rejected`` of the last
    ``implausible_of`` readings were, and before one that insists for ``implausible_s`` is believed, the rover stops
    (fault 5: 45 degrees in 50 ms, 5 of 10). One that is the same to the last digit through ``frozen_s`` of commanded
    turns, faster than ``frozen_turn_deg_s``, is frozen (fault 4): a part with steps of 1 degree passes twenty of them.
    That counts while the rover is seen to move; one that stands may be held, so that pitch and roll must stay as well.
    A compass below the calibration that arming demands is doubted after ``uncalibrated_s``, and for as long after each
    reading that it has rejected then (fault 10).

    The rover runs away when, from ``runaway_after_s`` after the last command to move on, the ground goes by at
    ``runaway_from_m_s`` or more for ``runaway_for_s``: together the 0.5 s of fault 30. Until then it may coast, and for
    as long as it loses ``gain_m_s2`` or more of its speed, looked at over ``runaway_for_s``.

    Drives are watched over ``drive_window_s`` at most. The heading is to follow the commanded turn, which lags by
    ``drive_lag_s`` (as ``simhal.Physics``), but for ``drive_margin_deg`` and ``drive_margin_share`` of that turn: a
    dead side of the slowest shipped rover turns it by 51 degrees in that second, noise and unequal sides by 6 (one
    standard deviation). A window counts when no anomaly has followed within ``drive_confirm_s``: a trunk turns a rover
    as well, and then holds it. ``drive_uneven_windows`` to one side in ``drive_memory_s``, with no drive in between
    that turned as commanded, and no turn on the spot about the middle, are a fault (fault 27). A side that is reversed
    turns it twice as far as a dead one, so more than ``reversed_share`` and ``reversed_margin_deg``; where both
    are, or left and right are mixed up, a turn on the spot of ``reversed_turn_deg`` goes ``reversed_back_deg`` the
    other way, or the rover goes ``reversed_straight_m`` straight on (from no source). Either of them
    ``reversed_turns`` times is a fault (fault 28).

    Full duty on the spot that turns nothing for ``cannot_turn_s`` is a try; ``cannot_turn_tries`` in a row are told,
    and after ``cannot_turn_max`` the rover gives up, as after so many anomalies in the fault catalogue (fault 57).
    """

    immobilised_s: Seconds = 0.3
    immobilised_below: Fraction = 0.3
    immobilised_from_m_s: MetresPerSecond = 0.1
    nowhere_s: Seconds = 2.0
    gain_m_s2: Annotated[float, Interval(gt=0, le=20)] = 0.5
    tilt_deg: Degrees = 20.0
    tilt_s: SecondsOrZero = 0.2
    tipping_deg: Degrees = 45.0
    tipping_s: SecondsOrZero = 0.2
    overturned_deg: Degrees = 60.0
    overturned_s: SecondsOrZero = 0.1
    touch_s: SecondsOrZero = 0.0
    quality_min: Fraction = 0.2
    compass_stale_s: Seconds = 0.25
    compass_lost_s: Seconds = 5.0
    motion_stale_s: Seconds = 0.4
    contact_stale_s: Seconds = 0.5
    motion_unknown_s: Seconds = 0.9
    motion_lost_s: Seconds = 10.0
    heading_rate_max_deg_s: DegreesPerSecond = 360.0
    heading_jump_deg: Degrees = 45.0
    implausible_s: Seconds = 0.5
    implausible_rejected: Count = 5
    implausible_of: Count = 10
    frozen_s: Seconds = 1.0
    frozen_turn_deg_s: DegreesPerSecond = 20.0
    uncalibrated_s: Seconds = 0.9
    motion_speed_max_m_s: MetresPerSecond = 5.0
    runaway_after_s: Seconds = 0.3
    runaway_for_s: Seconds = 0.2
    runaway_from_m_s: MetresPerSecond = 0.1
    drive_window_s: Seconds = 1.0
    drive_from_m_s: MetresPerSecond = 0.1
    drive_lag_s: Seconds = 0.1
    drive_margin_deg: Degrees = 30.0
    drive_margin_share: Fraction = 0.5
    drive_confirm_s: SecondsOrZero = 1.0
    drive_memory_s: Seconds = 30.0
    drive_uneven_windows: Count = 3
    reversed_turn_deg: Degrees = 25.0
    reversed_back_deg: Degrees = 20.0
    reversed_share: Annotated[float, Interval(ge=1, le=2)] = 1.5
    reversed_margin_deg: Degrees = 5.0
    reversed_turns: Count = 2
    reversed_straight_m: Metres = 0.3
    cannot_turn_s: Seconds = 0.5
    cannot_turn_tries: Count = 3
    cannot_turn_max: Count = 12

    def __post_init__(self) -> None:
        if self.implausible_rejected > self.implausible_of:
            raise ValueError(
                f"implausible_rejected = {self.implausible_rejected} must not exceed"
                f" implausible_of = {self.implausible_of}"
            )
