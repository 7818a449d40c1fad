"""The world in MuJoCo, with wheels that grip and slip.

The engine takes steps of ``model.STEP_S``; every ``OBSERVE_EVERY_STEPS`` of them the world looks round: what
touches, what is under the wheels, and the outcome monitor. What is read in between is where the body is, never what was
seen last, so that nothing depends on the order and the rates in which parts ask.
"""

from __future__ import annotations

from math import cos, inf, radians, sin

import mujoco
import numpy as np

from wayfarer.simhal.mujoco.ground import Mud, Nearby, WheelFriction, rough_ground
from wayfarer.simhal.mujoco.model import (
    ROVER,
    STEP_S,
    Contacts,
    Displacement,
    Placement,
    build_spec,
    gravity_m_s2,
    pose_of,
    raise_unstable,
    shove_n,
)
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.collision import low_trunks_of, obstacles_of
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics, Terrain
from wayfarer.simhal.world.simulated_world import ROUNDING_S, SimulatedWorld, Touch, side_of
from wayfarer.simhal.world.wheeled_body import WheeledBody

OBSERVE_EVERY_STEPS = 5  # steps: 20 ms, well within a control tick
SETTLES_S = 0.5  # for which a rover that is put down comes to rest on its tyres before anything counts
# Wheels slip when the ground passes less than half as fast as their rims, and not by a rounding error.
SLIPS_BELOW_SHARE, SLIPS_ABOVE_M_S = 0.5, 0.1
HIGH_CENTRED_AFTER_S = 5.0  # on its belly, with too few wheels to drive off; chosen by us


