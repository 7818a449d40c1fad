"""Chassis data of a rover file that no decision needs: how the body meets a branch, how its wheels grip.

Only the simulator reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from wayfarer.setting_ranges import Metres

Kilograms = Annotated[float, Interval(gt=0, le=1000)]
NewtonMetres = Annotated[float, Interval(gt=0, le=1000)]

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class Chassis:
    """Weight, motors and belly of a rover, for the simulator; None if its file does not say."""

    ground_clearance_m: Metres | None = None
    """Height of the belly: a branch that is no thicker passes under it. For ``--site``."""
    weight_kg: Kilograms | None = None
    """Mass of the rover with its batteries."""
    motors_n_m: NewtonMetres | None = None
    """Torque of all motors together."""
    wheel_radius_m: Metres | None = None
    """Radius of a wheel. For ``--ground`` and ``--physics mujoco``."""
    height_m: Metres | None = None
    """From the ground to the top of the body. For ``--ground`` and ``--physics mujoco``."""

    def missing(self, asked: Sequence[str]) -> tuple[str, ...]:
        """Return which of the keys that are asked for the file does not give."""
        return tuple(key for key in asked if getattr(self, key) is None)


CLIMBING_KEYS = ("ground_clearance_m", "weight_kg", "motors_n_m")  # what climbing a branch, as at a site, needs
WHEEL_KEYS = ("weight_kg", "motors_n_m", "wheel_radius_m", "height_m")  # what a simulated body with wheels needs
