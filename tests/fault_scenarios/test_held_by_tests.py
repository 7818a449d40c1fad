"""Faults that tests hold instead of scenarios: each named test is there."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from wayfarer.fault_scenarios.catalogue.held_by_tests import HELD_BY_TESTS, FaultTest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("fault", HELD_BY_TESTS.values(), ids=HELD_BY_TESTS)
def test_test_that_holds_a_fault_is_there(fault: FaultTest) -> None:
    file, _, function = fault.test.partition("::")
    module = ast.parse((CHECKOUT / file).read_text(encoding="utf-8"))
    assert function in {node.name for node in module.body if isinstance(node, ast.FunctionDef)}
