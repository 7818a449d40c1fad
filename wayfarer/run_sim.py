"""The simulated rover in real time: ``wayfarer run --sim``, in one generated forest."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from wayfarer.commissioning.checks import ARMING, CALIBRATED
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.run_log import RunLog, Tee
from wayfarer.daemon.daemon import RoverSetup
from wayfarer.experiments.outcome import OutcomeMonitor
from wayfarer.experiments.trial_log import GroundTruthLog
from wayfarer.fieldlog.log import FieldLog
from wayfarer.simhal.build_rover import build
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest_file import as_row
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Depth, Physics
from wayfarer.simhal.world.world import World
from wayfarer.vocabulary import outcome_in_words

if TYPE_CHECKING:
    from wayfarer.simhal.faults.injector import Injector
    from wayfarer.simhal.faults.kinds import Fault

NO_BUDGET_M = 1e9  # a person may watch for as long as they like


def simulated_rover_setup(
    config: RoverConfig, depth: Depth, seed: int, finish: Callable[[str, str], None], faults: Sequence[Fault] = ()
) -> RoverSetup:
    """Return a rover at the start of a forest, in a world that begins now; made on the running loop.

    ``finish`` is called with a reason and a sentence when the rover has left the forest, or has tipped over. The times
    of ``faults`` count from the first arming.
    """
    clock = asyncio.get_running_loop().time
    forest, streams, physics = generate_forest(seed, 0, seed), RandomStreams(seed), Physics()
    world = World(forest, config.vehicle, physics, streams, starts_s=clock())

    def tell(outcome: str, _: str) -> None:
        finish(outcome, f"the simulated rover has {outcome_in_words(outcome)} after {world.path_m:.1f} m")

    world.after_step = OutcomeMonitor(forest, NO_BUDGET_M, physics.tip_deg, tell).watch
    injector: Injector | None = None
    if faults:
        from wayfarer.simhal.faults.injector import Injector  # a rover without faults need not know them

        injector = Injector(faults, config, seed)
        rover = injector.instrument(build(depth, world, streams, config, clock, injector.buses))
    else:
        rover = build(depth, world, streams, config, clock)
    checks = [check for check in ARMING if check not in CALIBRATED]

    def make_truth_log(log: FieldLog) -> RunLog:
        truth = GroundTruthLog(log, world)
        return Tee(truth, _FaultsFromArming(injector, world, truth)) if injector else truth

    return RoverSetup(rover, checks=checks, world=as_row(forest), ground_truth_log=make_truth_log)


class _FaultsFromArming(RunLog):
    """Starts the injection of faults when the rover is armed for the first time.

    None of them is one of the process: here that is the daemon, whose clock and power are real.
    """

    def __init__(self, injector: Injector, world: World, truth: GroundTruthLog) -> None:
        self._injector, self._world, self._truth = injector, world, truth
        self._is_armed = False

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002 - the interface's
        if name == "armed" and not self._is_armed:
            self._is_armed = True
            self._injector.start(self._world, lambda _t_s, _flags: None, [self._truth.note])
