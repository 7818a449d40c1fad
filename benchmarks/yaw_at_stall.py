"""Whether a rover turns towards the side that it ran into: the yaw at a stall as a bumper, against the true contact.

Trials in MuJoCo; the heading is read 50 times per second, without noise. At each claim of the detector that it is
immobilised as it drives ahead, while its front touches something on one side of its middle, the sign of the yaw around
the stall is compared with that side. The stall is when the body last moved with half the commanded speed.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from math import cos, degrees, sin
from typing import NamedTuple

from wayfarer.angles import wrap180
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Anomaly
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics, Terrain
from wayfarer.simhal.world.sites import DENSE_OBSTRUCTION
from wayfarer.testing.safety_rules import after_each_step

FRICTIONS = (0.15, 0.4, 0.65, 0.8)
BUDGET_M = 150.0
KEEPS_S = 3.0
MIDDLE = 0.15  # of the half width: what touches nearer to the middle has no side
BEFORE_S, AFTER_S = 0.1, 0.4  # of the stall
SPEAKS_DEG = (2.0, 5.0)
HEADER = (
    "place", "rover", "cruise m/s", "friction", "stalls", "right", "wrong", "silent", "right of those that speak",
    "from 5°", "side of the commanded turn",
)  # fmt: skip
ROVERS = (("forestrover", 0.42), ("forestrover", 0.9), ("minirover", 0.3))


class YawCase(NamedTuple):
    """What one line of the table is measured under."""

    clutter: bool
    rover: str
    cruise_m_s: float
    friction: float


class Look(NamedTuple):
    """The body at one look of the world; ``lateral`` is where it touches, in half widths to the right, None if not."""

    t_s: float
    heading_deg: float
    ahead_m: float
    turn: float
    lateral: float | None


class Stall(NamedTuple):
    """A claim of the detector.

    Where the front touched, in half widths to the right, None if nothing did; the duty ahead; the yaw around the stall,
    clockwise positive; and by how much the left duty was above the right one in the second before it.
    """

    lateral: float | None
    duty: float
    yaw_deg: float
    turn: float


class Watcher(RunLog):
    """Watches the world at each of its looks, and takes the claims of the detector."""

    def __init__(self, config: RoverConfig) -> None:
        self._vehicle = config.vehicle
        self.stalls: list[Stall] = []
        self._looks: deque[Look] = deque()
        self._claimed = False
        self._commanded = (0.0, 0.0)

    def follow(self, world: MujocoWorld) -> None:
        """Watch a world."""
        self._world = world
        after_each_step(world, self._look)

    def _look(self) -> None:
        world = self._world
        left, right = self._commanded = (
            world.commanded
        )  # at the tick that claims, the wheels are told to go back already
        self._looks.append(
            Look(
                world.t_s,
                degrees(world.heading_rad),
                world.forward_m - world.reverse_m,
                left - right,
                self._touches_at(),
            )
        )
        while self._looks[0].t_s < world.t_s - KEEPS_S:
            self._looks.popleft()

    def _touches_at(self) -> float | None:
        """Return the place across the front at which something touches it, the mean of all, in half widths."""
        world, data = self._world, self._world.data
        belly = world._contacts.belly
        s, c = sin(world.heading_rad), cos(world.heading_rad)
        across = []
        for (other, own), position in zip(data.contact.geom.tolist(), data.contact.pos.tolist(), strict=True):
            if 0 < other < belly <= own:
                east_m, north_m = position[0] - world.x_m, position[1] - world.y_m
                if east_m * s + north_m * c > 0.0:
                    across.append((east_m * c - north_m * s) / (self._vehicle.width_m / 2))
        return sum(across) / len(across) if across else None

    def tick(self, record: TickRecord) -> None:
        """Take a claim when it begins."""
        claims = record.observation is not None and Anomaly.IMMOBILISED in record.observation.anomalies
        began, self._claimed = claims and not self._claimed, claims
        left, right = self._commanded
        if began and left + right > 0.0 and len(self._looks) > 100:
            self._stalled((left + right) / 2)

    def _stalled(self, duty: float) -> None:
        looks = list(self._looks)
        steps = 5  # a tenth of a second
        least_m = 0.5 * duty * self._vehicle.max_speed_m_s * 0.1
        moving = [at for at in range(steps, len(looks)) if looks[at].ahead_m - looks[at - steps].ahead_m > least_m]
        if not moving:
            return
        at = moving[-1]
        first, last = looks[max(0, at - round(BEFORE_S * 50))], looks[min(len(looks) - 1, at + round(AFTER_S * 50))]
        touched = [look.lateral for look in looks[at:] if look.lateral is not None]
        lateral = sum(touched) / len(touched) if touched else None
        before = looks[max(0, at - 50) : at + 1]
        turn = sum(look.turn for look in before) / len(before)
        self.stalls.append(Stall(lateral, duty, wrap180(last.heading_deg - first.heading_deg), turn))


def rows(trials: int) -> Iterator[tuple[str, ...]]:
    """Run so many trials of each case and yield the table's lines."""
    cases = [YawCase(clutter, *rover, mu) for clutter, rover, mu in product((True, False), ROVERS, FRICTIONS)]
    stalls: dict[YawCase, list[Stall]] = {case: [] for case in cases}
    tasks = [(case, trial) for trial in range(trials) for case in cases]
    with ProcessPoolExecutor() as pool:
        for (case, _), found in zip(tasks, pool.map(measure, tasks), strict=True):
            stalls[case] += found
    for case, found in stalls.items():
        yield _row(case, [each for each in found if each.lateral is not None and abs(each.lateral) >= MIDDLE])


def _row(case: YawCase, stalls: Sequence[Stall]) -> tuple[str, ...]:
    speaking = [[each for each in stalls if abs(each.yaw_deg) >= least_deg] for least_deg in SPEAKS_DEG]
    right = [sum(each.yaw_deg * (each.lateral or 0.0) > 0.0 for each in those) for those in speaking]
    by_turn = sum(each.turn * (each.lateral or 0.0) > 0.0 for each in stalls)
    return (
        "clutter" if case.clutter else "forest", case.rover, f"{case.cruise_m_s:g}", f"{case.friction:g}",
        str(len(stalls)), str(right[0]), str(len(speaking[0]) - right[0]), str(len(stalls) - len(speaking[0])),
        *(f"{many / len(those):.0%}" if those else "" for many, those in zip(right, speaking, strict=True)),
        f"{by_turn / len(stalls):.0%}" if stalls else "",
    )  # fmt: skip


def measure(task: tuple[YawCase, int]) -> list[Stall]:
    """Return the stalls of one trial."""
    case, trial = task
    rover = load_rover(case.rover)
    rover = rover.model_copy(update={"escape": replace(rover.escape, cruise_m_s=case.cruise_m_s)})
    site = DENSE_OBSTRUCTION if case.clutter else None
    forest = site.layout(trial, 11, rover.vehicle) if site else generate_forest(trial, 11, trial)
    spec = TrialSpec(trial, "forest-pledge", forest, trial, rover, BUDGET_M, site=site, terrain=Terrain(case.friction),
                     physics=Physics(slip_mean_m=10.0))  # fmt: skip
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(_run(spec))


async def _run(spec: TrialSpec) -> list[Stall]:
    watcher = Watcher(spec.rover)
    setup = TrialSetup(spec, lambda *_: watcher)
    assert isinstance(setup.world, MujocoWorld)
    watcher.follow(setup.world)
    await setup.supervisor.arm(Asked(asyncio.get_running_loop().time()), spec.forest.heading_deg)
    await setup.supervisor.run()
    return watcher.stalls
