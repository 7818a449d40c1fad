"""Terrain of a trial in MuJoCo: friction, roughness, torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval


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
