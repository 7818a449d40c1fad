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
    """Thresholds, each with its own unit; "fault" is a row of the fault catalogue.

    *Ages.* PX4 gives a compass 0.3 s, ArduPilot gives flow 0.5 s and a failed link 1.5 s. ``compass_stale_s``,
    ``motion_stale_s`` and ``motion_unknown_s`` (for 1 s) are less by one reading and one tick, so that the wheels stand
    in time. A motion sensor that answers but sees nothing is unknown after ``motion_unknown_s`` and lost
    after ``motion_lost_s``; one that is silent for ``motion_lost_s`` is gone (faults 15 and 22). Without sight a rover
    drives on, ``blind_stride_m`` ahead at a time: then it backs off and turns as if it were stuck, because it may be.
    At 1 m/s it pushes against what it did not see for 3 s, which is the bound of faults 29 and 58 for a held motor.

    *Tilt.* A tilt beyond ``tilt_deg`` counts after ``tilt_s`` (PX4's attitude trigger: 0.3 s). The released field code
    stops beyond 15 degrees of pitch; this limit is for both axes and both signs, with a margin for rough ground. It is
    counted from the ground (``detector.ground_slope``); half of it below ``tipping_deg``, a tilt counts on any ground.
    A body that climbs fast tips over within those 0.2 s. So a body that will reach ``tipping_deg`` within ``tipping_s``
    at its present rate counts as tilted at once. The shipped bodies tip at 51 degrees (closed form, docs/physics.md).
    ``tipping_s`` is a reading, a tick and the motors' lag (``simhal.world.physics.Physics``) together. A body that is
    tilted beyond ``overturned_deg`` for ``overturned_s`` has overturned; one reading with a flipped bit is shorter.

    *Stall.* ``gain_m_s2`` is how fast this body gains or loses speed on the most slippery ground that it meets: a
    friction of 0.05, half of that of mud; from no measurement. It limits what a body that starts, coasts or turns can
    do. The rover stands if it moved, over ``immobilised_s``, by less than the share ``immobilised_below`` of what was
    possible from its speed before. It gets nowhere if the same holds over ``nowhere_s``, which counts as at least
    ``immobilised_s`` (ArduPilot's crash check takes 2 s).

    *Compass.* A heading is rejected if it is more than ``heading_jump_deg`` from the last one, and more than
    ``heading_rate_max_deg_s`` (twice the fastest commanded turn) allows in the time between. The rover stops while
    ``implausible_rejected`` of the last ``implausible_of`` readings were rejected. If it rejected every reading for
    ``implausible_s`` because of such a jump, it believes the newest one, but stops first (fault 5: 45 degrees in 50 ms,
    5 of 10). A heading that stays the same to the last digit during ``frozen_s`` of commanded turns, faster than
    ``frozen_turn_deg_s``, is frozen (fault 4); a compass with steps of 1 degree passes twenty of them in that time.
    This counts while the rover is seen to move. A rover that stands may be held, so then pitch and roll must stay the
    same as well. A compass that is calibrated less than arming demands is reported after ``uncalibrated_s``. After
    that, each rejected reading makes it implausible for as long (fault 10).

    *Runaway.* The rover runs away if it moves at ``runaway_from_m_s`` or more for ``runaway_for_s``, counted from
    ``runaway_after_s`` after the last command to move: together the 0.5 s of fault 30. Before that it may coast. Later
    it may coast too, as long as it loses ``gain_m_s2`` or more of its speed, measured over ``runaway_for_s``.

    *Drive.* Drives are watched over windows of at most ``drive_window_s``. The heading must follow the commanded turn,
    which lags by ``drive_lag_s`` (as ``simhal.world.physics.Physics``), within ``drive_margin_deg`` plus
    ``drive_margin_share`` of that turn. In that second a dead side of the slowest shipped rover turns it by 51 degrees;
    noise and unequal sides turn it by 6 (one standard deviation). A window counts if no anomaly follows within
    ``drive_confirm_s``, because a trunk turns a rover as well, and then holds it. ``drive_uneven_windows`` to one side
    within ``drive_memory_s`` are a fault (fault 27), unless a window between them cleared the findings
    (see ``detector.drive_monitor``). A reversed side turns the rover twice as far as a dead one; it is reported beyond
    ``reversed_share`` of a dead side's turn plus ``reversed_margin_deg``. In a turn on the spot of
    ``reversed_turn_deg``, a rover whose sides are both reversed, or exchanged, turns ``reversed_back_deg`` the other
    way; a rover with one reversed side goes ``reversed_straight_m`` straight on (from no source). ``reversed_turns``
    such reports are a fault (fault 28).

    *Turning.* Full duty on the spot that hardly turns the rover for ``cannot_turn_s`` is a failed try.
    ``cannot_turn_tries`` in a row are reported. After ``cannot_turn_max`` the rover makes no progress, as after that
    number of anomalies in the fault catalogue (fault 57).
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
    blind_stride_m: Metres = 3.0
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
