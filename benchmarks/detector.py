"""How well the detector notices anomalies: recall, precision and delay against what the simulated world knows.

Trials in forests give what forests give: slips, trunks, trees. Slopes are injected, because the simulated ground is
level: now and then one of up to 40 degrees to any of the four sides, below and above what counts as tilted.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from benchmarks.detector_score import NOTHING, DetectorScorer, Score
from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.api import Anomaly
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Slope
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics, Terrain

SLIP_MEANS_M = (2.0, 10.0)
NOISES = (1.0, 3.0)
FRICTIONS = (0.1, 0.15, 0.3, 0.5, 0.8)
BUDGET_M = 100.0
SLOPES = 12
SLOPE_EVERY_S = 10.0
SLOPE_MAX_DEG = 40.0
SLOPE_LASTS_S = (0.3, 3.0)
HEADER = ("anomaly", "slip mean m", "noise", "episodes", "recall", "claims", "precision", "delay s", "p95 s")
MUJOCO_HEADER = ("anomaly", "friction", *HEADER[2:])


class DetectorCase(NamedTuple):
    """What one part of the table is measured under."""

    source: Literal["motion", "contact"]
    slip_mean_m: float
    noise: float
    friction: float | None = None  # of the ground in MuJoCo; None in physics-light


Scores = dict[Anomaly, Score]
Measured = Mapping[DetectorCase, Scores]
DetectorTask = tuple[DetectorCase, int]  # a case, and the number of the trial

SOURCES: tuple[Literal["motion", "contact"], ...] = ("motion", "contact")
CASES = tuple(
    DetectorCase(source, slip_mean_m, noise) for source in SOURCES for slip_mean_m in SLIP_MEANS_M for noise in NOISES
)
MUJOCO_CASES = tuple(DetectorCase(source, 10.0, 1.0, friction) for friction in FRICTIONS for source in SOURCES)


def rows(rover: RoverConfig, cases: Sequence[DetectorCase], trials: int) -> Iterator[tuple[str, ...]]:
    """Run so many trials of each case and yield the table's lines: contact for touches, motion for all else."""
    measured = {case: dict.fromkeys(Anomaly, NOTHING) for case in cases}
    tasks = [(case, trial) for trial in range(trials) for case in cases]
    with ProcessPoolExecutor() as pool:
        for (case, _), scores in zip(tasks, pool.map(partial(_scores_of, rover), tasks), strict=True):
            measured[case] = {anomaly: measured[case][anomaly] + scores[anomaly] for anomaly in Anomaly}
    for anomaly in Anomaly:
        for case, scores in measured.items():
            if (case.source == "contact") is (anomaly is Anomaly.TOUCHED):
                yield _row(anomaly, case, scores[anomaly])


def _scores_of(rover: RoverConfig, task: DetectorTask) -> Scores:
    return measure(rover, *task)


def _row(anomaly: Anomaly, case: DetectorCase, score: Score) -> tuple[str, ...]:
    ground = case.slip_mean_m if case.friction is None else case.friction
    delays = ["" if delay is None else f"{delay:.2f}" for delay in delay_s(score) or (None, None)]
    return (
        f"`{anomaly.value}`", f"{ground:g}", f"{case.noise:g}x",
        str(score.episodes), _share(score.found, score.episodes), str(score.claims), _share(score.right, score.claims),
        *delays,
    )  # fmt: skip


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else ""


def delay_s(score: Score) -> tuple[float, float] | None:
    """Return median and 95th percentile, or None of too few."""
    if len(score.delays_s) < 2:
        return None
    middle, late = np.quantile(score.delays_s, (0.5, 0.95), method="weibull").tolist()
    return middle, late


def measure(rover: RoverConfig, case: DetectorCase, trial: int) -> Scores:
    """Return the scores of one trial."""
    config = rover.with_anomaly_source(case.source)
    spec = TrialSpec(
        trial, "forest-pledge", generate_forest(trial, 0, trial), trial, config, BUDGET_M,
        faults=_slopes(trial), sensor_noise=case.noise, physics=Physics(slip_mean_m=case.slip_mean_m),
        terrain=None if case.friction is None else Terrain(case.friction),
    )  # fmt: skip
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(_run(spec))


async def _run(spec: TrialSpec) -> Scores:
    truth = DetectorScorer(spec.rover, on_wheels=spec.terrain is not None)
    setup = TrialSetup(spec, lambda *_: truth)
    truth.follow(setup.world)
    assert setup.injector is not None
    setup.injector.start(setup.world, setup.supervisor.inbox.put_power)
    await setup.supervisor.arm(Asked(asyncio.get_running_loop().time()), spec.forest.heading_deg)
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
