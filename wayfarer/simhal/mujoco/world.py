"""The rover's world in MuJoCo: the same seam as ``simhal.world.World``, with wheels that grip and slip.

The engine takes steps of ``model.STEP_S``; every ``LOOK_EVERY`` of them the world looks round: what touches, what is
under the wheels, and the referee. What is read in between is where the body is, never what was seen last, so that
nothing depends on the order and the rates in which parts ask.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import asin, atan2, cos, degrees, inf, radians, sin

import mujoco

from wayfarer.simhal.forest import Forest
from wayfarer.simhal.mujoco.forces import gravity_m_s2, shove_n
from wayfarer.simhal.mujoco.ground import MUD_FRICTION, Mud, rough_ground
from wayfarer.simhal.mujoco.model import ROVER, STEP_S, build
from wayfarer.simhal.mujoco.terrain import Terrain
from wayfarer.simhal.obstacles import low_trunks_of, obstacles_of
from wayfarer.simhal.physics import Physics
from wayfarer.simhal.simulated_world import (
    FULL_BATTERY_V,
    ROUNDING_S,
    UNHARMED,
    SimulatedWorld,
    Touch,
    nobody_watches,
    nothing_acts,
    side_of,
)
from wayfarer.simhal.streams import Streams
from wayfarer.simhal.wheeled_body import Body

LOOK_EVERY = 5  # steps: 20 ms, well within a control tick
SETTLES_S = 0.5  # for which a rover that is put down comes to rest on its tyres before anything counts
PUT_DOWN_FROM_M = 0.005
# Wheels slip when the ground passes less than half as fast as their rims, and not by a rounding error.
SLIPS_BELOW_SHARE, SLIPS_ABOVE_M_S = 0.5, 0.1
# A rover hangs when its belly is on something and no more than two wheels touch anything, for so long; from no source.
HANGS_AFTER_S = 5.0
WHEELS_TO_DRIVE = 3
PULLED_BY_M = 0.01


class Unstable(ArithmeticError):
    """The engine could not work the motion out; the trial says nothing."""


class MujocoWorld:
    """Ground truth of one trial; implements ``SimulatedWorld``.

    Args:
        forest: the geometry.
        body: the rover.
        physics: the noise of its senses, how unequal its sides are, how often it meets mud, and when it has tipped.
        terrain: the ground, and how strong the motors are.
        streams: where its chance comes from.
        step_s: of the engine.
    """

    def __init__(
        self,
        forest: Forest,
        body: Body,
        physics: Physics,
        terrain: Terrain,
        streams: Streams,
        step_s: float = STEP_S,
    ) -> None:
        self.physics, self.terrain, self.body = physics, terrain, body
        self.touch: Touch | None = None
        self.hangs = False
        self.field_deg = 0.0
        self.ground_pitch_deg = self.ground_roll_deg = 0.0
        self.battery_v = FULL_BATTERY_V
        self.deadman_at_s = inf
        self.chips_act: Callable[[], None] = nothing_acts
        self.after_step: Callable[[SimulatedWorld], None] = nobody_watches
        self.mishaps = UNHARMED
        self.steps = 0
        self.t_s = 0.0
        self._step_s = step_s
        self._field = rough_ground(terrain.roughness_m, streams) if terrain.roughness_m else None
        self._mud = Mud(forest, physics, body.width_m, streams)
        # What passes under the belly is there for the wheels, but nothing that a bumper feels.
        felt = obstacles_of(forest, body.clearance_m)
        self._obstacles = felt + low_trunks_of(forest, body.clearance_m)
        self._felt = len(felt)
        self.model = build(body, terrain, self._field, self._obstacles, step_s)
        self.data = mujoco.MjData(self.model)
        self._rover = self.model.body(ROVER).id
        self._belly = 1 + len(self._obstacles)
        self._muddy = [False] * 4
        self._slips = self._tilts = False
        self._hanging_s = 0.0
        self._forward_m = self._reverse_m = self._right_m = 0.0
        self._sides = streams.generator("world.rover").normal(1.0, physics.side_gain_sd, 2).tolist()
        self._put_down(*forest.start_m, radians(forest.heading_deg))
        self.command(0.0, 0.0)

    # -- what the parts and the referee see ------------------------------------------------------------------------

    @property
    def bump_deg(self) -> float:
        """Nothing: ``pitch_deg`` is that of the body, whatever is under it."""
        return 0.0

    @property
    def forward_m(self) -> float:
        """Distance driven ahead."""
        return self._forward_m + max(self._since_look_m()[0], 0.0)

    @property
    def reverse_m(self) -> float:
        """Distance driven backwards."""
        return self._reverse_m + max(-self._since_look_m()[0], 0.0)

    @property
    def right_m(self) -> float:
        """Sideways displacement, to the right."""
        return self._right_m + self._since_look_m()[1]

    @property
    def path_m(self) -> float:
        """Distance driven, forwards and backwards."""
        return self.forward_m + self.reverse_m

    @property
    def slipping(self) -> bool:
        """Whether the wheels spin; setting it spills mud where the rover stands."""
        return self._slips

    @slipping.setter
    def slipping(self, slips: bool) -> None:
        if slips:
            self._mud.spill(self.x_m, self.y_m)

    # -- what is done to it ----------------------------------------------------------------------------------------

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides, each in -1..1, from the next step on."""
        self.commanded = (left, right)
        left, right = self.mishaps.wheels(left, right)
        left, right = left * self._sides[0], right * self._sides[1]
        self.data.ctrl[:] = left, left, right, right

    def harm(self, **mishaps: float | bool) -> None:
        """Change what is wrong with the body, from the next step on."""
        self.mishaps = replace(self.mishaps, **mishaps)  # type: ignore[arg-type]
        if self.mishaps.snagged and not self.data.eq_active[0]:
            self.model.eq_data[0, 3:10] = self.data.qpos[:7]  # the weld holds the body where it is now
        self.data.eq_active[0] = self.mishaps.snagged
        if not self.mishaps.shove_m_s:
            self.data.xfrc_applied[self._rover] = 0.0
        self.command(*self.commanded)

    def pull_back(self, distance_m: float) -> None:
        """Put the body level on the ground, as far behind where it is as is free up to that distance."""
        x_m, y_m, heading_rad = self.x_m, self.y_m, self.heading_rad
        behind_m = 0.0
        while behind_m < distance_m:
            further_m = behind_m + PULLED_BY_M
            self._lift_to(x_m - further_m * sin(heading_rad), y_m - further_m * cos(heading_rad), heading_rad)
            mujoco.mj_fwdPosition(self.model, self.data)
            if any(0 < geom < self._belly for pair in self.data.contact.geom.tolist() for geom in pair):
                break
            behind_m = further_m
        self._put_down(x_m - behind_m * sin(heading_rad), y_m - behind_m * cos(heading_rad), heading_rad)
        self.command(*self.commanded)

    def advance_to(self, t_s: float) -> None:
        """Take whole steps up to a time; nothing happens where the world is there already."""
        if self.deadman_at_s <= t_s:
            self._run_to(self._steps_until(self.deadman_at_s))
            self.deadman_at_s = inf
            self.command(0.0, 0.0)
        self._run_to(self._steps_until(t_s))

    # -- the engine ------------------------------------------------------------------------------------------------

    def _steps_until(self, t_s: float) -> int:
        return int((t_s + ROUNDING_S) / self._step_s)

    def _run_to(self, steps: int) -> None:
        while self.steps < steps:
            looks_at = (self.steps // LOOK_EVERY + 1) * LOOK_EVERY
            upto = min(steps, looks_at)
            mujoco.mj_step(self.model, self.data, upto - self.steps)
            self.steps = upto
            self.t_s = upto * self._step_s
            self._read_pose()
            if upto == looks_at:
                self._look()
                self.after_step(self)

    def _read_pose(self) -> None:
        """Take the pose from the engine: the body's axis ahead, and how it is turned about that."""
        self.x_m, self.y_m, _, w, x, y, z = self.data.qpos[:7].tolist()
        self.heading_rad = atan2(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z))
        self.pitch_deg = degrees(asin(max(-1.0, min(1.0, 2.0 * (x * z - w * y)))))
        self.roll_deg = degrees(atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)))

    def _since_look_m(self) -> tuple[float, float]:
        """Return how far the body has moved ahead and to the right since the world looked round."""
        east_m, north_m = self.x_m - self._seen_x_m, self.y_m - self._seen_y_m
        sin_h, cos_h = sin(self.heading_rad), cos(self.heading_rad)
        return east_m * sin_h + north_m * cos_h, east_m * cos_h - north_m * sin_h

    def _look(self) -> None:
        if self.x_m != self.x_m:  # NaN
            raise Unstable(f"MuJoCo's state is not finite at {self.t_s:.3f} s")
        ahead_m, right_m = self._since_look_m()
        self._seen_x_m, self._seen_y_m = self.x_m, self.y_m
        self._right_m += right_m
        if ahead_m < 0.0:
            self._reverse_m -= ahead_m
        else:
            self._forward_m += ahead_m
        speed_m_s = ahead_m / (LOOK_EVERY * self._step_s)
        self._feel_contacts()
        self._feel_slip(speed_m_s)
        if self._mud.anywhere:
            self._wade()
        if self.mishaps.shove_m_s:
            self._shove(speed_m_s)
        if self._tilts or self.ground_pitch_deg or self.ground_roll_deg:
            self._tilt_ground()

    def _feel_contacts(self) -> None:
        """Note what the body touches, and whether it lies on its belly."""
        touched, on_belly, wheels = None, False, set()
        for pair in self.data.contact.geom.tolist():
            other, own = min(pair), max(pair)
            if own == self._belly:
                on_belly = True
            else:
                wheels.add(own)
            if 0 < other <= self._felt and touched is None:
                touched = self._obstacles[other - 1]
        self.touch = touched and Touch(touched, side_of(touched, self.x_m, self.y_m, self.heading_rad))
        hanging = on_belly and len(wheels) < WHEELS_TO_DRIVE
        self._hanging_s = self._hanging_s + LOOK_EVERY * self._step_s if hanging else 0.0
        self.hangs = self._hanging_s >= HANGS_AFTER_S

    def _feel_slip(self, speed_m_s: float) -> None:
        rims_m_s = sum(self.data.qvel[6:10].tolist()) / 4.0 * self.body.wheel_radius_m
        slip_m_s = abs(rims_m_s - speed_m_s)
        self._slips = slip_m_s > SLIPS_ABOVE_M_S and slip_m_s > SLIPS_BELOW_SHARE * abs(rims_m_s)

    def _wade(self) -> None:
        """Give each wheel the friction of what is under it."""
        first = self._belly + 1
        for wheel, (x_m, y_m, _) in enumerate(self.data.geom_xpos[first : first + 4].tolist()):
            muddy = self._mud.lies_at(x_m, y_m)
            if muddy is not self._muddy[wheel]:
                self._muddy[wheel] = muddy
                friction = min(MUD_FRICTION, self.terrain.friction) if muddy else self.terrain.friction
                self.model.geom_friction[first + wheel, 0] = friction

    def _shove(self, speed_m_s: float) -> None:
        """Push the body along until it goes at the speed of the shove."""
        force_n = shove_n(self.body.weight_kg, self.mishaps.shove_m_s, speed_m_s)
        self.data.xfrc_applied[self._rover, :2] = force_n * sin(self.heading_rad), force_n * cos(self.heading_rad)

    def _tilt_ground(self) -> None:
        """Let gravity pull as it does on ground that slopes so under the body; the senses add the angles."""
        self.model.opt.gravity[:] = gravity_m_s2(self.ground_pitch_deg, self.ground_roll_deg, self.heading_rad)
        self._tilts = bool(self.ground_pitch_deg or self.ground_roll_deg)

    def _lift_to(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Hold the body level just above the ground, at rest."""
        data, body = self.data, self.body
        reach_m = max(body.length_m, body.width_m) / 2.0
        ground_m = self._field.top_m(x_m, y_m, reach_m) if self._field else 0.0
        half_rad = (radians(90.0) - heading_rad) / 2.0  # the body's x axis is ahead, and 0 is north
        data.qpos[:3] = x_m, y_m, ground_m + body.wheel_radius_m + PUT_DOWN_FROM_M
        data.qpos[3:7] = cos(half_rad), 0.0, 0.0, sin(half_rad)
        data.qvel[:] = 0.0

    def _put_down(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put the body down and let it come to rest, with its wheels at rest as well."""
        self._lift_to(x_m, y_m, heading_rad)
        self.data.ctrl[:] = 0.0
        mujoco.mj_step(self.model, self.data, round(SETTLES_S / self._step_s))
        self.data.qvel[:] = 0.0
        self.touch, self.hangs, self._hanging_s = None, False, 0.0
        self._read_pose()
        self._seen_x_m, self._seen_y_m = self.x_m, self.y_m
