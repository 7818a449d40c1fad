"""The data of a film: the engine's poses and the rover's phase at each control tick."""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.control.run_log import PartialLog, Tee
from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Phase
from wayfarer.experiments.trial import TrialResult, field_log, run_watched
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.hal import Rover
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.simulated_world import SimulatedWorld

JUMP_M = 0.2  # between two ticks: a person has put the rover elsewhere


class FilmedTick(NamedTuple):
    """One moment: the rover's joints as in the engine, what it was doing, and how far it had driven."""

    t_s: float
    joints: NDArray[np.float64]
    phase: Phase
    path_m: float


class Footage(PartialLog):
    """Looks at the world at each tick, and keeps a ``FilmedTick``."""

    def __init__(self, spec: TrialSpec, world: MujocoWorld) -> None:
        self.spec, self.world = spec, world
        self.shots: list[FilmedTick] = []
        self.outcome = "fault"  # until the outcome monitor has said otherwise

    def tick(self, record: TickRecord) -> None:
        """Keep where everything is."""
        world = self.world
        self.shots.append(FilmedTick(world.t_s, world.data.qpos.copy(), record.decision.phase, world.path_m))

    @property
    def begins_s(self) -> float:
        """When the rover first does something: before that it waits for its start."""
        return next((shot.t_s for shot in self.shots if shot.phase is not Phase.HALT), self.shots[0].t_s)

    @property
    def ends_s(self) -> float:
        """When the last shot was taken."""
        return self.shots[-1].t_s

    def at(self, t_s: float) -> FilmedTick:
        """Return a moment between two shots; the rover's phase is that of the earlier one."""
        after = bisect_right(self.shots, t_s, key=lambda shot: shot.t_s)
        if after in (0, len(self.shots)):
            return self.shots[min(after, len(self.shots) - 1)]
        one, other = self.shots[after - 1], self.shots[after]
        if np.hypot(*(other.joints[:2] - one.joints[:2])) > JUMP_M:
            return one
        share = (t_s - one.t_s) / (other.t_s - one.t_s)
        return one._replace(t_s=t_s, joints=_between(one.joints, other.joints, share))


def _between(one: NDArray[np.float64], other: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return joints part of the way from one moment to another; the same attitude is a quaternion and its negative."""
    there = other.copy()
    if one[3:7] @ there[3:7] < 0.0:
        there[3:7] *= -1.0
    joints = one + share * (there - one)
    joints[3:7] /= np.linalg.norm(joints[3:7])
    return joints


class FootageRecorder:
    """Runs one trial, its field log in ``log_dir``, and keeps its footage; an ``executors.RunTrial``."""

    def __init__(self, log_dir: Path | None) -> None:
        self._log_dir = log_dir
        self._taken: Footage | None = None

    @property
    def footage(self) -> Footage | None:
        """What was filmed; None where the trial ended before its first control tick."""
        return self._taken if self._taken and self._taken.shots else None

    def __call__(self, spec: TrialSpec) -> TrialResult:
        """Run the trial; its result and its field log are the same as without a film."""
        log_dir = self._log_dir

        def make_log(world: SimulatedWorld, rover: Rover) -> Tee:
            if not isinstance(world, MujocoWorld):
                raise TypeError("only a world of rigid bodies can be filmed")
            self._taken = Footage(spec, world)
            return Tee(self._taken, *(field_log(spec, log_dir, world, rover) if log_dir else ()))

        result = run_watched(spec, make_log)
        if self._taken is not None:
            self._taken.outcome = result.outcome
        return result
