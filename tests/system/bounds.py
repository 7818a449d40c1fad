"""Within which time the fault catalogue wants an answer."""

from __future__ import annotations

from wayfarer.fault_scenarios.catalogue import covered_by_tests


def bound_s(fault: str) -> float:
    """Return the bound of a fault that a test holds."""
    within_s = covered_by_tests()[fault].within_s
    assert within_s is not None
    return within_s
