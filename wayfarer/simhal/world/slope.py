"""Ground that slopes as a whole: the same everywhere, fixed or drawn for each trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import asin, atan, cos, degrees, radians, sin, tan
from typing import Final, NamedTuple

from wayfarer.simhal.drawn_ranges import Range, drawn, ranges_of
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics


class Slope(NamedTuple):
    """The slope of one trial, as ``Physics`` has it."""

    slope_deg: float
    slope_direction_deg: float


class Slopes(NamedTuple):
    """The slope of each trial of a campaign."""

    slope_deg: Range
    slope_direction_deg: Range = Range(0.0, 0.0)

    def draw(self, streams: RandomStreams) -> Slope:
        """Return one trial's slope."""
        return Slope(*(drawn(streams, f"sim.{name}", bounds) for name, bounds in self._asdict().items()))

    def as_json(self) -> dict[str, list[float]]:
        """Return the bounds as JSON can hold them."""
        return {name: list(bounds) for name, bounds in self._asdict().items()}


BOUNDS: Final = Slopes(Range(0.0, 45.0), Range(0.0, 360.0))  # as the fields of ``Physics``


def slopes_of(bounds: Mapping[str, Sequence[float]]) -> Slopes:
    """Return what ``Slopes.as_json`` gave.

    Raises:
        ValueError: it did not give this; the text says which number is missing or out of bounds.
    """
    return Slopes(**ranges_of(bounds, BOUNDS._asdict()))


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
