"""Terrain of a trial in MuJoCo: friction, roughness, torque; fixed, or drawn for each trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wayfarer.simhal.drawn_ranges import Range, drawn, ranges_of
from wayfarer.simhal.random_streams import RandomStreams


class Terrain(NamedTuple):
    """The ground of one trial, and how strong its motors are.

    ``friction`` is that of a tyre on the ground and on bark: dry soil 0.5 to 0.8, leaf litter 0.3 to 0.5, mud 0.1 to
    0.2; no source measured these tyres. ``roughness_m`` is the standard deviation of the ground's height. The stall
    torque is ``torque_scale`` times the rover file's ``chassis.motors_n_m``: the paper's "11.5 kg cm" may be the stall
    torque (1) or the rated one, of which stall is about three times (3).
    """

    friction: float
    roughness_m: float
    torque_scale: float


class Terrains(NamedTuple):
    """The terrain of each trial of a campaign."""

    friction: Range = Range(0.5, 0.5)
    roughness_m: Range = Range(0.0, 0.0)
    torque_scale: Range = Range(1.0, 1.0)

    def draw(self, streams: RandomStreams) -> Terrain:
        """Return one trial's terrain."""
        return Terrain(*(drawn(streams, f"sim.{name}", bounds) for name, bounds in self._asdict().items()))

    def as_json(self) -> dict[str, list[float]]:
        """Return the bounds as JSON can hold them."""
        return {name: list(bounds) for name, bounds in self._asdict().items()}


# Beyond these bounds the model says nothing: a height field that no wheel of 5 cm can follow, a motor of no rover.
BOUNDS = Terrains(friction=Range(0.02, 2.0), roughness_m=Range(0.0, 0.1), torque_scale=Range(0.1, 20.0))


def terrains_of(bounds: Mapping[str, Sequence[float]]) -> Terrains:
    """Return what ``Terrains.as_json`` gave.

    Raises:
        ValueError: it did not give this; the text says which number is missing or out of bounds.
    """
    return Terrains(**ranges_of(bounds, BOUNDS._asdict()))
