"""No case of a reader ends in an error that it does not know; the same cases in each run."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz import on_command, on_control, on_files, on_gpsd, on_live, on_logs, on_mavlink, on_parts
from tests.fuzz.target import Case, Target

MODULES = (on_control, on_files, on_logs, on_parts, on_gpsd, on_live, on_mavlink, on_command)
TARGETS = [each for module in MODULES for each in vars(module).values() if isinstance(each, Target)]
LONG_TIMES = 40  # as many cases in the tier ``long``: minutes; chosen by us
SLOW_BELOW = 10  # few cases are quick if each takes long

QUICK = [
    pytest.param(target, target.quick, id=target.name, marks=[pytest.mark.long] * (target.quick < SLOW_BELOW))
    for target in TARGETS
]
MANY = [
    pytest.param(target, LONG_TIMES * target.quick, id=f"{target.name}-many", marks=pytest.mark.long)
    for target in TARGETS
]


@pytest.mark.parametrize(("target", "cases"), [*QUICK, *MANY])
def test_no_case_of_a_reader_ends_in_an_error_that_it_does_not_know(target: Target, cases: int) -> None:
    outcomes: Counter[str] = Counter()
    with target.opened() as attempt:

        @settings(max_examples=cases, database=None, suppress_health_check=list(HealthCheck))
        @given(target.cases)
        def attempt_one(case: Case) -> None:
            outcomes[attempt(case)] += 1

        attempt_one()
    assert outcomes.total() >= cases // 2
    assert len(outcomes) > 1 or cases < SLOW_BELOW
