"""Faults on purpose: what a rover does when a part fails, as ``wayfarer faults`` tests it, from Python.

::

    def test_a_silent_compass_stops_the_wheels():
        fault = Fault(at_s=15.0, for_s=5.0, target="compass", kind="silent")
        expect = Expectation(ResponseLevel.HOLD, within_s=1.0, causes=("compass_stale",))
        assert run_fault_scenario(Scenario("silent", "no answer for 5 s", expect=expect, faults=(fault,))).passed
"""

from __future__ import annotations

from wayfarer.fault_scenarios.judge import judge
from wayfarer.fault_scenarios.results import Result
from wayfarer.fault_scenarios.runner import run_scenario, run_without_faults
from wayfarer.fault_scenarios.scenario import Expectation, ResponseLevel, Scenario
from wayfarer.simhal.faults.kinds import Fault

__all__ = ["Expectation", "Fault", "ResponseLevel", "Result", "Scenario", "run_fault_scenario"]


def run_fault_scenario(scenario: Scenario) -> Result:
    """Run a scenario on the simulated rover, with its faults and without them, and judge the difference.

    Raises:
        BadInput: a fault cannot happen to the rover.
    """
    return judge(scenario, run_scenario(scenario), run_without_faults(scenario))
