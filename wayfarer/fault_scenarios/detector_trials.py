"""Trials that measure the detector: every anomaly, at two slip means and two noise levels.

Trials in forests give what forests give: slips, trunks, trees. Slopes are injected, because the simulated ground is
level: now and then one of up to 40 degrees to any of the four sides, below and above what counts as tilted.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Literal, NamedTuple

from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.api import Anomaly
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.fault_scenarios.detector_score import DetectorScorer, Score
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import Fault, Slope
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.generate import generate_forest

if TYPE_CHECKING:
    from wayfarer.simhal.mujoco.terrain import Terrains

SLIP_MEANS_M = (2.0, 10.0)
NOISES = (1.0, 3.0)
BUDGET_M = 100.0
SLOPES = 12
SLOPE_EVERY_S = 10.0
SLOPE_MAX_DEG = 40.0
SLOPE_LASTS_S = (0.3, 3.0)


class DetectorCase(NamedTuple):
    """What one part of the table is measured under."""

    source: Literal["motion", "contact"]
    slip_mean_m: float
    noise: float
    friction: float | None = None  # of the ground in MuJoCo; None in physics-light
    torque_scale: float = 1.0


SOURCES: tuple[Literal["motion", "contact"], ...] = ("motion", "contact")
CELLS = tuple(
    DetectorCase(source, slip_mean_m, noise) for source in SOURCES for slip_mean_m in SLIP_MEANS_M for noise in NOISES
)
FRICTIONS = (0.1, 0.15, 0.3, 0.5, 0.8)
Scores = dict[Anomaly, Score]


def cells_in_mujoco(friction: float | None, torque_scale: float) -> tuple[DetectorCase, ...]:
    """Return the cells of a table by ground: of one friction, or of those that the documents speak of."""
    frictions = FRICTIONS if friction is None else (friction,)
    return tuple(DetectorCase(source, 10.0, 1.0, each, torque_scale) for each in frictions for source in SOURCES)


def measure(rover: RoverConfig, cell: DetectorCase, trial: int) -> Scores:
    """Return the scores of one trial."""
    config = rover.with_anomaly_source(cell.source)
    spec = TrialSpec(
        trial, "forest-pledge", generate_forest(trial, 0, trial), trial, config, cell.slip_mean_m, BUDGET_M,
        faults=_slopes(trial), sensor_noise=cell.noise, terrains=_terrains(cell),
    )  # fmt: skip
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(_run(spec))


def _terrains(cell: DetectorCase) -> Terrains | None:
    if cell.friction is None:
        return None
    from wayfarer.simhal.drawn_ranges import Range
    from wayfarer.simhal.mujoco.terrain import Terrains  # physics-light needs no engine

    return Terrains(Range(cell.friction, cell.friction), torque_scale=Range(cell.torque_scale, cell.torque_scale))


async def _run(spec: TrialSpec) -> Scores:
    truth = DetectorScorer(spec.rover, on_wheels=spec.terrains is not None)
    setup = TrialSetup(spec, lambda *_: truth)
    truth.follow(setup.world)
    assert setup.injector is not None
    setup.injector.start(setup.world, setup.supervisor.controller.power, lambda *_, **__: None)
    await setup.supervisor.arm(spec.forest.heading_deg)
    await setup.supervisor.run()
    setup.injector.end()
    return truth.scores()


def _slopes(trial: int) -> tuple[Fault, ...]:
    rng = RandomStreams(trial).random("detector.slopes")
    faults = []
    for number in range(SLOPES):
        angle_deg = rng.uniform(-SLOPE_MAX_DEG, SLOPE_MAX_DEG)
        slope = Slope(pitch_deg=angle_deg) if rng.random() < 0.5 else Slope(roll_deg=angle_deg)
        at_s = (number + rng.random()) * SLOPE_EVERY_S + 1.0
        faults.append(Fault(at_s, rng.uniform(*SLOPE_LASTS_S), "world", "slope", slope))
    return tuple(faults)
