"""What was met so far: trunks, as lines through the places where the rover was stopped.

All places are of the rover's middle, in metres ahead along and right of the goal heading. So a line is where the middle
cannot pass, and a way may run along it.
"""

from __future__ import annotations

from typing import NamedTuple

Point = tuple[float, float]


class Barrier(NamedTuple):
    """A piece of a line that costs ``price_m`` of path to cross."""

    a0: float
    r0: float
    a1: float
    r1: float
    price_m: float


class Trunk:
    """One obstacle: an open line through its contacts, in order; ``met_at_m`` is the path at its latest contact."""

    def __init__(self, points: list[Point], met_at_m: float) -> None:
        self.points = points
        self.met_at_m = met_at_m
        self.headings: list[Point] = []
        self.near: Point = (-1.0, 0.0)  # unit vector back from the line to the side that was driven on


def nearest_on(a0: float, r0: float, a1: float, r1: float, a: float, r: float) -> Point:
    """Return the point of a piece that is nearest to a place."""
    da, dr = a1 - a0, r1 - r0
    square = da * da + dr * dr
    if square <= 0.0:
        return a0, r0
    share = ((a - a0) * da + (r - r0) * dr) / square
    share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
    return a0 + share * da, r0 + share * dr


def crosses(a0: float, r0: float, a1: float, r1: float, b0: float, s0: float, b1: float, s1: float) -> bool:
    """Return whether two pieces cross."""
    da, dr = a1 - a0, r1 - r0
    eb, es = b1 - b0, s1 - s0
    den = da * es - dr * eb
    if -1e-12 < den < 1e-12:
        return False
    ca, cr = b0 - a0, s0 - r0
    t = (ca * es - cr * eb) / den
    if t <= 0.0 or t >= 1.0:
        return False
    u = (ca * dr - cr * da) / den
    return 0.0 <= u <= 1.0
