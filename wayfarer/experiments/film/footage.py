"""The data of a film: the engine's poses and the rover's phase at each control tick."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.control.run_log import PartialLog, Tee
from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Phase
from wayfarer.experiments.trial import TrialResult, run_watched
from wayfarer.experiments.trial_log import field_log
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.hal import Rover
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.simulated_world import SimulatedWorld


class FilmedTick(NamedTuple):
    """One moment: the rover's joints as in the engine, what it was doing, and how far it had driven."""

    t_s: float
    joints: NDArray[np.float64]
    phase: Phase
    path_m: float


class Footage(PartialLog):
    """Runs one trial, an ``executors.RunTrial``, and keeps a ``FilmedTick`` of each control tick.

    Result and field log, which goes to ``log_dir``, are the same as without a film.
    """

    spec: TrialSpec
    world: MujocoWorld

    def __init__(self, log_dir: Path | None) -> None:
        self.ticks: list[FilmedTick] = []
        self.outcome = "fault"  # where the trial ends without a result
        self._log_dir = log_dir

    def __call__(self, spec: TrialSpec) -> TrialResult:
        """Run the trial."""

        def make_log(world: SimulatedWorld, rover: Rover) -> Tee:
            assert isinstance(world, MujocoWorld)  # the command films no other
            self.spec, self.world = spec, world
            return Tee(self, *(field_log(spec, self._log_dir, world, rover) if self._log_dir else ()))

        result = run_watched(spec, make_log)
        self.outcome = result.outcome
        return result

    def tick(self, record: TickRecord) -> None:
        """Keep where everything is."""
        world = self.world
        self.ticks.append(FilmedTick(world.t_s, world.data.qpos.copy(), record.decision.phase, world.path_m))

    @property
    def begins_s(self) -> float:
        """When the rover first does something: before that it waits for its start."""
        return next((tick.t_s for tick in self.ticks if tick.phase is not Phase.HALT), self.ticks[0].t_s)

    @property
    def ends_s(self) -> float:
        """When the last tick was."""
        return self.ticks[-1].t_s

    def at(self, times_s: Sequence[float]) -> list[FilmedTick]:
        """Return the trial at these times: the joints between two ticks, all else as at the earlier one.

        Pictures come more often than ticks; without the joints in between the rover would be seen to stutter. Between
        neighbouring ticks an attitude changes so little that its quaternion can be interpolated like a number.
        """
        known_s = [tick.t_s for tick in self.ticks]
        joints = np.array([tick.joints for tick in self.ticks])
        shown_s = np.clip(times_s, known_s[0], known_s[-1])
        between = np.column_stack([np.interp(shown_s, known_s, column) for column in joints.T])
        before = np.searchsorted(known_s, shown_s, "right") - 1
        moments = zip(before.tolist(), shown_s.tolist(), between, strict=True)
        return [self.ticks[number]._replace(t_s=t_s, joints=here) for number, t_s, here in moments]
