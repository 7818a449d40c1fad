"""What chips are tested with: a clock to turn by hand, sensors that feel what a test says, a world for motor boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from tests.simhal.clearing import steady_world
from wayfarer.simhal.sensor_models import FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.simulated_world import SimulatedWorld

Chip = TypeVar("Chip")


class Clock:
    """Seconds, as a test sets them."""

    t_s = 100.0

    def __call__(self) -> float:
        return self.t_s


class Held(HeadingSensorModel):
    """Feels one heading, pitch and roll, in tenths of a degree; ``asked_s`` is when it was sampled."""

    def __init__(self, heading: int = 0, pitch: int = 0, roll: int = 0) -> None:
        self.attitude = heading, pitch, roll
        self.asked_s: list[float] = []

    def sample(self, t_s: float) -> tuple[int, int, int]:
        self.asked_s.append(t_s)
        return self.attitude


class Driven(FlowSensorModel):
    """Feels the given displacements, forward and right, and then none; ``asked_s`` is when it was sampled."""

    def __init__(self, *displacements: tuple[int, int]) -> None:
        self.displacements = list(displacements)
        self.asked_s: list[float] = []

    def sample(self, t_s: float) -> tuple[int, int]:
        self.asked_s.append(t_s)
        return self.displacements.pop(0) if self.displacements else (0, 0)


class BoardBench(Generic[Chip]):
    """A motor board that drives a rover in a clearing; ``now_s`` is the time."""

    def __init__(self, make: Callable[[SimulatedWorld, Callable[[], float]], Chip]) -> None:
        self.now_s = 0.0
        self.world = steady_world()
        self.chip = make(self.world, lambda: self.now_s)
