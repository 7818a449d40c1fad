"""Errors of a flow sensor in the field: a false height above the ground, and ground on which it sees nothing."""

from __future__ import annotations

from math import ceil, exp
from typing import Final

from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import WORLD_SIZE_M
from wayfarer.simhal.world.senses import Senses
from wayfarer.simhal.world.simulated_world import SimulatedWorld

SQUAL_FULL: Final = 95  # what the driver of a PMW3901 takes as quality 1, by default
SQUAL_SEEN: Final = 76  # of ordinary ground


class BlindGround:
    """Where a flow sensor sees nothing: square cells that depend on the trial alone, so that a place stays blind.

    A larger share adds cells to those of a smaller one. Beyond the edges of the world the pattern repeats. The cell of
    the start is never blind: a rover that sees nothing is not armed.
    """

    def __init__(self, world: SimulatedWorld, streams: RandomStreams) -> None:
        senses = world.physics
        self._world = world
        self._cell_m = senses.blind_cell_m
        self._side = side = ceil(WORLD_SIZE_M / senses.blind_cell_m)
        drawn = streams.generator("flow.blind").random(side * side) < senses.blind_share
        self._cells = bytearray(drawn.tobytes())
        self._cells[self._cell_under()] = False
        self.squal = round(senses.blind_quality * SQUAL_FULL)  # as the sensor reports it there

    def is_under(self) -> bool:
        """Return whether the body stands on such a cell."""
        return bool(self._cells[self._cell_under()])

    def _cell_under(self) -> int:
        column, row = int(self._world.x_m // self._cell_m), int(self._world.y_m // self._cell_m)
        return row % self._side * self._side + column % self._side


def blind_ground(world: SimulatedWorld, streams: RandomStreams) -> BlindGround | None:
    """Return where the sensor sees nothing, None where it sees all of the ground."""
    return BlindGround(world, streams) if world.physics.blind_share else None


def flow_scale(senses: Senses, streams: RandomStreams) -> float:
    """Return this trial's factor on each displacement, which is above 0."""
    sd = senses.flow_scale_sd
    return exp(float(streams.generator("flow.scale").normal(0.0, sd))) if sd else 1.0
