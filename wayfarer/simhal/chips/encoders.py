"""Simulated quadrature encoders at simulated pins, which follow the simulated world's wheels edge by edge."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from wayfarer.simhal.pins import FakePin
from wayfarer.simhal.world.simulated_world import SimulatedWorld

_LEVELS: Final = ((0, 0), (1, 0), (1, 1), (0, 1))  # of A and B, a quarter of a cycle each: A leads


class QuadratureEncoders:
    """The encoders of both sides; ``follow`` brings the wires up to date.

    Args:
        world: whose rims turn.
        wires: the pins of channels A and B, of the left and of the right encoder.
        m_per_count: the way of a rim for an edge.
        signs: -1 for a side whose B leads while its wheels turn ahead.
        active_low: the outputs are open collectors at pins that are pulled up.
    """

    def __init__(
        self,
        world: SimulatedWorld,
        wires: Sequence[tuple[FakePin, FakePin]],
        m_per_count: float,
        signs: Sequence[int],
        *,
        active_low: bool,
    ) -> None:
        self._world, self._wires, self._m_per_count, self._signs = world, wires, m_per_count, signs
        self._active_low = active_low
        self._counts = [0, 0]
        for side in (0, 1):
            self._show(side)

    def follow(self) -> None:
        """Turn as far as the rims have."""
        for side, (rim_m, sign) in enumerate(zip(self._world.rims_m, self._signs, strict=True)):
            count = sign * round(rim_m / self._m_per_count)
            while self._counts[side] != count:
                self._counts[side] += 1 if count > self._counts[side] else -1
                self._show(side)

    def _show(self, side: int) -> None:
        for wire, is_on in zip(self._wires[side], _LEVELS[self._counts[side] % 4], strict=True):
            wire.level = float(is_on != self._active_low)
