"""Faults of the world: of the body and its surroundings."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from random import Random
from typing import Annotated, Any, ClassVar

from annotated_types import Interval

from wayfarer.setting_ranges import Fraction, SignedDegrees
from wayfarer.simhal.faults.fault_kind import FaultKind, added, changed
from wayfarer.simhal.world.simulated_world import NO_BODY_FAULTS, SimulatedWorld

DriveGain = Annotated[float, Interval(ge=-1, le=2)]
RAMP_STEP_S = 0.1


class WorldFault(FaultKind):
    """Happens to the simulated body, or around it."""

    targets = ("world",)


@contextmanager
def _body(world: SimulatedWorld, **faults: float | bool) -> Iterator[None]:
    world.set_faults(**faults)
    yield
    world.set_faults(**{name: getattr(NO_BODY_FAULTS, name) for name in faults})


class Slip(WorldFault):
    """The wheels lose their grip until they pull back."""

    @contextmanager
    def effect(self, world: SimulatedWorld, _: Random) -> Iterator[None]:
        """Begin a slip; it ends as every slip does, not with the fault."""
        world.lose_grip()
        yield


class Snag(WorldFault):
    """Something holds the body."""

    def effect(self, world: SimulatedWorld, _: Random) -> AbstractContextManager[None]:
        return _body(world, snagged=True)


@dataclass(frozen=True)
class MagneticAnomaly(WorldFault):
    """Iron nearby bends the magnetic field: the heading is off by ``bias_deg``, reached evenly over ``ramp_s``."""

    bias_deg: SignedDegrees = 20.0
    ramp_s: Annotated[float, Interval(ge=0, le=3600)] = 0.0

    @contextmanager
    def effect(self, world: SimulatedWorld, _: Random) -> Iterator[None]:
        loop, steps = asyncio.get_running_loop(), max(1, round(self.ramp_s / RAMP_STEP_S))
        step_deg, done_deg = self.bias_deg / steps, 0.0
        timer: Any = None

        def rise() -> None:
            nonlocal done_deg, timer
            world.field_deg += step_deg
            done_deg += step_deg
            if abs(done_deg) < abs(self.bias_deg) - abs(step_deg) / 2:
                timer = loop.call_later(RAMP_STEP_S, rise)

        rise()
        yield
        if timer is not None:
            timer.cancel()
        world.field_deg -= done_deg


@dataclass(frozen=True)
class Slope(WorldFault):
    """The ground tilts the body, nose up and right side down positive; 180 is upside down."""

    typical: ClassVar[Mapping[str, float]] = {"pitch_deg": 25.0}  # more than a rover drives up: it backs off
    pitch_deg: SignedDegrees = 0.0
    roll_deg: SignedDegrees = 0.0

    def effect(self, world: SimulatedWorld, _: Random) -> AbstractContextManager[None]:
        return added(world, ground_pitch_deg=self.pitch_deg, ground_roll_deg=self.roll_deg)


@dataclass(frozen=True)
class Shove(WorldFault):
    """An outside force moves the body ahead at ``speed_m_s``, independent of its wheels."""

    speed_m_s: Annotated[float, Interval(ge=-2, le=2)] = 0.5

    def effect(self, world: SimulatedWorld, _: Random) -> AbstractContextManager[None]:
        return _body(world, shove_m_s=self.speed_m_s)


@dataclass(frozen=True)
class Drive(WorldFault):
    """The sides turn ``left_gain`` and ``right_gain`` times as fast as commanded: 0 dead, -1 wired the wrong way."""

    typical: ClassVar[Mapping[str, float]] = {"left_gain": 0.0}
    left_gain: DriveGain = 1.0
    right_gain: DriveGain = 1.0

    def effect(self, world: SimulatedWorld, _: Random) -> AbstractContextManager[None]:
        return _body(world, left_gain=self.left_gain, right_gain=self.right_gain)


@dataclass(frozen=True)
class DeadBand(WorldFault):
    """The motors do not turn below a duty."""

    duty: Fraction = 0.2

    def effect(self, world: SimulatedWorld, _: Random) -> AbstractContextManager[None]:
        return _body(world, dead_band=self.duty)


@dataclass(frozen=True)
class Battery(WorldFault):
    """The battery is at ``volts``."""

    volts: Annotated[float, Interval(ge=0, le=36)] = 9.5

    def effect(self, world: SimulatedWorld, _: Random) -> AbstractContextManager[None]:
        return changed(world, battery_v=self.volts)
