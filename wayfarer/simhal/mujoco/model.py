"""The MuJoCo model of a trial: a skid-steered rover with four driven wheels, ground, trunks and trees; its contacts.

All lengths are in metres; x is east, y north, z up. The rover's own axes are x ahead, y to the left, z up.

*A wheel is an ellipsoid*: it meets the ground in one point. A cylinder meets it along a line, whose ends catch on rough
ground and while the body turns, and whose share of the moment of skid friction has no closed form. The tyre is soft
(it gives way by some 3 mm): with MuJoCo's hard default a wheel that slides hops, and the body turns a third too slowly.

*A motor* has a straight line of torque over speed, from the stall torque to the free speed, at each duty; a board that
is told 0 shorts it, so it brakes. Behind it is the tyre's rolling resistance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco

from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.mujoco.ground import HeightField
from wayfarer.simhal.mujoco.terrain import Terrain
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.forest import WORLD_SIZE_M
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
    for x0_m, y0_m, x1_m, y1_m, radius_m, axis_deg in obstacles:
        ends_m = (0.0, TREE_HEIGHT_M) if axis_deg is None else (radius_m, radius_m)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(x0_m, y0_m, ends_m[0], x1_m, y1_m, ends_m[1]),
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
