"""Turns and arcs of the escape handler on free ground in MuJoCo, measured by where the body really is.

``python -m tests.simhal.mujoco.manoeuvring`` prints them for all rovers, grounds and motors (half a minute).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import degrees, radians
from random import Random
from typing import NamedTuple

from tests.simhal.clearing import CLEARING
from tests.simhal.mujoco.fields import EXACT
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.detector.odometer import Odometer
from wayfarer.escape.api import Anomaly, Observation, Phase
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, MotionReading
from wayfarer.safety.gate import Gate
from wayfarer.safety.interval import Interval, IntervalTimer
from wayfarer.simhal.mujoco.terrain import Terrain
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.wheeled_body import body_of

COMPASS_NOISE_DEG = 1.0
MEETS_EVERY_S = 12.0
# The probe's heading is the mean of the last part of its straight, its radius that of the later part of its curve.
STRAIGHT_FROM, CURVE_FROM = 0.75, 0.3


class Manoeuvres(NamedTuple):
    """What a rover did after each anomaly: how far it turned away, and the radius of its curve over that asked."""

    turned_deg: list[float]
    radii: list[float]
    ends: set[str]
    dead_zone: float


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
    places, dead_zone = _drive(config, friction, torque_scale, episodes)
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
    return Manoeuvres(turned_deg, radii, ends, dead_zone)


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


def _drive(config: RoverConfig, friction: float, torque_scale: float, episodes: int) -> tuple[list[Place], float]:
    """Return each tick's place, and the dead zone that was learnt."""
    places: list[Place] = []
    body = body_of(config.name, config.vehicle, config.chassis, "a test")
    world = MujocoWorld(CLEARING, body, EXACT, Terrain(friction, 0.0, torque_scale), RandomStreams(0))
    handler = CATALOGUE["pledge"].make(config.escape, config.vehicle, Random(1))
    gate, odometer, noise = Gate(config.safety, config.control_hz), Odometer(0.0), Random(1)
    timer = IntervalTimer(config.safety.tick_late_s, config.vehicle.max_speed_m_s)
    wheels, travelled_m, seen_m, phase, meets_s = STOP, 0.0, 0.0, Phase.FOLLOW, 2.0
    for tick in range(1, round((2.0 + episodes * MEETS_EVERY_S) * config.control_hz)):
        t_s = tick / config.control_hz
        world.advance_to(t_s)
        interval = Interval(t_s, wheels)
        timer.measure(interval)
        travelled_m += abs(interval.forward_m)
        gone_m = world.forward_m - world.reverse_m
        speaks = tick % 2 == 0
        odometer.update(interval, MotionReading(t_s, gone_m - seen_m, 0.0, 1.0) if speaks else None)
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
        wheels, phase = gate.limit(decision.wheels, armed=True), decision.phase
        world.command(*wheels)
        places.append(Place(phase, decision.why, world.path_m, heading_deg))
    return places, float(handler.memory()["turn_from_duty"])


def main() -> None:
    """Print a line for each rover, motors and ground."""
    for rover in ("sim", "forestrover", "minirover"):
        for torque_scale in (1.0, 3.0):
            for friction in (0.1, 0.15, 0.3, 0.5, 0.8):
                turns = manoeuvres(rover, friction, torque_scale)
                arcs = manoeuvres(rover, friction, torque_scale, turn_deg=90.0)
                if not turns.turned_deg or not arcs.radii:
                    print(f"{rover:12} {torque_scale:g} x, mu {friction:4}: {', '.join(sorted(turns.ends))}")
                    continue
                turned = sum(turns.turned_deg) / len(turns.turned_deg)
                radius = sum(arcs.radii) / len(arcs.radii)
                print(
                    f"{rover:12} {torque_scale:g} x, mu {friction:4}: 30 degrees were {turned:.1f},"
                    f" the radius {radius:.2f} of the one asked, dead zone {turns.dead_zone:.2f}"
                )


if __name__ == "__main__":
    main()
