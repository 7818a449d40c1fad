"""The MuJoCo model of a trial: a skid-steered rover with four driven wheels, ground, trunks and trees; its contacts.

The body's pose is read here as well, and it is put down here, level and clear of every obstacle. All lengths
are in metres; x is east, y north, z up. The rover's own axes are x ahead, y to the left, z up.

*A wheel is an ellipsoid*: it meets the ground in one point. A cylinder meets it along a line, whose ends catch on rough
ground and while the body turns, and whose share of the moment of skid friction has no closed form. The tyre is soft
(it gives way by some 3 mm): with MuJoCo's hard default a wheel that slides hops, and the body turns a third too slowly.

*A motor* has a straight line of torque over speed, from the stall torque to the free speed, at each duty; a board that
has duty 0 shorts it, so it brakes. Behind it is the tyre's rolling resistance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import asin, atan2, cos, degrees, pi, radians, sin
from typing import Any, NamedTuple

import mujoco

from wayfarer.angles import clamp
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.mujoco.ground import HeightField, Nearby
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.forest import WORLD_SIZE_M
from wayfarer.simhal.world.physics import Terrain
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.simhal.world.wheeled_body import (
    ROLLING_RESISTANCE,
    ROTOR_SHARE_OF_WEIGHT,
    WHEEL_SHARE_OF_WEIGHT,
    WheeledBody,
)

STEP_S = 0.004
TREE_HEIGHT_M = 2.0

# Contacts. A time constant of 5 steps is stiff and has room to spare. The tyre's impedance rises from 0.2 to 0.8 over
# 5 mm. ``IMPRATIO`` makes friction that much stiffer than the tyre, so that a wheel that holds does not creep.
CONTACT_TIME_S = 0.02
TYRE_IMPEDANCE = (0.2, 0.8, 0.005)
IMPRATIO = 100.0
GROUND_BIT, ROVER_BIT = 2, 1  # the rover meets the ground and what stands on it, and nothing of the rest

ROVER = "rover"
WHEELS_TO_DRIVE = 3  # with fewer on anything, a rover whose belly is on something does not get away; chosen by us

# Without a hearer the engine writes its warnings to MUJOCO_LOG.TXT in the folder it runs in. Nothing is lost: each
# world's data count its own, and ``refuse`` says them.
if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(lambda _text: None)


def build_spec(
    body: WheeledBody, terrain: Terrain, field: HeightField | None, obstacles: list[Obstacle], step_s: float = STEP_S
) -> Any:
    """Return the model to compile: geom 0 is the ground, then come the obstacles, then the rover's body and wheels.

    Wheels and motors are in the order front left, rear left, front right, rear right.
    """
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep = step_s
    option.gravity = (0.0, 0.0, -STANDARD_GRAVITY_M_S2)
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = IMPRATIO
    # A body that is thrown about beyond reason is an error, not a reason to begin the trial again.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # One free body among some dozens of obstacles: a tree of their boxes, and islands, cost more than they save.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
    _add_ground(spec, field, _surface(terrain.friction))
    _add_obstacles(spec, obstacles, _surface(terrain.friction))
    _add_rover(spec, body, terrain)
    return spec


def _surface(friction: float) -> dict[str, Any]:
    """Return the properties of ground and wood; they count against the rover's body, whose own count for less."""
    return {
        "contype": GROUND_BIT,
        "conaffinity": ROVER_BIT,
        "friction": (friction, 0.0, 0.0),
        "solref": (CONTACT_TIME_S, 1.0),
        "priority": 1,
    }


def _add_ground(spec: Any, field: HeightField | None, surface: dict[str, Any]) -> None:
    if field is None:
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 1.0), **surface)
        return
    heights_m, centre_m = field.heights_m, WORLD_SIZE_M / 2.0
    lowest_m, highest_m = float(heights_m.min()), float(heights_m.max())
    spec.add_hfield(
        name="ground",
        size=(field.half_size_m, field.half_size_m, highest_m - lowest_m, 1.0),
        nrow=heights_m.shape[0],
        ncol=heights_m.shape[1],
        userdata=((heights_m - lowest_m) / (highest_m - lowest_m)).ravel(),
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", pos=(centre_m, centre_m, lowest_m), **surface
    )


