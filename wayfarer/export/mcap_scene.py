"""The scene of the 3D panel: poses, forest, bodies and paths.

Axes are those of Foxglove and ROS (REP 103), metres: x east, y north, z up; of a body x ahead, y left, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, degrees, hypot, radians, sin
from typing import Any, NamedTuple

from foxglove.messages import (
    ArrowPrimitive,
    Color,
    CubePrimitive,
    CylinderPrimitive,
    FrameTransform,
    LinePrimitive,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    Timestamp,
    Vector3,
)

from wayfarer.fieldlog.record import World
from wayfarer.logview import palette
from wayfarer.logview.trail import Trail


class Rotation(NamedTuple):
    """A unit quaternion."""

    x: float
    y: float
    z: float
    w: float


def enu_rotation(heading_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Rotation:
    """Return a body's rotation in the map; pitch is positive nose up, roll right side down, turned in this order.

    A compass counts clockwise from north, a map counter-clockwise from east.
    """
    half = [radians(angle_deg) / 2.0 for angle_deg in (90.0 - heading_deg, -pitch_deg, roll_deg)]
    (c_yaw, s_yaw), (c_pitch, s_pitch), (c_roll, s_roll) = ((cos(angle), sin(angle)) for angle in half)
    return Rotation(
        x=s_roll * c_pitch * c_yaw - c_roll * s_pitch * s_yaw,
        y=c_roll * s_pitch * c_yaw + s_roll * c_pitch * s_yaw,
        z=c_roll * c_pitch * s_yaw - s_roll * s_pitch * c_yaw,
        w=c_roll * c_pitch * c_yaw + s_roll * s_pitch * s_yaw,
    )


MAP, ROVER, TRUTH = "map", "rover", "truth"  # frames: the world, the rover as it believes to be, and as it is


def _colour(name: str, opaque: float = 1.0) -> Color:
    """Return a colour of the palette."""
    red, green, blue = (part / 255.0 for part in bytes.fromhex(name.removeprefix("#")))
    return Color(r=red, g=green, b=blue, a=opaque)


COLOURS = {ROVER: _colour(palette.BLUE, 0.8), TRUTH: _colour(palette.ORANGE, 0.8)}
TREE_HEIGHT_M, BODY_HEIGHT_M, LINE_M = 2.0, 0.25, 0.05  # only for the eye: nothing in a log says how high or thick
GOAL_HALF_LENGTH_M = 25.0  # to either side of the start: the simulated forest's half width

POINTS = 1000  # of a path, at most: 20 kB a message, and drawn again in a fraction of a millisecond
SPACING_M = 0.1  # of the first hundred metres: a quarter of a rover's length
DRAW_EVERY_S = 1.0  # a path is drawn whole each time, so that the newest message is all that a viewer needs


class DrawnPath(Trail):
    """The path of a frame so far, which is drawn now and then."""

    def __init__(self) -> None:
        super().__init__(POINTS, SPACING_M)
        self._drawn_s = float("-inf")
        self._grown = False

    def grow(self, x_m: float, y_m: float) -> None:
        """Lengthen the path."""
        self._grown |= self.add(x_m, y_m)
        self.thin()

    def is_due(self, t_s: float) -> bool:
        """Return whether it has grown and is due to be drawn; then it counts as drawn."""
        due = self._grown and t_s >= self._drawn_s + DRAW_EVERY_S
        if due:
            self._drawn_s, self._grown = t_s, False
        return due


def orientation(heading_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Quaternion:
    """Return a body's rotation in the map, as ``enu_rotation`` has it."""
    return Quaternion(**enu_rotation(heading_deg, pitch_deg, roll_deg)._asdict())


def transform(time: Timestamp, child: str, x_m: float, y_m: float, rotation: Quaternion) -> FrameTransform:
    """Return where a frame is in the map."""
    return FrameTransform(
        timestamp=time, parent_frame_id=MAP, child_frame_id=child, translation=Vector3(x=x_m, y=y_m), rotation=rotation
    )


