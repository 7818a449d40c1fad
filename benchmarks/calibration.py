"""CPU of a trial in a unit that holds on any computer: the time of a fixed piece of Python, measured in the same run.

One trial of the simulator that the authors of the paper released costs 6.6 of these units (the same forests, measured
beside it, without start-up).
"""

from __future__ import annotations

from math import cos, sin
from time import process_time

from benchmarks.figures import Figure, timed
from benchmarks.stack import spec_of
from wayfarer.control import is_compiled
from wayfarer.experiments.trial import run_trial

STEPS = 400_000
MOST_COMPILED, MOST_PURE = 0.275, 1.1  # 24 and 6 times less than the released simulator
TRIALS_A_RUN = 10


class _Walker:
    """Calls, attributes, floats: what a simulation in Python is made of."""

    __slots__ = ("heading_rad", "x_m", "y_m")

    def __init__(self) -> None:
        self.x_m = self.y_m = self.heading_rad = 0.0

    def step(self, forward_m: float, turn_rad: float) -> float:
        self.heading_rad += turn_rad
        self.x_m += forward_m * cos(self.heading_rad)
        self.y_m += forward_m * sin(self.heading_rad)
        return self.x_m


def _walk() -> None:
    walker, seen = _Walker(), {}
    for step in range(STEPS):
        seen[step & 255] = walker.step(0.05, 0.01)


def unit_s() -> float:
    """Return the CPU seconds of one unit on this computer, now."""
    return min(timed(process_time, _walk) for _ in range(3))


def trial_cost(runs: int) -> Figure:
    """Measure trials of forest-pledge in one process, without start-up."""
    run_trial(spec_of(0))
    values = []
    for run in range(runs):
        specs = [spec_of(run * TRIALS_A_RUN + trial) for trial in range(TRIALS_A_RUN)]
        before_s = unit_s()
        cpu_s = sum(timed(process_time, run_trial, spec) for spec in specs)
        values.append(cpu_s / TRIALS_A_RUN / ((before_s + unit_s()) / 2))
    kind, most = ("compiled", MOST_COMPILED) if is_compiled() else ("pure Python", MOST_PURE)
    return Figure(f"CPU per trial, {kind}, in units (released simulator: 6.6)", "", values, most)