class MujocoWorld(SimulatedWorld):
    """Ground truth of one trial.

    Args:
        forest: the geometry.
        body: the rover.
        physics: the noise of its sensors, how unequal its sides are, how often it meets mud, and when it has tipped.
        terrain: the ground, and how strong the motors are.
        streams: where its chance comes from.
        step_s: of the engine.
    """

    def __init__(
        self,
        forest: Forest,
        body: WheeledBody,
        physics: Physics,
        terrain: Terrain,
        streams: RandomStreams,
        step_s: float = STEP_S,
    ) -> None:
        super().__init__(forest, physics)
        self.terrain, self._body = terrain, body
        self._step_s = step_s
        field = rough_ground(terrain.roughness_m, streams) if terrain.roughness_m else None
        self._mud = Mud(forest, physics, body.width_m, streams)
        # What passes under the belly is there for the wheels, but nothing that a bumper feels.
        felt = obstacles_of(forest, body.clearance_m)
        obstacles = felt + low_trunks_of(forest, body.clearance_m)
        self.model = build_spec(body, terrain, field, obstacles, step_s).compile()
        self.data = mujoco.MjData(self.model)
        # Views, as long as the data live: to ask the data for them at each look costs more than to read them.
        self._qpos, self._rims_rad_s = self.data.qpos[:7], self.data.qvel[6:10]
        self._rims_rad = self.data.qpos[7:11]
        self._warned = self.data.warning.number  # how often the engine has warned of each trouble
        self._rover = self.model.body(ROVER).id
        self._contacts = Contacts(self.data, obstacles, len(felt))
        self._wheel_friction = WheelFriction(
            self.model, self.data, self._mud, self._contacts.belly + 1, terrain.friction
        )
        self._nearby = Nearby(self.model, obstacles, body)
        self._placement = Placement(self.model, self.data, body, field, self._contacts, self._nearby)
        self._tilts = False
        self._high_centred_s = 0.0
        self._displacement = Displacement(self)
        self._sides = streams.generator("world.rover").normal(1.0, physics.side_gain_sd, 2).tolist()
        self._put_down(*forest.start_m, radians(forest.heading_deg))
        self.command(0.0, 0.0)

    # -- what is done to it ----------------------------------------------------------------------------------------

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides, each in -1..1, from the next step on."""
        self.commanded = (left, right)
        left, right = self.body_faults.wheels(left, right)
        left, right = left * self._sides[0], right * self._sides[1]
        self.data.ctrl[:] = left, left, right, right

    def set_faults(self, **body_faults: float | bool) -> None:
        """Change what is wrong with the body, from the next step on."""
        super().set_faults(**body_faults)
        self._hold(self.body_faults.snagged)
        if not self.body_faults.shove_m_s:
            self.data.xfrc_applied[self._rover] = 0.0

    def lose_grip(self) -> None:
        """Spill mud where the body is."""
        self._mud.add_patch(self.x_m, self.y_m)
        self._wheel_friction.update()

    def pull_back(self, distance_m: float) -> None:
        """Put the body level on the ground, as far behind where it is as is free up to that distance.

        If it is in contact with an obstacle as it stands level, it is put to the nearest place where it is not.

        Raises:
            NoRoom: there is no such place within some lengths of the body.
        """
        x_m, y_m, heading_rad = self.x_m, self.y_m, self.heading_rad
        for place in self._placement.free_places(x_m, y_m, heading_rad, distance_m):
            self._put_down(*place, heading_rad)
            if self._is_clear():
                break
        self.command(*self.commanded)

    def advance_to(self, t_s: float) -> None:
        """Take whole steps up to a time; nothing happens if the world is there already."""
        if self.deadman_at_s <= t_s:
            self._run_to(self._steps_until(self.deadman_at_s))
            self.deadman_at_s = inf
            self.command(0.0, 0.0)
        self._run_to(self._steps_until(t_s))

    @property
    def rims_m(self) -> tuple[float, float]:
        """How far the rims of the left and right wheels have turned, ahead positive; of a side the mean of two."""
        front_left, rear_left, front_right, rear_right = self._rims_rad.tolist()
        half_m = self._body.wheel_radius_m / 2.0
        return (front_left + rear_left) * half_m, (front_right + rear_right) * half_m

    @property
    def motor_load(self) -> tuple[float, float]:
        """The current of the left and right motors, as a share of that of a side which is held at full duty: 0 to 2."""
        free_rad_s = self._body.free_speed_m_s / self._body.wheel_radius_m
        pairs = zip(self.data.ctrl.tolist(), self._rims_rad_s.tolist(), strict=True)
        front_left, rear_left, front_right, rear_right = (abs(duty - rad_s / free_rad_s) for duty, rad_s in pairs)
        return (front_left + rear_left) / 2.0, (front_right + rear_right) / 2.0

    # -- the engine ------------------------------------------------------------------------------------------------

    def _steps_until(self, t_s: float) -> int:
        return int((t_s + ROUNDING_S) / self._step_s)

    def _run_to(self, steps: int) -> None:
        while self.steps < steps:
            looks_at = (self.steps // OBSERVE_EVERY_STEPS + 1) * OBSERVE_EVERY_STEPS
            upto = min(steps, looks_at)
            mujoco.mj_step(self.model, self.data, upto - self.steps)
            self.steps = upto
            self.t_s = upto * self._step_s
            self._read_pose()
            if upto == looks_at:
                self._look()
                self.after_step(self)
            else:
                self._displacement.follow(self._pose)

    def _read_pose(self) -> None:
        self._pose = pose_of(self._qpos.tolist())
        self.x_m, self.y_m, self.heading_rad, self.pitch_deg, self.roll_deg = self._pose

    def _look(self) -> None:
        if any(self._warned.tolist()) or self.x_m != self.x_m:  # NaN
            raise_unstable(self.data, self.t_s)
        ahead_m = self._displacement.look(self._pose)
        speed_m_s = ahead_m / (OBSERVE_EVERY_STEPS * self._step_s)
        self._nearby.follow(self.x_m, self.y_m)
        touched, hanging = self._contacts.feel()
        self.touch = None if touched is None else Touch(touched, side_of(touched, *self._pose[:3]))
        self._high_centred_s = self._high_centred_s + OBSERVE_EVERY_STEPS * self._step_s if hanging else 0.0
        self.high_centred = self._high_centred_s >= HIGH_CENTRED_AFTER_S
        rims_m_s = sum(self._rims_rad_s.tolist()) / 4.0 * self._body.wheel_radius_m
        slip_m_s = abs(rims_m_s - speed_m_s)
        self.slipping = slip_m_s > SLIPS_ABOVE_M_S and slip_m_s > SLIPS_BELOW_SHARE * abs(rims_m_s)
        if self._mud.anywhere:
            self._wheel_friction.update()
        if self.body_faults.shove_m_s:
            force_n = shove_n(self._body.weight_kg, self.body_faults.shove_m_s, speed_m_s)
            push_n = force_n * sin(self.heading_rad), force_n * cos(self.heading_rad)
            self.data.xfrc_applied[self._rover, :2] = push_n
        if self._tilts or self.ground_pitch_deg or self.ground_roll_deg:
            self._tilt_ground()

    def _tilt_ground(self) -> None:
        """Let gravity pull as it does on ground that slopes so under the body; the sensors add the angles."""
        self.model.opt.gravity[:] = gravity_m_s2(*self.ground_deg(), self.heading_rad)
        self._tilts = bool(self.ground_pitch_deg or self.ground_roll_deg)

    def _hold(self, snagged: bool) -> None:
        """Weld the body to where it is now, unless it is held already; or let it go."""
        if snagged and not self.data.eq_active[0]:
            self.model.eq_data[0, :10] = 0.0, 0.0, 0.0, *self.data.qpos[:7]  # the body's middle, and where that is
        self.data.eq_active[0] = snagged

    def _is_clear(self) -> bool:
        """Return whether the body at rest is in contact with no obstacle up to the next look.

        Rough ground may tilt it against one, or let it rock against one. The look ahead leaves nothing behind.
        """
        if self._contacts.with_obstacles():
            return False
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_step(self.model, self.data, OBSERVE_EVERY_STEPS)
        clear = not self._contacts.with_obstacles()
        mujoco.mj_setState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return clear

    def _put_down(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put the body down and let it come to rest, with its wheels at rest as well."""
        self._hold(False)
        self._placement.lift_to(x_m, y_m, heading_rad)
        self.data.ctrl[:] = 0.0
        self.data.xfrc_applied[self._rover] = 0.0
        self.model.opt.gravity[:] = gravity_m_s2(0.0, 0.0, heading_rad)  # it settles level, and does not creep away
        mujoco.mj_step(self.model, self.data, round(SETTLES_S / self._step_s))
        self.data.qvel[:] = 0.0
        self._hold(self.body_faults.snagged)
        self.touch, self.high_centred, self._high_centred_s = None, False, 0.0
        self._read_pose()
        if self._hillside is not None:
            self._tilt_ground()
        self._displacement.start_at(self._pose)
