"""Memory-Pledge gets out of what Pledge gets out of: pockets, the walls of a G, one wall after another."""

from __future__ import annotations

from dataclasses import replace

import pytest

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk

pytestmark = pytest.mark.process  # two dozen trials

Line = tuple[float, float, float, float]

# Metres east and north of the start, which is in the trap; the way out is north.
TRAPS: dict[str, tuple[Line, ...]] = {
    "pocket": ((-3.0, 3.0, 3.0, 3.0), (-3.0, -3.0, -3.0, 3.0), (3.0, -3.0, 3.0, 3.0)),
    "deep pocket": ((-2.0, 3.0, 2.0, 3.0), (-2.0, -9.0, -2.0, 3.0), (2.0, -9.0, 2.0, 3.0)),
    "narrowing pocket": ((-4.0, -4.0, 0.2, 5.0), (4.0, -4.0, -0.2, 5.0)),
    "G": (
        (-4.0, 4.0, 4.0, 4.0), (-4.0, -4.0, -4.0, 4.0), (-4.0, -4.0, 4.0, -4.0), (4.0, -4.0, 4.0, 0.0),
        (1.5, 0.0, 4.0, 0.0), (4.0, 2.0, 4.0, 4.0),
    ),
    "wall after wall": ((-6.0, 3.0, 2.0, 3.0), (-2.0, 6.0, 6.0, 6.0), (-6.0, 9.0, 2.0, 9.0)),
}  # fmt: skip


def forest(lines: tuple[Line, ...]) -> Forest:
    x_m, y_m = CLEARING.start_m
    trunks = tuple(Trunk(x_m + x0, y_m + y0, x_m + x1, y_m + y1, "across") for x0, y0, x1, y1 in lines)
    return replace(CLEARING, trunks=trunks, trees_m=())


@pytest.mark.parametrize("trap", TRAPS)
@pytest.mark.parametrize("slip_mean_m", [2.0, 1e6])
def test_memory_pledge_is_not_entrapped_where_pledge_is_not(trap: str, slip_mean_m: float) -> None:
    for seed in (1, 2):
        outcomes = {}
        for name in ("pledge", "memory-pledge"):
            spec = TrialSpec(0, name, forest(TRAPS[trap]), seed, load_rover("sim"), slip_mean_m, budget_m=1000.0)
            outcomes[name] = run_trial(spec).outcome in SUCCESSES
        assert outcomes["memory-pledge"] or not outcomes["pledge"], f"seed {seed}"


def test_body_that_is_wedged_across_between_two_trunks_gets_out() -> None:
    """It has some centimetres to drive and some degrees to turn; only the ladder's shuffle leads to the wide end."""
    gap = forest(((-3.027, -0.38, 2.752, 1.231), (-2.677, -1.464, 2.952, 0.613)))
    spec = TrialSpec(0, "memory-pledge", gap, 2, load_rover("sim"))
    end = run_trial(spec)
    assert end.outcome in SUCCESSES
    assert end.time_s < 1200.0