def forest_scene(time: Timestamp, world: World) -> SceneUpdate:
    """Return a simulated forest, given as a line of a forest file: fallen trunks, standing trees and the goal line."""
    tree_m = 2.0 * world.tree_radius_m
    trunks = [_trunk(x0_m, y0_m, x1_m, y1_m, wide_m) for (x0_m, y0_m, x1_m, y1_m, _), wide_m in world.thick_trunks]
    trees = [
        _cylinder(Vector3(x=x_m, y=y_m, z=TREE_HEIGHT_M / 2.0), _LEVEL, tree_m, TREE_HEIGHT_M, palette.TREE)
        for x_m, y_m, *_ in world.trees_m
    ]
    start_x_m, goal_y_m = world.start_m[0], world.goal_y_m
    ends = [Point3(x=start_x_m + side * GOAL_HALF_LENGTH_M, y=goal_y_m) for side in (-1.0, 1.0)]
    return SceneUpdate(
        entities=[
            SceneEntity(timestamp=time, frame_id=MAP, id="forest", cylinders=[*trunks, *trees]),
            SceneEntity(timestamp=time, frame_id=MAP, id="goal", lines=[_line(ends, _colour(palette.GOAL_LINE))]),
        ]
    )


def body_scene(time: Timestamp, length_m: float, width_m: float, frames: Sequence[str]) -> SceneUpdate:
    """Return a rover's body in each of these frames, with which it moves; the arrow points ahead."""
    size = Vector3(x=length_m, y=width_m, z=BODY_HEIGHT_M)
    middle = Pose(position=Vector3(z=BODY_HEIGHT_M / 2.0), orientation=_LEVEL)
    nose = Pose(position=Vector3(x=length_m / 2.0, z=BODY_HEIGHT_M / 2.0), orientation=_LEVEL)
    shaft: Any = {"shaft_length": length_m / 2.0, "shaft_diameter": length_m / 8.0}
    head: Any = {"head_length": length_m / 4.0, "head_diameter": length_m / 4.0}
    return SceneUpdate(
        entities=[
            SceneEntity(
                timestamp=time,
                frame_id=frame,
                id=frame,
                frame_locked=True,
                cubes=[CubePrimitive(pose=middle, size=size, color=COLOURS[frame])],
                arrows=[ArrowPrimitive(pose=nose, color=COLOURS[frame], **shaft, **head)],
            )
            for frame in frames
        ]
    )


def path_scene(time: Timestamp, frame: str, points: list[Point3]) -> SceneUpdate:
    """Return the path on which a frame came, in the map."""
    lines = [_line(points, COLOURS[frame])]
    return SceneUpdate(entities=[SceneEntity(timestamp=time, frame_id=MAP, id=f"{frame} path", lines=lines)])


_LEVEL = orientation(90.0)  # to the east: no rotation at all


def _trunk(x0_m: float, y0_m: float, x1_m: float, y1_m: float, diameter_m: float) -> CylinderPrimitive:
    """Return a lying trunk: a cylinder stands along z, and nose down that is where the body looks."""
    east_m, north_m = x1_m - x0_m, y1_m - y0_m
    lying = orientation(degrees(atan2(east_m, north_m)), pitch_deg=-90.0)
    middle = Vector3(x=(x0_m + x1_m) / 2.0, y=(y0_m + y1_m) / 2.0, z=diameter_m / 2.0)
    return _cylinder(middle, lying, diameter_m, hypot(east_m, north_m), palette.TRUNK)


def _cylinder(
    middle: Vector3, turned: Quaternion, diameter_m: float, length_m: float, colour: str
) -> CylinderPrimitive:
    size, pose = Vector3(x=diameter_m, y=diameter_m, z=length_m), Pose(position=middle, orientation=turned)
    return CylinderPrimitive(pose=pose, size=size, bottom_scale=1.0, top_scale=1.0, color=_colour(colour))


def _line(points: list[Point3], colour: Color) -> LinePrimitive:
    pose = Pose(position=Vector3(), orientation=_LEVEL)
    return LinePrimitive(pose=pose, thickness=LINE_M, points=points, color=colour)
