"""A fault on purpose: the compass falls silent for five seconds, and the wheels must stand within one.

Run it: pip install '.[sim]' && python examples/fault_in_a_trial.py
"""

from wayfarer.fault_scenarios.judge import judge
from wayfarer.fault_scenarios.runner import run_scenario, run_without_faults
from wayfarer.fault_scenarios.scenario import Expectation, ResponseLevel, Scenario
from wayfarer.simhal.faults.kinds import Fault

scenario = Scenario(
    name="silent-compass",
    about="the compass does not answer for five seconds",
    expect=Expectation(ResponseLevel.HOLD, within_s=1.0, causes=("compass_stale",)),
    faults=(Fault(at_s=15.0, for_s=5.0, target="compass", kind="silent"),),
    for_s=25.0,
)
# With the fault, and the same run without it.
result = judge(scenario, run_scenario(scenario), run_without_faults(scenario))
print(f"{result.reached} by {result.cause} after {result.detected_s:.2f} s; stopped after {result.stopped_s:.2f} s")
print("as expected" if result.passed else "\n".join(result.problems))
