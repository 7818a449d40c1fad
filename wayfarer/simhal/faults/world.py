"""Faults of the world: of the body and its surroundings."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from wayfarer.simhal.faults.kinds import Battery, DeadBand, Drive, Fault, MagneticAnomaly, MotorField, Shove, Slope
from wayfarer.simhal.world.simulated_world import NO_BODY_FAULTS, SimulatedWorld

RAMP_STEP_S = 0.1


def world_fault(fault: Fault, world: SimulatedWorld) -> AbstractContextManager[None]:
    """Return what makes a fault of this layer happen."""
    effect: AbstractContextManager[None] = _EFFECTS[fault.kind](world, fault.params)
    return effect


@contextmanager
def _slip(world: SimulatedWorld, _: object) -> Iterator[None]:
    world.slipping = True
    yield


@contextmanager
def _snag(world: SimulatedWorld, _: object) -> Iterator[None]:
    world.set_faults(snagged=True)
    yield
    world.set_faults(snagged=False)


@contextmanager
def _magnetic_anomaly(world: SimulatedWorld, params: MagneticAnomaly) -> Iterator[None]:
    loop, steps = asyncio.get_running_loop(), max(1, round(params.ramp_s / RAMP_STEP_S))
    step_deg, done_deg = params.bias_deg / steps, 0.0
    timer: Any = None

    def rise() -> None:
        nonlocal done_deg, timer
        world.field_deg += step_deg
        done_deg += step_deg
        if abs(done_deg) < abs(params.bias_deg) - abs(step_deg) / 2:
            timer = loop.call_later(RAMP_STEP_S, rise)

    rise()
    yield
    if timer is not None:
        timer.cancel()
    world.field_deg -= done_deg


@contextmanager
def _motor_field(world: SimulatedWorld, params: MotorField) -> Iterator[None]:
    """Bend the field by what the motors draw: looked at before each of the world's steps ends."""
    after_step, bent_deg = world.after_step, 0.0

    def bend(moved: SimulatedWorld) -> None:
        nonlocal bent_deg
        now_deg = params.bias_deg * (abs(world.commanded[0]) + abs(world.commanded[1])) / 2
        world.field_deg += now_deg - bent_deg
        bent_deg = now_deg
        after_step(moved)

    world.after_step = bend
    yield
    world.after_step = after_step
    world.field_deg -= bent_deg


@contextmanager
def _slope(world: SimulatedWorld, params: Slope) -> Iterator[None]:
    world.ground_pitch_deg += params.pitch_deg
    world.ground_roll_deg += params.roll_deg
    yield
    world.ground_pitch_deg -= params.pitch_deg
    world.ground_roll_deg -= params.roll_deg


@contextmanager
def _shove(world: SimulatedWorld, params: Shove) -> Iterator[None]:
    world.set_faults(shove_m_s=params.speed_m_s)
    yield
    world.set_faults(shove_m_s=NO_BODY_FAULTS.shove_m_s)


@contextmanager
def _drive(world: SimulatedWorld, params: Drive) -> Iterator[None]:
    world.set_faults(left_gain=params.left_gain, right_gain=params.right_gain)
    yield
    world.set_faults(left_gain=NO_BODY_FAULTS.left_gain, right_gain=NO_BODY_FAULTS.right_gain)


@contextmanager
def _dead_band(world: SimulatedWorld, params: DeadBand) -> Iterator[None]:
    world.set_faults(dead_band=params.duty)
    yield
    world.set_faults(dead_band=NO_BODY_FAULTS.dead_band)


@contextmanager
def _battery(world: SimulatedWorld, params: Battery) -> Iterator[None]:
    full_v = world.battery_v
    world.battery_v = params.volts
    yield
    world.battery_v = full_v


_EFFECTS: dict[str, Any] = {
    "slip": _slip,
    "snag": _snag,
    "magnetic_anomaly": _magnetic_anomaly,
    "motor_field": _motor_field,
    "slope": _slope,
    "shove": _shove,
    "drive": _drive,
    "dead_band": _dead_band,
    "battery": _battery,
}
