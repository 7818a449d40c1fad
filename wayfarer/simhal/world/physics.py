"""Parameters of the simulated world and its sensors, and of MuJoCo's ground; depth, physics and grounds by name."""

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
    """How compass and flow sensor err; all errors of the compass have random phases for each trial.

    Noise of the compass as in the paper (section IV-A), noise of tilt and flow chosen by us. The rest is neutral, and
    ``FIELD`` has values for it.
    """

    compass_noise_deg: DegreesOrZero = 1.0
    """Noise on each reading of the compass."""
    compass_bias_deg: SignedDegrees = 0.0
    """How far the compass reads off through a whole trial, clockwise."""
    tilt_noise_deg: DegreesOrZero = 1.0
    """Noise on pitch and roll, as on rough ground."""
    flow_noise_counts: Gain = 2.0
    """Noise on each displacement of the flow sensor, in counts."""
    flow_noise_share: Fraction = 0.03
    """Noise on each displacement, as a share of it."""
    hard_iron_deg: DegreesOrZero = 0.0
    """The most by which iron that turns with the body bends the heading; one cycle per turn of the body."""
    soft_iron_deg: DegreesOrZero = 0.0
    """The most by which iron that the earth magnetises bends the heading; two cycles per turn of the body."""
    motor_field_deg: DegreesOrZero = 0.0
    """The most by which the current of one side at full duty bends the heading: as hard iron, and the other way round
    if the side turns backwards. Each side has a separate phase, so turning on the spot differs from driving straight.
    The current is in proportion to the duty, as in a motor that is held; one that spins draws less."""
    compass_lag_s: SecondsOrZero = 0.0
    """A reading is the attitude of that long ago, with a new time stamp; in whole readings, rounded up."""
    compass_freezes_below_deg_s: DegreesPerSecondOrZero = 0.0
    """The heading does not move while the body turns more slowly than this, and goes on from there when it turns
    faster; what was missed stays missed."""
    tilt_vibration_deg: DegreesOrZero = 0.0
    """Standard deviation of what shakes pitch and roll at full duty, in proportion to the duty."""
    flow_scale_sd: Fraction = 0.0
    """Standard deviation of the logarithm of a factor on each displacement, one per trial: the flow sensor is at
    another height above the ground than its driver believes."""
    current_noise_share: Fraction = 0.0
    """Noise on the current of the motors of a side, as a share of it; not in MuJoCo."""
    current_scale_sd: Fraction = 0.0
    """Standard deviation of the logarithm of a factor on all currents, one per trial: the stall current is another than
    the rover file says; not in MuJoCo."""
    blind_share: Fraction = 0.0
    """Share of the ground on which the flow sensor sees nothing, and not where the rover starts. It reports exact zeros
    there; a camera shows black."""
    blind_cell_m: Annotated[float, Interval(ge=0.1, le=100)] = 2.0
    """Side of the squares of blind ground; their places depend on the trial."""
    blind_quality: Fraction = 0.0
    """Quality that the flow sensor reports on blind ground."""


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
        # PX4 took 385 counts per radian for a PMW3901 and later 500, so up to 15 % either way until it is calibrated.
        "flow_scale_sd": 0.15,
        "current_noise_share": 0.15,  # on rough ground; proposed by us
        # Copper has 20 % more resistance at 70 degrees than at 20, and a battery of 12.6 V when full has 10.5 V at the
        # end.
        "current_scale_sd": 0.1,
        "blind_share": 0.2,  # in shade or wet; proposed by us
        "blind_cell_m": 2.0,  # chosen by us
        # A SQUAL of 38: in the dark up to 60 was seen beside long zeros (PX4 issue 12894).
        "blind_quality": 0.4,
    }
)


