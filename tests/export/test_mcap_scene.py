"""The scene of the 3D panel, and from a compass to the axes of REP 103."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Any

import pytest
from foxglove.messages import FrameTransform, SceneUpdate, Timestamp
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.export.readers import Descriptors
from wayfarer.export.mcap_scene import body_scene, enu_rotation, forest_scene, orientation, transform
from wayfarer.fieldlog.record import World

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


UP = (0.0, 0.0, 1.0)
TIME = Timestamp(1, 2)
WORLD = World(
    forest=1,
    noise=0,
    start_m=(25.0, 12.5),
    heading_deg=0.0,
    goal_y_m=50.0,
    trunk_diameter_m=0.3,
    tree_radius_m=0.25,
    trees_m=[(3.0, 4.0)],
    trunks_m=[(10.0, 20.0, 13.0, 24.0, "right")],
)


def decoded(message: FrameTransform | SceneUpdate) -> dict[str, Any]:
    schema = message.get_schema()
    return Descriptors(schema.data).decode(f".{schema.name}", message.encode())


def turned(rotation: dict[str, float], vector: Vector) -> Vector:
    return body_axis([rotation[axis] for axis in "xyzw"], vector)


def test_transform_says_where_the_rover_is_in_the_map() -> None:
    message = decoded(transform(TIME, "rover", 3.0, -4.0, orientation(90.0)))
    assert (message["parent_frame_id"], message["child_frame_id"]) == ("map", "rover")
    assert message["translation"] == {"x": 3.0, "y": -4.0, "z": 0.0}
    assert message["rotation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0})
    assert message["timestamp"] == {"seconds": 1, "nanos": 2}


def test_trunk_is_as_thick_as_it_is_even_if_others_are_not() -> None:
    world = replace(WORLD, diameters_m=[0.1])
    (forest, _) = decoded(forest_scene(TIME, world))["entities"]
    assert forest["cylinders"][0]["size"] == pytest.approx({"x": 0.1, "y": 0.1, "z": 5.0})


def test_trunk_lies_between_its_ends_and_a_tree_stands() -> None:
    forest, _goal = decoded(forest_scene(TIME, WORLD))["entities"]
    trunk, tree = forest["cylinders"]
    assert trunk["size"] == pytest.approx({"x": 0.3, "y": 0.3, "z": 5.0})
    middle, rotation = trunk["pose"]["position"], trunk["pose"]["orientation"]
    assert (middle["x"], middle["y"]) == (11.5, 22.0)
    assert turned(rotation, UP) == pytest.approx((0.6, 0.8, 0.0))
    assert (tree["pose"]["position"]["x"], tree["pose"]["position"]["y"]) == (3.0, 4.0)
    assert (tree["size"]["x"], tree["size"]["y"]) == (0.5, 0.5)
    assert turned(tree["pose"]["orientation"], UP) == pytest.approx(UP)


def test_goal_is_a_line_to_the_north_of_the_start() -> None:
    _forest, goal = decoded(forest_scene(TIME, WORLD))["entities"]
    assert [(point["x"], point["y"]) for point in goal["lines"][0]["points"]] == [(0.0, 50.0), (50.0, 50.0)]


def test_body_has_the_rovers_size_and_moves_with_its_frame() -> None:
    (body,) = decoded(body_scene(TIME, 0.5, 0.4, ["rover"]))["entities"]
    assert (body["frame_id"], body["frame_locked"]) == ("rover", True)
    assert (body["cubes"][0]["size"]["x"], body["cubes"][0]["size"]["y"]) == (0.5, 0.4)
    nose = body["arrows"][0]["pose"]
    assert nose["position"]["x"] == 0.25
    assert turned(nose["orientation"], AHEAD) == pytest.approx(AHEAD)
