"""Setup of a trial: a simulated rover in one forest under the daemon's own supervisor."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING

from wayfarer.config.own_file import OwnFile, as_used, check_same
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import Supervisor
from wayfarer.experiments.outcome import InterventionCounter, OutcomeMonitor
from wayfarer.hal import Rover
from wayfarer.simhal.build_rover import build
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import FRICTIONS, PHYSICS, Depth, GroundName, Physics
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.simhal.world.skid_steering import SkidSteering
from wayfarer.simhal.world.wheeled_body import body_of
from wayfarer.simhal.world.world import World

if TYPE_CHECKING:
    from wayfarer.simhal.faults.kinds import Fault
    from wayfarer.simhal.world.physics import Terrain
    from wayfarer.simhal.world.sites import FieldSite

MakeLog = Callable[[SimulatedWorld, Rover], RunLog]


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """Everything that decides a trial: the same spec gives the same result, on any worker.

    ``sensor_noise`` multiplies the noise of compass, tilt and flow. At a ``site`` a person walks beside the rover, and
    its time is limited. With a ``terrain`` the body moves in MuJoCo and not in physics-light; of ``physics`` then count
    the noise of the sensors, the slope, unequal sides, slips (as mud) and tipping. ``ground`` is what physics-light has
    under the wheels. ``drawn`` are the keys that this trial drew, whose values are in the other fields, for its row.
    ``files`` are the files that algorithm and drivers are in, if they are somebody's own, by their names here.
    At a site, and with ``go_on``, the trial of a rover that is lost does not end before its budget or its time.
    """

    trial: int
    algorithm: str
    forest: Forest
    seed: int
    rover: RoverConfig
    budget_m: float = 1000.0
    depth: Depth = Depth.DEVICE
    faults: Sequence[Fault] = ()
    sensor_noise: float = 1.0
    physics: Physics = PHYSICS
    site: FieldSite | None = None
    terrain: Terrain | None = None
    ground: GroundName = GroundName.ideal
    drawn: Mapping[str, float] = field(default_factory=dict)
    go_on: bool = False
    files: Mapping[str, OwnFile] = field(default_factory=dict)


class TrialSetup:
    """World, rover, supervisor and outcome monitor of one run; made on the running loop.

    Raises:
        MissingPart: the rover cannot give what the algorithm needs.
        BadInput: a fault is meant for what the rover has not.
    """

    def __init__(self, spec: TrialSpec, make_log: MakeLog) -> None:
        self.config = spec.rover
        loop, streams = asyncio.get_running_loop(), RandomStreams(spec.seed, spec.sensor_noise)
        check_same(spec.files.values())
        algorithm = find_algorithm(as_used(spec.algorithm, spec.files))
        handler = algorithm.make(spec.rover.escape, spec.rover.vehicle, streams.random("algorithm"))
        self.world = _world(spec, streams)
        if spec.faults:
            from wayfarer.simhal.faults.injector import Injector  # a trial without faults need not know them

            self.injector: Injector | None = Injector(spec.faults, spec.rover, spec.seed)
            rover = build(spec.depth, self.world, streams, spec.rover, loop.time, self.injector.buses)
            self.rover = self.injector.instrument(rover)
        else:
            self.injector = None
            self.rover = build(spec.depth, self.world, streams, spec.rover, loop.time)
        self.supervisor = Supervisor(
            self.rover, spec.rover, algorithm, handler, make_log(self.world, self.rover),
            ladder_seed=streams.random_seed("ladder"),
        )  # fmt: skip
        limit_s = spec.site.time_limit_s if spec.site else inf
        self.outcome_monitor = OutcomeMonitor(
            spec.forest, spec.budget_m, spec.physics.tip_deg, self.supervisor.finish, limit_s
        )
        self.intervention_counter = (
            InterventionCounter(spec.physics.tip_deg, self.outcome_monitor.watch) if spec.site else None
        )
        self.world.after_step = (
            self.intervention_counter.watch if self.intervention_counter else self.outcome_monitor.watch
        )


def _world(spec: TrialSpec, streams: RandomStreams) -> SimulatedWorld:
    """Return the world that a trial asks for.

    Raises:
        BadConfig: wheels that slip need more of the body than the rover file gives.
    """
    rover = spec.rover
    if spec.terrain is None:
        chassis = rover.chassis if spec.site else None
        return World(spec.forest, rover.vehicle, spec.physics, streams, chassis=chassis, skid=_skid(spec))
    from wayfarer.simhal.mujoco.world import MujocoWorld  # physics-light needs no engine

    body = body_of(rover.name, rover.vehicle, rover.chassis, "--physics mujoco")
    return MujocoWorld(spec.forest, body, spec.physics, spec.terrain, streams)


def _skid(spec: TrialSpec) -> SkidSteering | None:
    """Return how the body moves on ground that is not ideal."""
    rover = spec.rover
    if spec.ground is GroundName.ideal:
        return None
    body = body_of(rover.name, rover.vehicle, rover.chassis, f"--ground {spec.ground}")
    return SkidSteering(body, FRICTIONS[spec.ground], rover.vehicle.track_m, spec.physics.step_s)
