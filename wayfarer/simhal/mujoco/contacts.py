"""Contacts of the rover, from the engine; geoms are in the order of ``model.build``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wayfarer.simhal.world.collision import Obstacle

WHEELS_TO_DRIVE = 3  # with fewer on anything, a rover whose belly is on something does not get away; from no source


class Contacts:
    """The rover's contacts with the ground and with ``obstacles``, the first ``felt`` of which a bumper feels."""

    def __init__(self, data: Any, obstacles: Sequence[Obstacle], felt: int) -> None:
        self._data = data
        self._obstacles = obstacles
        self._felt = felt
        self.belly = 1 + len(obstacles)

    def with_obstacles(self) -> bool:
        """Tell whether belly or wheels touch any obstacle, felt or not."""
        return any(0 < geom < self.belly for pair in self._data.contact.geom.tolist() for geom in pair)

    def feel(self) -> tuple[Obstacle | None, bool]:
        """Return what a bumper feels, and whether the body lies on its belly with too few wheels to drive off."""
        touched, on_belly, wheels = None, False, set()
        for pair in self._data.contact.geom.tolist():
            other, own = min(pair), max(pair)
            if own == self.belly:
                on_belly = True
            else:
                wheels.add(own)
            if 0 < other <= self._felt and touched is None:
                touched = self._obstacles[other - 1]
        return touched, on_belly and len(wheels) < WHEELS_TO_DRIVE
