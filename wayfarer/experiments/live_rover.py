"""The simulated rover in real time: ``wayfarer run --sim``, in one generated forest."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from wayfarer.commissioning.checks import ARMING, CALIBRATED
from wayfarer.config.rover_file import RoverConfig
from wayfarer.daemon.daemon import RoverSetup
from wayfarer.experiments.outcome import OutcomeMonitor
from wayfarer.experiments.trial_log import GroundTruthLog
from wayfarer.fieldlog.vocabulary import outcome_in_words
from wayfarer.simhal.build_rover import Depth, build
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest_file import as_row
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

NO_BUDGET_M = 1e9  # a person may watch for as long as they like


def live_rover_setup(config: RoverConfig, depth: Depth, seed: int, finish: Callable[[str, str], None]) -> RoverSetup:
    """Return a rover at the start of a forest, in a world that begins now; made on the running loop.

    ``finish`` is called with a reason and a sentence when the rover has left the forest, or has tipped over.
    """
    clock = asyncio.get_running_loop().time
    forest, streams, physics = generate_forest(seed, 0, seed), RandomStreams(seed), Physics()
    world = World(forest, config.vehicle, physics, streams, starts_s=clock())

    def tell(outcome: str, _: str) -> None:
        finish(outcome, f"the simulated rover has {outcome_in_words(outcome)} after {world.path_m:.1f} m")

    world.after_step = OutcomeMonitor(forest, NO_BUDGET_M, physics.tip_deg, tell).watch
    rover = build(depth, world, streams, config, clock)
    checks = [check for check in ARMING if check not in CALIBRATED]
    return RoverSetup(
        rover, checks=checks, world=as_row(forest), ground_truth_log=lambda log: GroundTruthLog(log, world)
    )
