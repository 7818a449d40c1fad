"""The bodies of a trial as a model of MuJoCo: a skid-steered rover on four driven wheels, the ground, trunks and trees.

All lengths are in metres; x is east, y north, z up. The rover's own axes are x ahead, y to the left, z up.

*A wheel is an ellipsoid*: it meets the ground in one point. A cylinder meets it along a line, whose ends catch on rough
ground and while the body turns, and whose share of the moment of skid friction has no closed form. The tyre is soft
(it gives way by some 3 mm): with MuJoCo's hard default a wheel that slides hops, and the body turns a third too slowly.

*A motor* has a straight line of torque over speed, from the stall torque to the free speed, at each duty; a board that
is told 0 shorts it, so it brakes. Behind it is the tyre's rolling resistance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco

from wayfarer.chassis import ON_WHEELS, STANDARD_GRAVITY_M_S2, Chassis
from wayfarer.errors import BadConfig
from wayfarer.escape.api import Vehicle
from wayfarer.simhal.forest import WORLD_SIZE_M
from wayfarer.simhal.mujoco.ground import HeightField
from wayfarer.simhal.mujoco.terrain import Terrain
from wayfarer.simhal.obstacles import Obstacle

STEP_S = 0.004

# From no source, chosen to be plain; none of them decides where a closed form of the tests lies.
TYRE_WIDTH_PER_RADIUS = 0.9
WHEEL_SHARE_OF_WEIGHT = 0.03  # each; the rest is spread evenly over the body
# What each motor's rotor adds to the inertia, as if this share of the weight were at the rim of its wheel: 0.6 kg for
# ForestRover. A rotor of 5e-6 kg m2 behind a gear of 1 to 27 would be 0.9 kg there.
ROTOR_SHARE_OF_WEIGHT = 0.1
ROLLING_RESISTANCE = 0.05  # of the load: small tyres on firm soil; on leaf litter up to twice that
TREE_HEIGHT_M = 2.0
# Where a file gives no ground clearance, as that of the abstract rover: ForestRover's 41 mm over its 65 mm.
CLEARANCE_PER_RADIUS = 0.041 / 0.065

# Contacts. A time constant of 5 steps is stiff and has room to spare. The tyre's impedance rises from 0.2 to 0.8 over
# 5 mm. ``IMPRATIO`` makes friction that much stiffer than the tyre, so that a wheel that holds does not creep.
CONTACT_TIME_S = 0.02
TYRE_IMPEDANCE = (0.2, 0.8, 0.005)
IMPRATIO = 100.0
GROUND_BIT, ROVER_BIT = 2, 1  # the rover meets the ground and what stands on it, and nothing of the rest

ROVER = "rover"

# Without a hearer the engine writes its warnings to MUJOCO_LOG.TXT in the folder it runs in. Nothing is lost: each
# world's data count its own, and ``unstable.refuse`` says them.
if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(lambda _text: None)


class Wheels(NamedTuple):
    """Where the four wheels stand: half the wheelbase, half the distance between left and right, and their radius."""

    half_base_m: float
    half_track_m: float
    radius_m: float


class Body(NamedTuple):
    """What a rover file tells of the body, all of it known.

    ``motors_n_m`` is the stall torque of all four motors together.
    """

    length_m: float
    width_m: float
    height_m: float
    clearance_m: float
    weight_kg: float
    wheel_radius_m: float
    motors_n_m: float
    free_speed_m_s: float

    @property
    def tyre_width_m(self) -> float:
        """How wide a tyre is."""
        return TYRE_WIDTH_PER_RADIUS * self.wheel_radius_m

    @property
    def wheels(self) -> Wheels:
        """Where the wheels stand: their outer edges are the body's outline."""
        radius_m = self.wheel_radius_m
        return Wheels(self.length_m / 2.0 - radius_m, (self.width_m - self.tyre_width_m) / 2.0, radius_m)

    @property
    def centre_of_mass_m(self) -> float:
        """Height of the centre of mass above the ground."""
        wheels = 4.0 * WHEEL_SHARE_OF_WEIGHT
        return wheels * self.wheel_radius_m + (1.0 - wheels) * (self.clearance_m + self.height_m) / 2.0


