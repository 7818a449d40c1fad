"""The light world's skid steering against MuJoCo, by duty steps: nothing in it was fitted to these numbers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians
from statistics import fmean

import pytest

from tests.simhal.clearing import STEADY, world_on_ground
from tests.simhal.mujoco.duty_steps import FRICTIONS, ROVERS, TABLE, DutyStep, all_steps, kept_steps, take
from wayfarer.config.rover_file import load_rover
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.physics import Terrain
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.simhal.world.skid_steering import SkidSteering
from wayfarer.simhal.world.wheeled_body import body_of
from wayfarer.simhal.world.world import World

CONFIGS = {rover: load_rover(rover) for rover in ROVERS}
# Speeds and rates are within a tenth, and what two hundredths of full duty would do: as tyres give way, turning begins
# a little sooner in MuJoCo.
SHARE, DUTY = 0.1, 0.02


@cache
def in_light_world(step: DutyStep) -> DutyStep:
    return take(world_on_ground(CONFIGS[step.rover], step.friction), *step[:4])


def full_duty(step: DutyStep) -> tuple[float, float]:
    """Speed, and turn rate in degrees per second, of full duty on ideal ground."""
    vehicle = CONFIGS[step.rover].vehicle
    return vehicle.max_speed_m_s, 2.0 * vehicle.max_speed_m_s / vehicle.track_m / radians(1.0)


def steps_of(rover: str, friction: float) -> list[DutyStep]:
    return [step for step in kept_steps() if step[:2] == (rover, friction)]


def slides_out(step: DutyStep) -> bool:
    """Whether it takes most of the friction to push the body round: how it slides then has a course of its own."""
    return abs(step.speed_m_s * radians(step.turn_deg_s)) > 0.7 * step.friction * STANDARD_GRAVITY_M_S2


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("rover", ROVERS)
def test_settles_to_the_speed_and_turn_rate_of_mujoco(rover: str, friction: float) -> None:
    for step in steps_of(rover, friction):
        light, (full_m_s, full_deg_s) = in_light_world(step), full_duty(step)
        within_deg_s = SHARE * abs(step.turn_deg_s) + DUTY * full_deg_s
        assert light.turn_deg_s == pytest.approx(step.turn_deg_s, abs=within_deg_s), step
        share = 2.0 * SHARE if slides_out(step) else SHARE
        within_m_s = share * abs(step.speed_m_s) + DUTY * full_m_s
        assert light.speed_m_s == pytest.approx(step.speed_m_s, abs=within_m_s), step


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("rover", ROVERS)
def test_starts_and_stops_as_in_mujoco(rover: str, friction: float) -> None:
    """Straight within a tenth; in curves sooner by up to 0.2 s, for the slide outwards takes time to come about."""
    for step in steps_of(rover, friction):
        light, (full_m_s, full_deg_s) = in_light_world(step), full_duty(step)
        sooner_s = 0.0 if step.left == step.right else 0.35 if slides_out(step) else 0.2
        for name in ("early", "stop"):
            came_m, came_deg = getattr(step, f"{name}_m"), getattr(step, f"{name}_deg")
            within_m = SHARE * abs(came_m) + DUTY * full_m_s + sooner_s * abs(step.speed_m_s)
            within_deg = SHARE * abs(came_deg) + DUTY * full_deg_s + sooner_s * abs(step.turn_deg_s)
            assert getattr(light, f"{name}_m") == pytest.approx(came_m, abs=within_m), (name, step)
            assert getattr(light, f"{name}_deg") == pytest.approx(came_deg, abs=within_deg), (name, step)


def test_most_settled_steps_agree_far_better_than_each_must() -> None:
    turning = [step for step in kept_steps() if abs(step.turn_deg_s) > 1.0]
    off = sorted(abs(in_light_world(step).turn_deg_s / step.turn_deg_s - 1.0) for step in turning)
    assert len(off) > 100
    assert off[len(off) // 2] < 0.04
    assert off[len(off) * 9 // 10] < 0.2


def test_ideal_ground_would_not_pass() -> None:
    """The dead zone is what ideal ground lacks."""
    step = next(s for s in kept_steps() if s[:4] == ("sim", 0.5, 0.42, 0.2))
    config = CONFIGS["sim"]
    ideal = take(World(CLEARING, config.vehicle, STEADY, RandomStreams(0)), *step[:4])
    assert step.turn_deg_s < 1.0
    assert ideal.turn_deg_s > 30.0


@pytest.mark.long
def test_table_is_what_mujoco_does() -> None:
    kept = kept_steps()
    assert len(kept) == len(ROVERS) * len(FRICTIONS) * 20, TABLE
    for again, step in zip(all_steps(), kept, strict=True):
        assert again[:2] == step[:2]
        assert again[2:] == pytest.approx(step[2:], rel=0.02, abs=0.3)


def rims_and_load(world: SimulatedWorld, duty: float) -> tuple[float, float]:
    """How fast the rims turn of a body that pushes at a trunk, and the load of its motors: means of a second."""
    world.command(duty, duty)
    world.advance_to(world.t_s + 6.0)
    before_m, loads = sum(world.rims_m), []
    for _ in range(20):
        world.advance_to(world.t_s + 0.05)
        loads.append(sum(world.motor_load) / 2)
    return (sum(world.rims_m) - before_m) / 2, fmean(loads)


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("duty", [0.3, 0.7])
def test_wheels_of_a_body_that_a_tree_holds_do_as_in_mujoco(friction: float, duty: float) -> None:
    config = CONFIGS["forestrover"]
    body = body_of("forestrover", config.vehicle, config.chassis, "a test")
    forest = replace(CLEARING, trees_m=((25.0, 14.0),))
    skid = SkidSteering(body, friction, config.vehicle.track_m, STEADY.step_s)
    light = World(forest, config.vehicle, STEADY, RandomStreams(0), skid=skid)
    light.wheeled = body
    rigid = MujocoWorld(forest, body, STEADY, Terrain(friction), RandomStreams(0))
    assert rims_and_load(light, duty) == pytest.approx(rims_and_load(rigid, duty), abs=0.1)
