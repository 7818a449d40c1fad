"""A fault on purpose: the compass falls silent for five seconds, and the wheels must stand within one.

Run it: pip install '.[sim]' && python examples/fault_in_a_trial.py
"""

from wayfarer.testing.faults import Expectation, Fault, ResponseLevel, Scenario, run_fault_scenario

scenario = Scenario(
    name="silent-compass",
    about="the compass does not answer for five seconds",
    expect=Expectation(ResponseLevel.HOLD, within_s=1.0, causes=("compass_stale",)),
    faults=(Fault(at_s=15.0, for_s=5.0, target="compass", kind="silent"),),
    for_s=25.0,
)
result = run_fault_scenario(scenario)  # with the fault, and without it
print(f"{result.reached} by {result.cause} after {result.detected_s:.2f} s; stopped after {result.stopped_s:.2f} s")
print("as expected" if result.passed else "\n".join(result.problems))
