"""What the simulated motor boards have in common: two outputs that turn the world's wheels, and a deadman."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from mypy_extensions import mypyc_attr

from wayfarer.simhal.world.simulated_world import SimulatedWorld


@mypyc_attr(allow_interpreted_subclasses=True)
class MotorBoardChip(ABC):
    """A board whose outputs have levels, negative for back; its deadman stops both at ``stops_by_s``.

    Args:
        world: whose wheels turn: at level / ``full_level`` from the world's next step on.
        clock: seconds on the clock of the world.
        full_level: the level at which the world's motors run at their full duty.
        left_is_second: the left wheels are on the second output, the right ones on the first.
        reverse_left: whether the left motors turn backwards when told to go forward.
        reverse_right: the same of the right ones.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], full_level: float, *,
        left_is_second: bool, reverse_left: bool, reverse_right: bool,
    ) -> None:  # fmt: skip
        self.levels: tuple[float, float] = (0, 0)
        self._world = world
        self._clock = clock
        self._full_level = full_level
        self._left, self._right = (1, 0) if left_is_second else (0, 1)
        self._reverse_left, self._reverse_right = reverse_left, reverse_right

    @property
    @abstractmethod
    def stops_by_s(self) -> float:
        """When the deadman stops the motors unless a command comes before; infinite while it is off."""

    def tick(self) -> None:
        """Let the deadman trip, at its own time, if that has come. Every access does this first."""
        if self.levels != (0, 0):
            trips_at_s = self.stops_by_s
            if self._clock() >= trips_at_s:
                self._stop(trips_at_s)

    def _stop(self, t_s: float) -> None:
        self._turn(t_s, (0, 0))

    def _turn(self, t_s: float, levels: tuple[float, float]) -> None:
        """Turn the wheels at the levels of both outputs from a time on."""
        self.levels = levels
        self._world.advance_to(t_s)
        left, right = levels[self._left] / self._full_level, levels[self._right] / self._full_level
        # Subtracted from 0, because -0.0 is written otherwise than 0.0.
        self._world.command(0.0 - left if self._reverse_left else left, 0.0 - right if self._reverse_right else right)
