"""Memory-Pledge gets out of what Pledge gets out of: pockets, the walls of a G, one wall after another."""

from __future__ import annotations

from dataclasses import replace

import pytest

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk

pytestmark = pytest.mark.process  # a dozen trials

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
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_memory_pledge_is_not_entrapped_where_pledge_is_not(trap: str, slip_mean_m: float, seed: int) -> None:
    def gets_out(name: str) -> bool:
        spec = TrialSpec(0, name, forest(TRAPS[trap]), seed, load_rover("sim"), slip_mean_m, budget_m=1000.0)
        return run_trial(spec).outcome in SUCCESSES

    assert gets_out("memory-pledge") or not gets_out("pledge")
