"""Parameters of the simulated world and its senses, and the named grounds of physics-light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Annotated, Any, Final

from annotated_types import Interval

from wayfarer.setting_ranges import (
    Degrees,
    DegreesOrZero,
    DegreesPerSecond,
    DegreesPerSecondOrZero,
    Fraction,
    Gain,
    Metres,
    MetresOrZero,
    Seconds,
    SecondsOrZero,
    SignedDegrees,
)


@dataclass(frozen=True, slots=True)
class Senses:
    """How compass and flow sensor err.

    ``compass_noise_deg`` is the noise on each reading (paper, as ``Physics``). Chosen by us, to be plain: tilt
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
        # 2.7 (arithmetic); the values themselves are proposed by us.
        "hard_iron_deg": 8.0,
        "soft_iron_deg": 3.0,
        # ArduPilot's compassmot calls up to 30 % of the field fine; 5 % of it, all horizontal, are 7 degrees.
        "motor_field_deg": 8.0,
        "compass_lag_s": 0.5,  # proposed by us: no data sheet of a compass with fusion gives it
        "compass_freezes_below_deg_s": 3.0,  # a BNO055 without a magnetometer (BNO055_SensorAPI issue 12)
        "tilt_vibration_deg": 1.5,  # data sheet of the BNO080, page 48: the error of gravity in motion
        # PX4 took 385 counts a radian for a PMW3901 and later 500, so up to 15 % either way until it is calibrated.
        "flow_scale_sd": 0.15,
        "blind_share": 0.2,  # in shade or wet; proposed by us
        "blind_cell_m": 2.0,  # chosen by us
        # A SQUAL of 38: in the dark up to 60 was seen beside long zeros (PX4 issue 12894).
        "blind_quality": 0.4,
    }
)


@dataclass(frozen=True, slots=True)
class Physics(Senses):
    """Parameters of physics-light: slip, noise, lag, contact; and those of the senses.

    From the paper and its released simulator (section IV-A; units as measured from the released code): the rover goes
    off its heading by ``steer_noise_rad`` in each step (0.05 m at cruise), its heading wanders by
    ``heading_noise_deg`` in each 0.05 m, and it slips 0.5 m plus an exponentially distributed distance
    (``slip_mean_m``) after the last slip.

    Chosen by us, to be plain: first-order motor lag (on ideal ground; others follow from the body); gain of
    each side and effective track off by a few per cent from one rover to the next; a rover that pushes onto a trunk
    rears up at ``climb_deg_s`` for full duty, falls back with ``settle_s``, and tips over beyond ``tip_deg`` from the
    ground.

    All of the ground slopes by ``slope_deg``. It rises towards ``slope_direction_deg``, clockwise from the forest's
    heading: 0 is a goal straight uphill, 90 ground that rises to the right of the way to the goal, 180 a goal straight
    downhill, 270 ground that rises to the left.
    """

    step_s: Annotated[float, Interval(gt=0, le=0.1)] = 0.05
    motor_lag_s: Seconds = 0.1
    side_gain_sd: Fraction = 0.02
    track_sd: Fraction = 0.05
    steer_noise_rad: Fraction = 0.2
    heading_noise_deg: DegreesOrZero = 1.0
    noise_per_m: Metres = 0.05
    slip_free_m: MetresOrZero = 0.5
    slip_mean_m: Metres = 10.0
    climb_deg_s: DegreesPerSecond = 40.0
    settle_s: Seconds = 0.2
    tip_deg: Degrees = 60.0
    slope_deg: Annotated[float, Interval(ge=0, le=45)] = 0.0
    slope_direction_deg: Annotated[float, Interval(ge=0, le=360)] = 0.0


PHYSICS = Physics()


def changed(physics: Physics) -> dict[str, Any]:
    """Return the parameters that are not as by default."""
    return {name: value for name, value in asdict(physics).items() if value != getattr(PHYSICS, name)}


class GroundName(StrEnum):
    """What the wheels stand on; on ``ideal`` the body goes and turns as commanded, as in the paper's simulator."""

    ideal = "ideal"
    leaf_litter = "leaf-litter"
    dry_soil = "dry-soil"
    mud = "mud"


# Friction of a tyre on the ground. Nobody measured these tyres. Dry soil: a tyre that slides on a dry earth road (Wong,
# Theory of Ground Vehicles). Mud and leaf litter: the middle of what is said of them, 0.1 to 0.2 and 0.3 to 0.5; Wong
# has 0.4 to 0.5 for a wet earth road, and no leaves.
FRICTIONS = {GroundName.leaf_litter: 0.4, GroundName.dry_soil: 0.65, GroundName.mud: 0.15}
