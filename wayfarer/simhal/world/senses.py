"""Parameters of the simulated senses: how they err, by default as in the paper's simulator, and in a wood."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Final

from annotated_types import Interval

from wayfarer.setting_ranges import (
    DegreesOrZero,
    DegreesPerSecondOrZero,
    Fraction,
    Gain,
    SecondsOrZero,
    SignedDegrees,
)


@dataclass(frozen=True, slots=True)
class Senses:
    """How compass and flow sensor err.

    ``compass_noise_deg`` is the noise on each reading (paper, as ``Physics``). From no source, chosen to be plain: tilt
    reads off by ``tilt_noise_deg``, as on rough ground; flow by a few counts and a share of the distance.
    ``compass_bias_deg``, clockwise, is how far the compass reads off through a whole trial.

    The rest is neutral, and ``FIELD`` has values for it. *Compass*, all errors with random phases for each trial:

    ``hard_iron_deg``: the most that iron that turns with the body bends the heading; one cycle a turn of the body.
    ``soft_iron_deg``: the same of iron that is magnetised by the earth; two cycles a turn.
    ``motor_field_deg``: the same as hard iron by the current of one side at full duty, and the other way round if the
    side turns backwards. Each side has its own phase, so turning on the spot differs from driving straight. The current
    is taken as in proportion to the duty, as in a motor that is held; one that spins draws less.
    ``compass_lag_s``: a reading is the attitude of that long ago, with a new time stamp; in whole readings, rounded up.
    ``compass_freezes_below_deg_s``: the heading does not move while the body turns more slowly than this, and goes on
    from there when it turns faster; what was missed stays missed.
    ``tilt_vibration_deg``: standard deviation of what shakes pitch and roll at full duty, in proportion to the duty.

    *Flow sensor*:

    ``flow_scale_sd``: standard deviation of the logarithm of a factor on each displacement, one a trial: the sensor is
    at another height above the ground than its driver believes.
    ``blind_share``: the share of the ground on which it sees nothing, in squares of ``blind_cell_m`` whose places
    depend on the trial, and not where the rover starts. It reports exact zeros there, with the quality
    ``blind_quality``. A camera shows black there.
    """

    compass_noise_deg: DegreesOrZero = 1.0
    compass_bias_deg: SignedDegrees = 0.0
    tilt_noise_deg: DegreesOrZero = 1.0
    flow_noise_counts: Gain = 2.0
    flow_noise_share: Fraction = 0.03
    hard_iron_deg: DegreesOrZero = 0.0
    soft_iron_deg: DegreesOrZero = 0.0
    motor_field_deg: DegreesOrZero = 0.0
    compass_lag_s: SecondsOrZero = 0.0
    compass_freezes_below_deg_s: DegreesPerSecondOrZero = 0.0
    tilt_vibration_deg: DegreesOrZero = 0.0
    flow_scale_sd: Fraction = 0.0
    blind_share: Fraction = 0.0
    blind_cell_m: Annotated[float, Interval(ge=0.1, le=100)] = 2.0
    blind_quality: Fraction = 0.0


# As in a wood. Each value has its source, or none:
FIELD: Final[Mapping[str, float]] = MappingProxyType(
    {
        # An offset of 10 % of the horizontal field bends by asin(0.1) = 5.7 degrees, a scale that is off by 10 % by
        # 2.7 (arithmetic); the values themselves are proposed, from no source.
        "hard_iron_deg": 8.0,
        "soft_iron_deg": 3.0,
        # ArduPilot's compassmot calls up to 30 % of the field fine; 5 % of it, all horizontal, are 7 degrees.
        "motor_field_deg": 8.0,
        "compass_lag_s": 0.5,  # proposed, from no source: no data sheet of a compass with fusion gives it
        "compass_freezes_below_deg_s": 3.0,  # a BNO055 without a magnetometer (BNO055_SensorAPI issue 12)
        "tilt_vibration_deg": 1.5,  # data sheet of the BNO080, page 48: the error of gravity in motion
        # PX4 took 385 counts a radian for a PMW3901 and later 500, so up to 15 % either way until it is calibrated.
        "flow_scale_sd": 0.15,
        "blind_share": 0.2,  # in shade or wet; proposed, from no source
        "blind_cell_m": 2.0,  # from no source
        # A SQUAL of 38: in the dark up to 60 was seen beside long zeros (PX4 issue 12894).
        "blind_quality": 0.4,
    }
)