def _add_obstacles(spec: Any, obstacles: list[Obstacle], surface: dict[str, Any]) -> None:
    """Add each trunk, lying on the ground, and each tree, standing in it."""
    for obstacle in obstacles:
        radius_m = obstacle.radius_m
        ends_m = (0.0, TREE_HEIGHT_M) if obstacle.axis_deg is None else (radius_m, radius_m)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(obstacle.x0_m, obstacle.y0_m, ends_m[0], obstacle.x1_m, obstacle.y1_m, ends_m[1]),
            size=(radius_m, 0.0, 0.0),
            **surface,
        )


def _add_rover(spec: Any, body: WheeledBody, terrain: Terrain) -> None:
    rover = spec.worldbody.add_body(name=ROVER)
    rover.add_freejoint()
    half_base_m, half_track_m, radius_m = body.wheels
    belly_to_top_m = body.height_m - body.clearance_m
    of_the_rover = {"contype": ROVER_BIT, "conaffinity": GROUND_BIT, "solref": (CONTACT_TIME_S, 1.0)}
    rover.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(*body.box_half_m, belly_to_top_m / 2.0),
        pos=(0.0, 0.0, body.clearance_m + belly_to_top_m / 2.0 - radius_m),
        mass=body.weight_kg * (1.0 - 4.0 * WHEEL_SHARE_OF_WEIGHT),
        **of_the_rover,
    )
    for name, ahead, left in (("fl", 1, 1), ("rl", -1, 1), ("fr", 1, -1), ("rr", -1, -1)):
        wheel = rover.add_body(pos=(ahead * half_base_m, left * half_track_m, 0.0))
        wheel.add_joint(
            name=name,
            axis=(0.0, 1.0, 0.0),
            armature=ROTOR_SHARE_OF_WEIGHT * body.weight_kg * radius_m**2,
            frictionloss=ROLLING_RESISTANCE * body.weight_kg / 4.0 * STANDARD_GRAVITY_M_S2 * radius_m,
        )
        wheel.add_geom(
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=(radius_m, body.tyre_width_m / 2.0, radius_m),
            mass=body.weight_kg * WHEEL_SHARE_OF_WEIGHT,
            friction=(terrain.friction, 0.0, 0.0),
            solimp=(*TYRE_IMPEDANCE, 0.5, 2.0),
            priority=2,  # the tyre's own softness counts, and the friction of what is under each wheel
            **of_the_rover,
        )
        # A motor whose control is its duty: torque = stall x (duty - speed / free speed).
        stall_n_m, free_rad_s = body.motors_n_m * terrain.torque_scale / 4.0, body.free_speed_m_s / radius_m
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gainprm[0] = stall_n_m
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.biasprm[2] = -stall_n_m / free_rad_s
    # Holds the body where it is while it is snagged; see ``world``.
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="world", name2=ROVER, active=False
    )


class Contacts:
    """The rover's contacts with the ground and with ``obstacles``, the first ``felt`` of which a bumper feels.

    Geoms are in the order of ``build_spec``.
    """

    def __init__(self, data: Any, obstacles: Sequence[Obstacle], felt: int) -> None:
        self._data = data
        self._obstacles = obstacles
        self._felt = felt
        self.belly = 1 + len(obstacles)

    def with_obstacles(self) -> bool:
        """Return whether belly or wheels touch any obstacle, felt or not."""
        return any(0 < geom < self.belly for pair in self._data.contact.geom.tolist() for geom in pair)

    def feel(self) -> tuple[Obstacle | None, bool]:
        """Return what a bumper feels, and whether the body lies on its belly with too few wheels to drive off."""
        touched, on_belly, belly, felt = None, False, self.belly, self._felt
        pairs = self._data.contact.geom.tolist()  # the engine sorts a pair by the types of its geoms: the rover is last
        for other, own in pairs:
            if own == belly:
                on_belly = True
            if 0 < other <= felt and touched is None:
                touched = self._obstacles[other - 1]
        return touched, on_belly and len({own for _, own in pairs if own != belly}) < WHEELS_TO_DRIVE


