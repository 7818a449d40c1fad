"""Worlds in a clearing that have no noise and no slips."""

from __future__ import annotations

from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.settings import Vehicle
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING, Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.skid_steering import SkidSteering
from wayfarer.simhal.world.wheeled_body import body_of
from wayfarer.simhal.world.world import World

STEADY = Physics(steer_noise_rad=0.0, heading_noise_deg=0.0, side_gain_sd=0.0, track_sd=0.0, slip_mean_m=1e9)
VEHICLE = Vehicle(0.4, 0.4, 0.5, 1.4)


def steady_world(forest: Forest = CLEARING, seed: int = 0) -> World:
    return World(forest, VEHICLE, STEADY, RandomStreams(seed))


def world_on_ground(config: RoverConfig, friction: float) -> World:
    """Physics-light with the grip of a ground."""
    body = body_of(config.name, config.vehicle, config.chassis, "a test")
    skid = SkidSteering(body, friction, config.vehicle.track_m, STEADY.step_s)
    return World(CLEARING, config.vehicle, STEADY, RandomStreams(0), skid=skid)
