"""The idea at work: a point that can only bump leaves pockets by counting its turns."""

from __future__ import annotations

from math import cos, radians, sin

import pytest

from tests.escape.walk import TICK_S, VEHICLE, Walk
from wayfarer.escape.api import Anomaly

# Rectangles (west, south, east, north) in metres; the rover starts at (0, 0) and its goal is north.
WALL = [(-3.0, 4.0, 3.0, 4.5)]
POCKET = [(-2.0, 4.0, 2.0, 4.5), (-2.5, 1.0, -2.0, 4.5), (2.0, 1.0, 2.5, 4.5)]
OUT_M = 6.0


def way_out_s(name: str, walls: list[tuple[float, float, float, float]], limit_s: float = 200.0) -> float | None:
    """The time until the rover is north of everything, None if it does not get there."""
    walk = Walk(name)
    x_m = y_m = 0.0
    anomalies: tuple[Anomaly, ...] = ()
    while y_m < OUT_M and walk.seen.t_s < limit_s:
        left, right = walk.tick(*anomalies).wheels
        step_m = (left + right) / 2 * VEHICLE.max_speed_m_s * TICK_S
        escape_plan = radians(walk.seen.heading_deg)
        to_x, to_y = x_m + step_m * sin(escape_plan), y_m + step_m * cos(escape_plan)
        blocked = any(west < to_x < east and south < to_y < north for west, south, east, north in walls)
        if not blocked:
            x_m, y_m = to_x, to_y
        anomalies = (Anomaly.IMMOBILISED,) if blocked else ()
    return walk.seen.t_s if y_m >= OUT_M else None


@pytest.mark.parametrize("name", ["pledge", "forest-pledge", "rand-pledge", "levy-pledge"])
def test_pledge_family_gets_round_a_wall(name: str) -> None:
    assert way_out_s(name, WALL) is not None


def test_pledge_leaves_a_pocket() -> None:
    assert way_out_s("pledge", POCKET) is not None


def test_short_straight_strides_do_not_leave_it() -> None:
    """The reactive family remembers nothing: that is what the counter is for."""
    assert way_out_s("cv-react", POCKET) is None