@dataclass(frozen=True, slots=True)
class Physics(Senses):
    """The simulated world, and how sensors err. MuJoCo has sensors, slope, unequal sides, slips and tipping of it.

    Noise and slips are those of the paper and its released simulator (section IV-A; units as measured from the released
    code). The rest is chosen by us, to be plain.
    """

    step_s: Annotated[float, Interval(gt=0, le=0.1)] = 0.05
    """Step of the simulation."""
    motor_lag_s: Seconds = 0.1
    """First-order lag of the motors on ideal ground; on others it follows from the body."""
    side_gain_sd: Fraction = 0.02
    """Standard deviation of each side's gain from one rover to the next."""
    track_sd: Fraction = 0.05
    """Standard deviation of the effective track from one rover to the next."""
    steer_noise_rad: Fraction = 0.2
    """By how much the rover goes off its heading in each ``noise_per_m``, radians."""
    heading_noise_deg: DegreesOrZero = 1.0
    """By how much the rover's heading wanders in each ``noise_per_m``."""
    noise_per_m: Metres = 0.05
    """Length of a step of the noise of steering and heading: of the released simulator at cruise."""
    slip_free_m: MetresOrZero = 0.5
    """The least distance between two slips."""
    slip_mean_m: Metres = 10.0
    """Mean of the rest of that distance, which is distributed exponentially; in MuJoCo a straight way meets mud as
    often."""
    climb_deg_s: DegreesPerSecond = 40.0
    """How fast a rover rears up that pushes onto a trunk, at full duty."""
    settle_s: Seconds = 0.2
    """How fast a rover that reared up falls back: a time constant."""
    tip_deg: Degrees = 60.0
    """Angle from the ground at which it tips over."""
    slope_deg: Annotated[float, Interval(ge=0, le=45)] = 0.0
    """Slope of all the ground."""
    slope_direction_deg: Annotated[float, Interval(ge=0, le=360)] = 0.0
    """Where the ground rises to, clockwise from the way to the goal: 0 is a goal straight uphill, 90 ground that rises
    to the right of the way, 180 a goal straight downhill."""


PHYSICS = Physics()


def changed(physics: Physics) -> dict[str, Any]:
    """Return the parameters that are not as by default."""
    return {name: value for name, value in asdict(physics).items() if value != getattr(PHYSICS, name)}


class Depth(StrEnum):
    """The depth of the simulation: simulated parts, or simulated chips under the real drivers."""

    DEVICE = "device"
    BUS = "bus"


class PhysicsName(StrEnum):
    """How a body moves: by closed forms, or as a rigid body in MuJoCo."""

    light = "light"
    mujoco = "mujoco"


class GroundName(StrEnum):
    """What is under the wheels; on ``ideal`` the body goes and turns as commanded, as in the paper's simulator."""

    ideal = "ideal"
    leaf_litter = "leaf-litter"
    dry_soil = "dry-soil"
    mud = "mud"


# Friction of a tyre on the ground. Nobody measured these tyres. Dry soil: a tyre that slides on a dry earth road (Wong,
# Theory of Ground Vehicles). Mud and leaf litter: the middle of what is said of them, 0.1 to 0.2 and 0.3 to 0.5; Wong
# has 0.4 to 0.5 for a wet earth road, and no leaves.
FRICTIONS = {GroundName.leaf_litter: 0.4, GroundName.dry_soil: 0.65, GroundName.mud: 0.15}


@dataclass(frozen=True, slots=True)
class Terrain:
    """The ground of one trial in MuJoCo, and how strong its motors are.

    Beyond these bounds the model says nothing: a height field that no wheel of 5 cm can follow, a motor of no rover.
    """

    friction: Annotated[float, Interval(ge=0.02, le=2)] = 0.5
    """Friction of a tyre on the ground and on bark: dry soil 0.5 to 0.8, leaf litter 0.3 to 0.5, mud 0.1 to 0.2; no
    source measured these tyres."""
    roughness_m: Annotated[float, Interval(ge=0, le=0.1)] = 0.0
    """Standard deviation of the ground's height; slower above 0."""
    torque_scale: Annotated[float, Interval(ge=0.1, le=20)] = 1.0
    """Stall torque divided by the rover file's ``chassis.motors_n_m``: the paper's "11.5 kg cm" may be the stall torque
    (1) or the rated one, of which stall is about three times (3)."""
