"""Faults of the world: of the body and its surroundings."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from random import Random
from typing import Any

from wayfarer.simhal.faults.kinds import MagneticAnomaly, MotorField
from wayfarer.simhal.faults.scoped import Effect, added, changed
from wayfarer.simhal.world.simulated_world import NO_BODY_FAULTS, SimulatedWorld

RAMP_STEP_S = 0.1


@contextmanager
def _slip(world: SimulatedWorld, _: object, __: Random) -> Iterator[None]:
    world.slipping = True
    yield


@contextmanager
def _body(world: SimulatedWorld, **faults: float | bool) -> Iterator[None]:
    world.set_faults(**faults)
    yield
    world.set_faults(**{name: getattr(NO_BODY_FAULTS, name) for name in faults})


@contextmanager
def _magnetic_anomaly(world: SimulatedWorld, params: MagneticAnomaly, _: Random) -> Iterator[None]:
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
def _motor_field(world: SimulatedWorld, params: MotorField, _: Random) -> Iterator[None]:
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


EFFECTS: Mapping[str, Effect] = {
    "slip": _slip,
    "snag": lambda world, _, __: _body(world, snagged=True),
    "magnetic_anomaly": _magnetic_anomaly,
    "motor_field": _motor_field,
    "slope": lambda world, its, _: added(world, ground_pitch_deg=its.pitch_deg, ground_roll_deg=its.roll_deg),
    "shove": lambda world, its, _: _body(world, shove_m_s=its.speed_m_s),
    "drive": lambda world, its, _: _body(world, left_gain=its.left_gain, right_gain=its.right_gain),
    "dead_band": lambda world, its, _: _body(world, dead_band=its.duty),
    "battery": lambda world, its, _: changed(world, battery_v=its.volts),
}
