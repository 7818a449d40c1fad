"""A value within bounds."""

from __future__ import annotations


def clamp(value: float, low: float, high: float) -> float:
    """Return the value, or the bound that it is beyond; NaN stays NaN. If the bounds cross, ``high`` counts."""
    return min(max(value, low), high)
