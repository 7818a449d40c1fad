"""From a compass to the axes of REP 103, by the rotation matrix of a quaternion."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from wayfarer.export.mcap_scene import enu_rotation

Vector = tuple[float, float, float]
AHEAD, LEFT = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def body_axis(rotation: Sequence[float], axis: Vector) -> Vector:
    """An axis of a body in the map."""
    x, y, z, w = rotation
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    a, b, c = (sum(each * part for each, part in zip(row, axis, strict=True)) for row in rows)
    return a, b, c


ANGLES = st.floats(-180.0, 180.0)


@given(st.floats(0.0, 360.0), st.floats(-89.0, 89.0), ANGLES)
@example(0.0, 0.0, 0.0)  # north
@example(90.0, 30.0, 0.0)
@example(360.0, 0.0, 30.0)
def test_heading_turns_clockwise_from_north_and_tilt_leaves_it_and_each_other_alone(
    heading_deg: float, pitch_deg: float, roll_deg: float
) -> None:
    rotation = enu_rotation(heading_deg, pitch_deg, roll_deg)
    assert sum(part * part for part in rotation) == pytest.approx(1.0)
    level = cos(radians(pitch_deg))
    ahead = (level * sin(radians(heading_deg)), level * cos(radians(heading_deg)), sin(radians(pitch_deg)))
    assert body_axis(rotation, AHEAD) == pytest.approx(ahead, abs=1e-9)
    assert body_axis(rotation, LEFT)[2] == pytest.approx(level * sin(radians(roll_deg)), abs=1e-9)