def body_of(name: str, vehicle: Vehicle, chassis: Chassis) -> Body:
    """Return the body of a rover of this name.

    Raises:
        BadConfig: its file does not give all that a body with wheels needs, or gives what cannot be built.
    """
    if missing := chassis.missing(ON_WHEELS):
        raise BadConfig(
            f"rover '{name}' gives no chassis.{missing[0]}, and --physics mujoco needs a body with wheels;"
            " take --rover sim, forestrover or minirover, or add [chassis] to its file as theirs have it"
        )
    weight_kg, motors_n_m, radius_m, height_m = (getattr(chassis, key) for key in ON_WHEELS)
    given_m = chassis.ground_clearance_m
    clearance_m = CLEARANCE_PER_RADIUS * radius_m if given_m is None else given_m
    if not 4.0 * radius_m < vehicle.length_m:
        raise BadConfig(
            f"rover '{name}': chassis.wheel_radius_m = {radius_m:g}: two wheels behind each other do not fit into"
            f" vehicle.length_m = {vehicle.length_m:g}; it is the radius, not the diameter"
        )
    if not clearance_m < min(height_m, 2.0 * radius_m):
        raise BadConfig(
            f"rover '{name}': a ground clearance of {clearance_m:g} m must be below chassis.height_m"
            f" = {height_m:g} and below the wheels' diameter of {2.0 * radius_m:g}"
        )
    if not vehicle.width_m > 2.5 * TYRE_WIDTH_PER_RADIUS * radius_m:
        raise BadConfig(
            f"rover '{name}': vehicle.width_m = {vehicle.width_m:g} leaves no room between wheels of"
            f" chassis.wheel_radius_m = {radius_m:g}"
        )
    return Body(
        vehicle.length_m, vehicle.width_m, height_m, clearance_m, weight_kg, radius_m, motors_n_m, vehicle.max_speed_m_s
    )


def build(
    body: Body, terrain: Terrain, field: HeightField | None, obstacles: list[Obstacle], step_s: float = STEP_S
) -> Any:
    """Return the compiled model: geom 0 is the ground, then come the obstacles, then the rover's body and wheels.

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
    _add_ground(spec, field, _surface(terrain.friction))
    _add_obstacles(spec, obstacles, _surface(terrain.friction))
    _add_rover(spec, body, terrain)
    return spec.compile()


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
    for x0_m, y0_m, x1_m, y1_m, radius_m, axis_deg in obstacles:
        ends_m = (0.0, TREE_HEIGHT_M) if axis_deg is None else (radius_m, radius_m)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(x0_m, y0_m, ends_m[0], x1_m, y1_m, ends_m[1]),
            size=(radius_m, 0.0, 0.0),
            **surface,
        )


def _add_rover(spec: Any, body: Body, terrain: Terrain) -> None:
    rover = spec.worldbody.add_body(name=ROVER)
    rover.add_freejoint()
    half_base_m, half_track_m, radius_m = body.wheels
    belly_to_top_m = body.height_m - body.clearance_m
    of_the_rover = {"contype": ROVER_BIT, "conaffinity": GROUND_BIT, "solref": (CONTACT_TIME_S, 1.0)}
    rover.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        # The wheels stand out by half a radius ahead and behind.
        size=(half_base_m + radius_m / 2.0, body.width_m / 2.0 - 1.1 * body.tyre_width_m, belly_to_top_m / 2.0),
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
        _add_motor(spec, name, body.motors_n_m * terrain.torque_scale / 4.0, body.free_speed_m_s / radius_m)
    # Holds the body where it is while it is snagged; see ``world``.
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="world", name2=ROVER, active=False
    )


def _add_motor(spec: Any, joint: str, stall_n_m: float, free_rad_s: float) -> None:
    """Add a motor whose control is its duty: torque = stall x (duty - speed / free speed)."""
    motor = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.gainprm[0] = stall_n_m
    motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    motor.biasprm[2] = -stall_n_m / free_rad_s
