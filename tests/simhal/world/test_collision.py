"""Contact tests and the map, against an oracle that samples the body."""

from __future__ import annotations

from math import cos, hypot, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from wayfarer.simhal.world.collision import BodyOutline, Obstacle, ObstacleGrid, obstacles_of
from wayfarer.simhal.world.forest import Forest, Trunk

Points = NDArray[np.float64]

SAMPLES = 41  # along each side of the body

coordinates_m = st.floats(-3, 3)
sides_m = st.floats(0.1, 1.5)
headings_rad = st.floats(-7, 7)


@st.composite
def obstacles(draw: st.DrawFn) -> Obstacle:
    x0_m, y0_m, radius_m = draw(coordinates_m), draw(coordinates_m), draw(st.floats(0.02, 0.5))
    if draw(st.booleans()):
        return Obstacle(x0_m, y0_m, x0_m, y0_m, radius_m, None)
    return Obstacle(x0_m, y0_m, draw(coordinates_m), draw(coordinates_m), radius_m, 0.0)


def body_points(length_m: float, width_m: float, x_m: float, y_m: float, heading_rad: float) -> Points:
    """Points all over the body, its outline included; north and east from the pose."""
    share = np.linspace(-0.5, 0.5, SAMPLES)
    ahead, right = (axis.ravel() for axis in np.meshgrid(share * length_m, share * width_m))
    sin_h, cos_h = sin(heading_rad), cos(heading_rad)
    return np.stack([x_m + ahead * sin_h + right * cos_h, y_m + ahead * cos_h - right * sin_h])


def gap_m(points: Points, obstacle: Obstacle) -> float:
    """Return the distance from the nearest of the points to the surface, negative inside."""
    start = np.array([[obstacle.x0_m], [obstacle.y0_m]])
    along = np.array([[obstacle.x1_m], [obstacle.y1_m]]) - start
    share = ((points - start) * along).sum(axis=0) / max(float((along**2).sum()), 1e-300)
    nearest = start + np.clip(share, 0.0, 1.0) * along
    return float(np.hypot(*(points - nearest)).min()) - obstacle.radius_m


@given(
    obstacle=obstacles(), sides=st.tuples(sides_m, sides_m), pose=st.tuples(coordinates_m, coordinates_m, headings_rad)
)
def test_contact_is_where_a_point_of_the_body_is_inside_the_obstacle(
    obstacle: Obstacle, sides: tuple[float, float], pose: tuple[float, float, float]
) -> None:
    x_m, y_m, heading_rad = pose
    sampled_gap_m = gap_m(body_points(*sides, *pose), obstacle)
    # The nearest point of the body is within half a diagonal of the grid from one of the samples.
    coarseness_m = hypot(*sides) / (SAMPLES - 1) / 2
    assume(not 0.0 <= sampled_gap_m <= coarseness_m + 1e-9)
    body = BodyOutline(*sides)
    assert body.overlaps(obstacle, x_m, y_m, sin(heading_rad), cos(heading_rad)) == (sampled_gap_m < 0.0)


@pytest.mark.parametrize(
    ("x_m", "y_m", "touches"),
    [
        (0.44, 0.0, True),
        (0.46, 0.0, False),
        (0.0, 0.69, True),
        (0.0, 0.71, False),
        (0.37, 0.62, True),  # off the corner (0.2, 0.45) by 0.24 m
        (0.38, 0.63, False),  # and by 0.255 m
    ],
)
def test_tree_touches_sides_and_corners_of_a_long_body(x_m: float, y_m: float, touches: bool) -> None:
    tree = Obstacle(x_m, y_m, x_m, y_m, 0.25, None)
    assert BodyOutline(0.9, 0.4).overlaps(tree, 0.0, 0.0, 0.0, 1.0) is touches


@pytest.mark.parametrize(("north_m", "touches"), [(0.0, True), (0.4, True), (-0.4, True), (0.46, False)])
def test_thin_trunk_across_the_body_touches_though_ends_and_corners_are_far(north_m: float, touches: bool) -> None:
    trunk = Obstacle(-5.0, north_m, 5.0, north_m, 0.001, 90.0)
    assert BodyOutline(0.9, 0.4).overlaps(trunk, 0.0, 0.0, 0.0, 1.0) is touches


@given(listed=st.lists(obstacles(), max_size=8), x_m=st.floats(-6, 6), y_m=st.floats(-6, 6), stretch=st.floats(1, 8))
def test_map_knows_everything_near_a_place(listed: list[Obstacle], x_m: float, y_m: float, stretch: float) -> None:
    listed = [
        Obstacle(o.x0_m, o.y0_m, o.x0_m + (o.x1_m - o.x0_m) * stretch, o.y1_m, o.radius_m, o.axis_deg) for o in listed
    ]
    here = np.array([[x_m], [y_m]])
    near = ObstacleGrid(listed, near_m=1.5).near(x_m, y_m)
    assert {o for o in listed if gap_m(here, o) <= 1.5} <= set(near) <= set(listed)


def test_forest_becomes_capsules_with_their_bearing_and_circles_without() -> None:
    trunks = (Trunk(0.0, 0.0, 0.0, 5.0, "left"), Trunk(9.0, 9.0, 4.0, 4.0, "across"), Trunk(1, 1, 3, -1, "across"))
    forest = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, trunks, ((7.0, 8.0),))
    *capsules, tree = obstacles_of(forest)
    assert [capsule.axis_deg for capsule in capsules] == pytest.approx([0.0, 45.0, 135.0])
    assert {capsule.radius_m for capsule in capsules} == {0.15}
    assert (tree.x0_m, tree.y0_m, tree.x1_m, tree.y1_m) == (7.0, 8.0, 7.0, 8.0)
    assert (tree.radius_m, tree.axis_deg) == (0.25, None)
