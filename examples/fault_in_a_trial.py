"""Faults on purpose: what a rover does when a part of it fails, as tests of a rover file of your own.

Run them: pip install '.[sim]' pytest && pytest examples/fault_in_a_trial.py
"""

import pytest

from wayfarer.testing.faults import Expectation, Fault, ResponseLevel, Result, Scenario, run_fault_scenario

ROVER = "forestrover"  # or a file of yours: "./my-rover.toml"


def struck(kind: str, part: str, expect: Expectation) -> Result:
    """Return what comes of 5 s with a fault; the scenario is run with it, and without."""
    fault = Fault(at_s=15.0, for_s=5.0, target=part, kind=kind)
    return run_fault_scenario(Scenario(name="struck", rover=ROVER, for_s=25.0, faults=(fault,), expect=expect))


@pytest.mark.parametrize("kind", ["silent", "nack", "hang"])
def test_wheels_stand_within_a_second_without_a_compass(kind: str) -> None:
    """However it fails: its driver, its wire, or its whole bus."""
    result = struck(kind, "compass", Expectation(ResponseLevel.HOLD, within_s=1.0, causes=("compass_stale",)))
    assert result.passed, result.problems


if __name__ == "__main__":
    result = struck("silent", "compass", Expectation(ResponseLevel.HOLD, within_s=1.0))
    print(f"{result.reached} by {result.cause} after {result.detected_s:.2f} s; stopped after {result.stopped_s:.2f} s")
    print("as expected" if result.passed else "\n".join(result.problems))
