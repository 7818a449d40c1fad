"""Turns and arcs of the escape handler on free ground in MuJoCo, measured by where the body really is."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import degrees, radians
from random import Random
from typing import NamedTuple

from tests.simhal.mujoco.fields import on_free_ground
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.detector.motion import MotionMonitor
from wayfarer.escape.api import Anomaly, Observation, Phase
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, MotionReading
from wayfarer.safety.gate import Gate
from wayfarer.safety.tick_interval import IntervalTimer, TickInterval

COMPASS_NOISE_DEG = 1.0
MEETS_EVERY_S = 12.0
# The probe's heading is the mean of the last part of its straight, its radius that of the later part of its curve.
STRAIGHT_FROM, CURVE_FROM = 0.75, 0.3


class Manoeuvres(NamedTuple):
    """What a rover did after each anomaly: how far it turned away, and the radius of its curve over that asked."""

    turned_deg: list[float]
    radii: list[float]
    ends: set[str]


class Place(NamedTuple):
    """Where the body is at a tick, and what it was told there."""

    phase: Phase
    why: str
    path_m: float
    heading_deg: float


def manoeuvres(
    rover: str, friction: float, torque_scale: float, *, episodes: int = 4, turn_deg: float = 30.0
) -> Manoeuvres:
    """Let a rover meet nothing but anomalies, on free ground."""
    config = load_rover(rover)
    config = config.model_copy(update={"escape": replace(config.escape, turn_angle_deg=turn_deg)})
    turned_deg: list[float] = []
    radii: list[float] = []
    ends: set[str] = set()
    places = _drive(config, friction, torque_scale, episodes)
    probe: list[Place] = []
    from_deg = 0.0
    for before, now in pairwise(places):
        if now.phase is Phase.TURN_AWAY is not before.phase:
            from_deg = now.heading_deg
        elif now.phase is not before.phase is Phase.TURN_AWAY:
            ends.add(now.why)
        if now.phase is Phase.PROBE:
            probe.append(now)
        elif probe:
            _judge(probe, config, from_deg, turned_deg, radii)
            probe = []
    return Manoeuvres(turned_deg, radii, ends)


def _judge(
    probe: list[Place], config: RoverConfig, from_deg: float, turned_deg: list[float], radii: list[float]
) -> None:
    straight_m, radius_m = config.escape.probe_straight_m, config.escape.probe_radius_m
    along = [(place.path_m - probe[0].path_m, place.heading_deg) for place in probe]
    straight = [heading for way_m, heading in along if STRAIGHT_FROM * straight_m <= way_m <= straight_m]
    curve = [place for place in along if place[0] >= straight_m + CURVE_FROM * radius_m]
    if straight:
        turned_deg.append(sum(straight) / len(straight) - from_deg)
    if len(curve) > 1 and curve[0][1] - curve[-1][1] > 20.0:
        radii.append((curve[-1][0] - curve[0][0]) / radians(curve[0][1] - curve[-1][1]) / radius_m)


def _drive(config: RoverConfig, friction: float, torque_scale: float, episodes: int) -> list[Place]:
    """Return the place of each tick."""
    places: list[Place] = []
    world = on_free_ground(config, friction, torque_scale)
    handler = CATALOGUE["pledge"].make(config.escape, config.vehicle, Random(1))
    motion = MotionMonitor(config.detector, config.vehicle, watched=True)
    gate, odometer, noise = Gate(config.safety, config.control_hz), motion.odometer, Random(1)
    timer = IntervalTimer(config.safety.tick_late_s, config.vehicle.max_speed_m_s)
    wheels, travelled_m, seen_m, phase, meets_s = STOP, 0.0, 0.0, Phase.FOLLOW, 2.0
    for tick in range(1, round((2.0 + episodes * MEETS_EVERY_S) * config.control_hz)):
        t_s = tick / config.control_hz
        world.advance_to(t_s)
        interval = TickInterval(t_s, wheels)
        timer.measure(interval)
        travelled_m += abs(interval.forward_m)
        gone_m = world.forward_m - world.reverse_m
        speaks = tick % 2 == 0
        motion.update(interval, 0.0, MotionReading(t_s, gone_m - seen_m, 0.0, 1.0) if speaks else None, [])
        seen_m = gone_m if speaks else seen_m
        meets = t_s >= meets_s and phase is Phase.FOLLOW
        meets_s += MEETS_EVERY_S * meets
        heading_deg = degrees(world.heading_rad)
        anomalies = (Anomaly.IMMOBILISED,) if meets else ()
        decision = handler.decide(
            Observation(
                t_s, (heading_deg + noise.gauss(0.0, COMPASS_NOISE_DEG)) % 360.0, 0.0, 0.0, anomalies, None, 0.0,
                travelled_m, odometer.covered_m,
            )
        )  # fmt: skip
        gate.judge((), armed=True)
        wheels = gate.limit(decision.wheels)
        phase = decision.phase
        world.command(*wheels)
        places.append(Place(phase, decision.why, world.path_m, heading_deg))
    return places
