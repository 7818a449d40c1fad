"""Ground that slopes as a whole: the same everywhere."""

from __future__ import annotations

from math import asin, atan, cos, degrees, radians, sin, tan

from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics


class Hillside:
    """A plane that rises towards one bearing; headings and places are those in the plane."""

    def __init__(self, slope_deg: float, uphill_deg: float) -> None:
        self._uphill_rad = radians(uphill_deg)
        self._sin, self._tan = sin(radians(slope_deg)), tan(radians(slope_deg))

    def attitude_deg(self, heading_rad: float) -> tuple[float, float]:
        """Return pitch (nose up) and roll (right side down) of a body that stands on it with this heading."""
        off_rad = self._uphill_rad - heading_rad
        return degrees(asin(self._sin * cos(off_rad))), -degrees(atan(self._tan * sin(off_rad)))

    def rise(self, heading_rad: float) -> float:
        """Return by how many metres the ground rises a metre ahead: the share of the weight that pulls backwards."""
        return self._sin * cos(self._uphill_rad - heading_rad)


def hillside_of(physics: Physics, forest: Forest) -> Hillside | None:
    """Return the slope of a world, None if the ground is level; its direction counts from the forest's heading."""
    if not physics.slope_deg:
        return None
    return Hillside(physics.slope_deg, forest.heading_deg + physics.slope_direction_deg)