class Unstable(ArithmeticError):
    """The engine could not work the motion out; the trial says nothing. The text has what the engine warned of."""


def raise_unstable(data: Any, t_s: float) -> None:
    """End a trial whose motion could not be worked out up to this time.

    Raises:
        Unstable: always.
    """
    warned = (each for each in enumerate(data.warning) if each[1].number)
    texts = [mujoco.mju_warningText(kind, trouble.lastinfo) for kind, trouble in warned]
    said = " ".join(texts) or "the rover's place is not a number"
    raise Unstable(f"MuJoCo could not work out the motion up to {t_s:.3f} s: {said}")


# -- pose -------------------------------------------------------------------------------------------------------------
# Pose of the body from the engine's state, distance over ground at its middle, and the forces of faults.

SHOVE_S = 0.1  # in which a shove brings the body to its speed
MOST_WEIGHTS = 2.0  # and with no more force than this many times its weight


class Pose(NamedTuple):
    """Of the middle between the wheels: metres east and north, radians clockwise from north, nose up, right down."""

    x_m: float
    y_m: float
    heading_rad: float
    pitch_deg: float
    roll_deg: float


def pose_of(qpos: Sequence[float]) -> Pose:
    """Return the pose of a free body: from its axis ahead, and how it is turned about that."""
    x_m, y_m, _, w, x, y, z = qpos
    return Pose(
        x_m,
        y_m,
        atan2(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)),
        degrees(asin(clamp(2.0 * (x * z - w * y), -1.0, 1.0))),
        degrees(atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))),
    )


class Displacement:
    """Adds up, look by look, how far the body of a world has moved along its own axes; ``start_at`` comes first.

    The world's ``forward_m``, ``reverse_m`` and ``right_m`` are how far until the latest pose.
    """

    def __init__(self, world: SimulatedWorld) -> None:
        self._world = world
        self._forward_m = self._reverse_m = self._right_m = 0.0  # until the latest look

    def start_at(self, pose: Pose) -> None:
        """Count from here on, as after the body was carried."""
        self._x_m, self._y_m = pose.x_m, pose.y_m
        world = self._world
        world.forward_m, world.reverse_m, world.right_m = self._forward_m, self._reverse_m, self._right_m

    def follow(self, pose: Pose) -> float:
        """Take the latest pose; return how far it is ahead of the latest look, negative backwards."""
        east_m, north_m = pose.x_m - self._x_m, pose.y_m - self._y_m
        sin_h, cos_h = sin(pose.heading_rad), cos(pose.heading_rad)
        ahead_m = east_m * sin_h + north_m * cos_h
        world = self._world
        world.forward_m = self._forward_m + max(ahead_m, 0.0)
        world.reverse_m = self._reverse_m - min(ahead_m, 0.0)
        world.right_m = self._right_m + (east_m * cos_h - north_m * sin_h)
        return ahead_m

    def look(self, pose: Pose) -> float:
        """Take the latest pose and keep what has been moved; return how much of it was ahead, negative backwards."""
        ahead_m, world = self.follow(pose), self._world
        self._forward_m, self._reverse_m, self._right_m = world.forward_m, world.reverse_m, world.right_m
        self._x_m, self._y_m = pose.x_m, pose.y_m
        return ahead_m


def gravity_m_s2(pitch_deg: float, roll_deg: float, heading_rad: float) -> tuple[float, float, float]:
    """Return gravity east, north and up as it pulls on ground that slopes so under a body with this heading."""
    pitch_rad, roll_rad = radians(pitch_deg), radians(roll_deg)
    sin_h, cos_h = sin(heading_rad), cos(heading_rad)
    ahead_m_s2 = -STANDARD_GRAVITY_M_S2 * sin(pitch_rad)
    right_m_s2 = STANDARD_GRAVITY_M_S2 * cos(pitch_rad) * sin(roll_rad)
    down_m_s2 = STANDARD_GRAVITY_M_S2 * cos(pitch_rad) * cos(roll_rad)
    return ahead_m_s2 * sin_h + right_m_s2 * cos_h, ahead_m_s2 * cos_h - right_m_s2 * sin_h, -down_m_s2


