"""The one world that all simulated parts share: where the rover is, what it touches, how far it has gone.

The world has no task of its own. A part calls ``advance_to`` with the time on the loop before it reads or commands, and
the world takes whole steps of ``Physics.step_s`` up to there. What happens is therefore independent of the order and
the rates in which parts are used.

Positions are metres east (x) and north (y); headings degrees clockwise from north, not wrapped.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, ceil, cos, degrees, exp, radians, sin
from typing import NamedTuple

from wayfarer.escape.api import Vehicle
from wayfarer.hal import Side
from wayfarer.simhal.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.obstacles import Body, Near, Obstacle, grid, obstacles_of
from wayfarer.simhal.physics import Physics
from wayfarer.simhal.streams import Streams

# No move is tested in pieces longer than this, so that nothing is jumped over: half a trunk, half a right angle.
PIECE_M = 0.1
PIECE_RAD = 0.4
# A blocked move is halved this often to find where it touches: 2 mm of 0.1 m.
HALVINGS = 5
# Contacts within this angle of straight ahead are head-on.
HEAD_ON_DEG = 10.0


class Touch(NamedTuple):
    """What the body ran into: the obstacle and the sides of the body that touch it."""

    obstacle: Obstacle
    sides: tuple[Side, ...]


class World:
    """Ground truth of one trial.

    Args:
        forest: the geometry.
        vehicle: the body; ``track_m`` and ``max_speed_m_s`` are what the field code believes of it.
        physics: how it moves.
        streams: where its chance comes from.
        after_step: called after each step, for the referee.
    """

    def __init__(
        self,
        forest: Forest,
        vehicle: Vehicle,
        physics: Physics,
        streams: Streams,
        after_step: Callable[[], None],
    ) -> None:
        self.x_m, self.y_m = forest.start_m
        self.heading_rad = radians(forest.heading_deg)
        self.pitch_deg = 0.0
        self.roll_deg = 0.0
        self.path_m = 0.0
        self.reverse_m = 0.0
        self.forward_m = 0.0
        self.touch: Touch | None = None
        self.slipping = False
        self.slips = 0
        self.steps = 0
        self._step_s = physics.step_s
        self._physics = physics
        self._after_step = after_step
        self._body = Body(vehicle.length_m, vehicle.width_m)
        self._cells = grid(obstacles_of(forest), self._body.reach_m)
        self._lag = 1.0 - exp(-physics.step_s / physics.motor_lag_s)
        self._settling = exp(-physics.step_s / physics.settle_s)
        per_root_m = physics.noise_per_m**-0.5
        self._steer_noise = streams.normal("world.steer", physics.steer_noise_rad)
        self._wander = streams.normal("world.wander", radians(physics.heading_noise_deg) * per_root_m)
        self._slip_after = streams.generator("world.slip").exponential
        self._slip_at_m = self._next_slip_m()
        self._build_rover(vehicle, streams)
        self._left_target_m_s = self._right_target_m_s = 0.0
        self._left_m_s = self._right_m_s = 0.0

    def _build_rover(self, vehicle: Vehicle, streams: Streams) -> None:
        """Make this trial's rover a little different from what the field code believes of it."""
        build = streams.generator("world.rover")
        self._full_left_m_s, self._full_right_m_s = (
            vehicle.max_speed_m_s * build.normal(1.0, self._physics.side_gain_sd, 2)
        ).tolist()
        self._track_m = vehicle.track_m * exp(build.normal(0.0, self._physics.track_sd))

    def _next_slip_m(self) -> float:
        """Return the forward distance at which the ground gives way next."""
        return self.forward_m + self._physics.slip_free_m + float(self._slip_after(self._physics.slip_mean_m))

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides, each in -1..1, from the next step on."""
        self._left_target_m_s = left * self._full_left_m_s
        self._right_target_m_s = right * self._full_right_m_s

    def advance_to(self, t_s: float) -> None:
        """Take whole steps up to a time; nothing happens where the world is there already."""
        due = int(t_s / self._step_s + 1e-6)
        while self.steps < due:
            self.steps += 1
            self._step()
            self._after_step()

    def _step(self) -> None:
        self._left_m_s += (self._left_target_m_s - self._left_m_s) * self._lag
        self._right_m_s += (self._right_target_m_s - self._right_m_s) * self._lag
        if self.slipping and not self._break_free():
            return
        forward_m = (self._left_m_s + self._right_m_s) * 0.5 * self._step_s
        turn_rad = (self._left_m_s - self._right_m_s) / self._track_m * self._step_s
        if self.pitch_deg:
            self.pitch_deg = self.pitch_deg * self._settling if abs(self.pitch_deg) > 0.01 else 0.0
        if -1e-6 < forward_m < 1e-6 and -1e-6 < turn_rad < 1e-6:
            return
        pieces = max(ceil(abs(forward_m) / PIECE_M), ceil(abs(turn_rad) / PIECE_RAD))
        while pieces and self._move(forward_m / pieces, turn_rad / pieces):
            pieces -= 1

    def _break_free(self) -> bool:
        """Tell whether the wheels, which turn without grip, have begun to pull back: that frees them."""
        if self._left_target_m_s + self._right_target_m_s >= 0.0:
            self._left_m_s = self._right_m_s = 0.0
            return False
        self.slipping = False
        self._slip_at_m = self._next_slip_m()
        return True

    def _move(self, forward_m: float, turn_rad: float) -> bool:
        """Move the body by a piece, up to the first contact; return whether nothing was in the way."""
        length_m = abs(forward_m)
        turn_rad += self._wander() * length_m**0.5
        course = self.heading_rad + turn_rad + self._steer_noise()
        dx, dy = forward_m * sin(course), forward_m * cos(course)
        near = self._near(self.x_m + dx, self.y_m + dy)
        hit = self._hit(near, dx, dy, turn_rad) if near else None
        if hit is not None:
            share = self._free_share(near, dx, dy, turn_rad)
            forward_m *= share
            length_m *= share
            self._press(hit, dx, dy, turn_rad, share)
        else:
            self.touch = None
            self.x_m += dx
            self.y_m += dy
            self.heading_rad += turn_rad
        self.path_m += length_m
        if forward_m < 0.0:
            self.reverse_m += length_m
        else:
            self.forward_m += length_m
            if self.forward_m >= self._slip_at_m:
                self.slipping = True
                self.slips += 1
        return hit is None

    def _near(self, x_m: float, y_m: float) -> Near:
        if 0.0 <= x_m < WORLD_SIZE_M and 0.0 <= y_m < WORLD_SIZE_M:
            return self._cells[int(y_m) * 50 + int(x_m)]
        return ()

    def _hit(self, near: Near, dx: float, dy: float, turn_rad: float) -> Obstacle | None:
        """Return the first obstacle that the body would overlap after a move, None where it would not."""
        x_m, y_m, heading_rad = self.x_m + dx, self.y_m + dy, self.heading_rad + turn_rad
        sin_h, cos_h = sin(heading_rad), cos(heading_rad)
        for obstacle in near:
            if self._body.overlaps(obstacle, x_m, y_m, sin_h, cos_h):
                return obstacle
        return None

    def _free_share(self, near: Near, dx: float, dy: float, turn_rad: float) -> float:
        """Return how much of a blocked move is free, by halving; always a pose that was tested."""
        free, share = 0.0, 0.5
        for halving in range(2, HALVINGS + 2):
            if self._hit(near, dx * share, dy * share, turn_rad * share) is None:
                free = share
                share += 0.5**halving
            else:
                share -= 0.5**halving
        return free

    def _press(self, hit: Obstacle, dx: float, dy: float, turn_rad: float, share: float) -> None:
        """Stop at an obstacle; the body rears up on a trunk while its wheels go on pushing."""
        self.x_m += dx * share
        self.y_m += dy * share
        self.heading_rad += turn_rad * share
        self.touch = Touch(hit, self._sides(hit))
        push_m_s = (self._left_m_s + self._right_m_s) * 0.5
        if hit.axis_deg is not None:
            duty = push_m_s / self._full_left_m_s
            self.pitch_deg = self.pitch_deg / self._settling + duty * self._physics.climb_deg_s * self._step_s
        self._left_m_s = self._right_m_s = 0.0  # stalled

    def _sides(self, hit: Obstacle) -> tuple[Side, ...]:
        """Return the side of the body at which an obstacle lies, by the bearing of its nearest point."""
        near_x, near_y = hit.nearest(self.x_m, self.y_m)
        bearing_rad = atan2(near_x - self.x_m, near_y - self.y_m) - self.heading_rad
        off_deg = (degrees(bearing_rad) + 180.0) % 360.0 - 180.0
        if abs(off_deg) <= HEAD_ON_DEG:
            return (Side.FRONT,)
        if abs(off_deg) >= 135.0:
            return (Side.REAR,)
        return (Side.RIGHT,) if off_deg > 0.0 else (Side.LEFT,)
