"""Within which time the fault catalogue wants an answer."""

from __future__ import annotations

from wayfarer.fault_scenarios.catalogue.covered_by_tests import COVERED_BY_TESTS


def bound_s(fault: str) -> float:
    """Return the bound of a fault that a test holds."""
    within_s = COVERED_BY_TESTS[fault].within_s
    assert within_s is not None
    return within_s
