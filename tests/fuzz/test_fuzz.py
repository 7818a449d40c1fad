"""A few cases of every target, the same ones in each run."""

from __future__ import annotations

import pytest

from tests.fuzz.covered import Covered
from tests.fuzz.engine import fuzz_cases
from tests.fuzz.target import Target
from tests.fuzz.targets import TARGETS
from wayfarer.cli import is_compiled

SLOW_BELOW = 10  # few cases are quick where each takes long

PARAMETERS = [
    pytest.param(target, id=target.name, marks=[pytest.mark.long] * (target.quick < SLOW_BELOW)) for target in TARGETS
]


@pytest.mark.parametrize("target", PARAMETERS)
def test_no_case_of_a_reader_ends_in_an_error_that_it_does_not_know(target: Target) -> None:
    found = fuzz_cases(target, target.quick)
    assert found.error is None, repr(found.case)
    assert found.cases >= target.quick // 2
    assert len(found.outcomes) > 1 or target.quick < SLOW_BELOW


@pytest.mark.skipif(is_compiled(), reason="only lines of Python are counted")
def test_what_a_target_is_to_reach_exists() -> None:
    for target in TARGETS:
        assert Covered(target.covers).missing, target.name
