"""Parameters of the simulated world, and the named grounds of physics-light."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Annotated, Any

from annotated_types import Interval

from wayfarer.setting_ranges import Degrees, DegreesOrZero, DegreesPerSecond, Fraction, Metres, MetresOrZero, Seconds
from wayfarer.simhal.world.senses import Senses


@dataclass(frozen=True, slots=True)
class Physics(Senses):
    """Parameters of physics-light: slip, noise, lag, contact; and those of the senses.

    From the paper and its released simulator (section IV-A; units as measured from the released code): the rover goes
    off its heading by ``steer_noise_rad`` in each step (0.05 m at cruise), its heading wanders by
    ``heading_noise_deg`` in each 0.05 m, and it slips 0.5 m plus an exponentially distributed distance
    (``slip_mean_m``) after the last slip.

    From no source, chosen to be plain: first-order motor lag (on ideal ground; others follow from the body); gain of
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
