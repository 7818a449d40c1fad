"""Headings that wrap around: the same drive through the same forest, once across north and once across south.

Turning the magnetic field by 180 degrees and the goal with it changes every heading that the field code reads, and no
turn: what it does must be the same, tick by tick, although only one of the two goes across 359.9 and 0. (Where an angle
meets a limit to the last bit of a floating point number, two such drives may part; these do not.)
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import inf

from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.fault_scenarios.result import Tried
from wayfarer.fault_scenarios.runner import run_scenario
from wayfarer.fault_scenarios.scenario import Command, Expectation, Reached, Scenario
from wayfarer.hal import WheelCommand
from wayfarer.simhal.faults.kinds import Fault, MagneticAnomaly

ABOUT = "headings go back and forth across 359.9 and 0: no effect on counter or control"
# The steering wanders across the goal, and slips every few metres make turns.
NORTHWARDS = Scenario(
    "heading-wrap", ABOUT, Expectation(Reached.NONE, 0.0), (), for_s=60.0, seed=2, slip_mean_m=3.0,
    commands=(Command(0.0, "arm", 0.0),),
)  # fmt: skip
SOUTHWARDS = replace(
    NORTHWARDS,
    faults=(Fault(0.0, inf, "world", "magnetic_anomaly", MagneticAnomaly(180.0)),),
    commands=(Command(0.0, "arm", 180.0),),
)


@procedure("heading-wrap", 6, ABOUT, asked="no effect", expected=Reached.NONE, tried=Tried.SIMULATED)
def heading_wrap(found: Observed) -> None:
    """Drive both ways and compare what was decided and done."""
    north, south = run_scenario(NORTHWARDS).monitor, run_scenario(SOUTHWARDS).monitor
    wraps = _wraps(north)
    found.changed = f"compass.heading_deg, {wraps} times across north, against {_wraps(south)} in the other drive"
    found.demand(wraps > _wraps(south) + 50, "the heading hardly ever went across north")
    found.demand(any(moment.why == "follow.anomaly" for moment in north.moments), "no turn was made")
    northwards, southwards = _done(north), _done(south)
    parted_s = next((one[0] for one, other in zip(northwards, southwards, strict=False) if one != other), None)
    found.demand(northwards == southwards, f"the two drives part at {parted_s} s")


def _done(monitor: RunRecorder) -> list[tuple[float, str, WheelCommand]]:
    return [(moment.t_s, moment.why, moment.applied) for moment in monitor.moments]


def _wraps(monitor: RunRecorder) -> int:
    """Return how often the heading went across north from one tick to the next."""
    readings = [moment.snapshot.compass for moment in monitor.moments]
    headings = [reading.heading_deg for reading in readings if reading is not None]
    return sum(abs(now - last) > 180.0 for last, now in pairwise(headings))