def shove_n(weight_kg: float, wanted_m_s: float, speed_m_s: float) -> float:
    """Return the force ahead that brings a body from one speed to another."""
    most_n = MOST_WEIGHTS * weight_kg * STANDARD_GRAVITY_M_S2
    return clamp(weight_kg * (wanted_m_s - speed_m_s) / SHOVE_S, -most_n, most_n)


# -- putting the body down ---------------------------------------------------------------------------------------------

PUT_DOWN_FROM_M = 0.005
STEP_M = 0.01  # between two places that are tried
WITHIN_LENGTHS = 3.0  # of the body, around where it is; chosen by us: as far as a person carries it and says "here"
DIRECTIONS = tuple(pi + turned * pi / 4.0 for turned in (0, 1, -1, 2, -2, 3, -3, 4))  # from straight behind to ahead

Place = tuple[float, float]


class NoRoom(RuntimeError):
    """There is no free ground near the rover to put it down on; the trial cannot continue."""


class Placement:
    """Puts a body elsewhere in its world; what it touches there are ``contacts``, of what is ``nearby``."""

    def __init__(
        self,
        model: Any,
        data: Any,
        body: WheeledBody,
        field: HeightField | None,
        contacts: Contacts,
        nearby: Nearby,
    ) -> None:
        self._model, self._data = model, data
        self._body = body
        self._field = field
        self._contacts = contacts
        self._nearby = nearby

    def lift_to(self, x_m: float, y_m: float, heading_rad: float, above_m: float = PUT_DOWN_FROM_M) -> None:
        """Hold the body level, this much above the highest ground under it, at rest."""
        self._nearby.follow(x_m, y_m)
        data, body = self._data, self._body
        reach_m = max(body.length_m, body.width_m) / 2.0
        ground_m = self._field.top_m(x_m, y_m, reach_m) if self._field else 0.0
        half_rad = (radians(90.0) - heading_rad) / 2.0  # the body's x axis is ahead, and 0 is north
        data.qpos[:3] = x_m, y_m, ground_m + body.wheel_radius_m + above_m
        data.qpos[3:7] = cos(half_rad), 0.0, 0.0, sin(half_rad)
        data.qvel[:] = 0.0

    def free_places(self, x_m: float, y_m: float, heading_rad: float, back_m: float) -> Iterator[Place]:
        """Yield where the body is free with this heading: the best place first.

        From where it is, or else from the nearest free place around, the body goes back as far as is free up to
        ``back_m``. Of equally near places the one behind comes first: that is where it came from.

        Raises:
            NoRoom: once there are no more places.
        """
        for near in self._around(x_m, y_m, heading_rad):
            if self._is_free(*near, heading_rad):
                yield self._further_back(*near, heading_rad, back_m)
        raise NoRoom(f"no free ground near x = {x_m:.2f} m, y = {y_m:.2f} m to put the rover down on")

    def _around(self, x_m: float, y_m: float, heading_rad: float) -> Iterator[Place]:
        yield x_m, y_m
        for ring in range(1, round(WITHIN_LENGTHS * self._body.length_m / STEP_M) + 1):
            for turned_rad in DIRECTIONS:
                yield _moved(x_m, y_m, heading_rad + turned_rad, ring * STEP_M)

    def _further_back(self, x_m: float, y_m: float, heading_rad: float, back_m: float) -> Place:
        free = x_m, y_m
        for step in range(1, round(back_m / STEP_M) + 1):
            behind = _moved(x_m, y_m, heading_rad + pi, step * STEP_M)
            if not self._is_free(*behind, heading_rad):
                break
            free = behind
        return free

    def _is_free(self, x_m: float, y_m: float, heading_rad: float) -> bool:
        self.lift_to(x_m, y_m, heading_rad, above_m=0.0)
        mujoco.mj_fwdPosition(self._model, self._data)
        return not self._contacts.with_obstacles()


def _moved(x_m: float, y_m: float, bearing_rad: float, distance_m: float) -> Place:
    return x_m + distance_m * sin(bearing_rad), y_m + distance_m * cos(bearing_rad)
