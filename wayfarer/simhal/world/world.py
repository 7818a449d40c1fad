"""Physics-light, the default world: pose, contacts and distance of the rover.

It takes whole steps of ``Physics.step_s``, so what happens is independent of the order and the rates in which parts are
used.
"""

from __future__ import annotations

from math import ceil, copysign, cos, degrees, exp, inf, radians, sin, sqrt
from typing import Final

from mypy_extensions import mypyc_attr

from wayfarer.config.settings import Chassis
from wayfarer.escape.settings import Vehicle
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.collision import CELL_M, BodyOutline, Obstacle, ObstacleGrid, obstacles_of
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.rims import Rims
from wayfarer.simhal.world.simulated_world import (
    NO_BODY_FAULTS,
    ROUNDING_S,
    LowBranches,
    SimulatedWorld,
    Touch,
    side_of,
)
from wayfarer.simhal.world.skid_steering import SkidSteering
from wayfarer.simhal.world.wheeled_body import Climbing

# No move is tested in pieces longer than this, so that nothing is jumped over: half a trunk, half a right angle.
PIECE_M: Final = 0.1
PIECE_RAD: Final = 0.4
# How far beyond the body's own reach obstacles are looked for: clearance up to there is known, and used up before it is
# measured again.
SEEN_BEYOND_BODY_M: Final = 1.2
# The same where branches lie close to each other, and the cells of their map: changes the speed only.
CLUTTER_BEYOND_BODY_M: Final = 0.3
CLUTTER_CELL_M: Final = 0.5
# A blocked move is halved this often to find where it touches: 2 mm of 0.1 m.
HALVINGS: Final = 5
# Below this a move is none: it takes no noise.
STILL_M: Final = 1e-6
# Less pitch than this is level.
LEVEL_DEG: Final = 0.01


@mypyc_attr(allow_interpreted_subclasses=True)
class World(SimulatedWorld):
    """Ground truth of one trial. This body never slides sideways.

    Args:
        forest: the geometry.
        vehicle: the body; ``track_m`` and ``max_speed_m_s`` are what the field code believes of it.
        physics: how it moves.
        streams: where its chance comes from.
        starts_s: the time on the clock of its parts at which the world begins.
        chassis: with it the body drives over low branches and may climb onto others; without it all are trunks, and
            every rover rears up alike.
        skid: with it the wheels have the grip of a ground; without it the body goes and turns as commanded.
    """

    def __init__(
        self,
        forest: Forest,
        vehicle: Vehicle,
        physics: Physics,
        streams: RandomStreams,
        starts_s: float = 0.0,
        chassis: Chassis | None = None,
        skid: SkidSteering | None = None,
    ) -> None:
        super().__init__(forest, physics, starts_s)
        self._starts_s = starts_s
        self._step_s = physics.step_s
        self._half_step_s = physics.step_s / 2
        self._next_step_s = starts_s + physics.step_s - ROUNDING_S
        self._body = BodyOutline(vehicle.length_m, vehicle.width_m)
        beyond_m, cell_m = (CLUTTER_BEYOND_BODY_M, CLUTTER_CELL_M) if chassis else (SEEN_BEYOND_BODY_M, CELL_M)
        self._seen_m = self._body.reach_m + beyond_m
        self._climbing = Climbing(vehicle, chassis, physics, streams) if chassis else None
        clearance_m = self._climbing.clearance_m if self._climbing else 0.0
        self._grid = ObstacleGrid(obstacles_of(forest, clearance_m), self._seen_m, cell_m)
        self._low_branches = LowBranches(forest, clearance_m, self._body) if clearance_m else None
        self._free_m = 0.0
        self._lag = 1.0 - exp(-physics.step_s / physics.motor_lag_s)
        self._settling = exp(-physics.step_s / physics.settle_s)
        per_root_m = physics.noise_per_m**-0.5
        self._steer_noise = streams.normal("world.steer", physics.steer_noise_rad)
        self._wander = streams.normal("world.wander", radians(physics.heading_noise_deg) * per_root_m)
        self._slip_after = streams.generator("world.slip").exponential
        self._slip_at_m = self._next_slip_m()
        self._build_rover(vehicle, streams)
        self._left_m_s = self._right_m_s = 0.0
        self._skid = skid
        self._rims: Rims | None = None
        self._streams = streams
        self.command(0.0, 0.0)

    def _build_rover(self, vehicle: Vehicle, streams: RandomStreams) -> None:
        """Make this trial's rover a little different from what the field code believes of it."""
        build = streams.generator("world.rover")
        left, right = (vehicle.max_speed_m_s * build.normal(1.0, self.physics.side_gain_sd, 2)).tolist()
        self._full_left_m_s, self._full_right_m_s = float(left), float(right)
        track_m = vehicle.track_m * exp(float(build.normal(0.0, self.physics.track_sd)))
        self._turn_per_m_s = self._step_s / track_m

    def _next_slip_m(self) -> float:
        """Return the forward distance at which the ground gives way next."""
        return self.forward_m + self.physics.slip_free_m + float(self._slip_after(self.physics.slip_mean_m))

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides, each in -1..1, from the next step on."""
        self.commanded = (left, right)
        if self.body_faults is not NO_BODY_FAULTS:
            left, right = self.body_faults.wheels(left, right)
        self._left_target_m_s = left * self._full_left_m_s
        self._right_target_m_s = right * self._full_right_m_s
        self._pulls_back = left + right < 0.0
        if self._skid is not None:
            self._skid.drive(self._left_target_m_s, self._right_target_m_s)

    @property
    def rims_m(self) -> tuple[float, float]:
        """How far the rims of the left and right wheels have turned since somebody first asked, ahead positive."""
        rims = self._turning_rims()
        return rims.left_m, rims.right_m

    @property
    def motor_load(self) -> tuple[float, float]:
        """The current of the left and right motors, as a share of that of a side which is held at full duty: 0 to 2."""
        rims = self._turning_rims()
        return rims.left_load, rims.right_load

    def _turning_rims(self) -> Rims:
        """Return the rims; they are worked out from the first question on, a rover without such a sensor asks none."""
        rims = self._rims
        if rims is None:
            skid = self._skid
            friction = None if skid is None else skid.friction
            rims = self._rims = Rims(self.wheeled, friction, self.physics, self._streams)
        return rims

    def _turn_rims(self, rims: Rims) -> None:
        """Take the step of the body, for the rims."""
        full_m_s = self._full_left_m_s, self._full_right_m_s
        left, right = self._left_target_m_s / self._full_left_m_s, self._right_target_m_s / self._full_right_m_s
        if self.slipping or self.high_centred or self.touch is not None or self.body_faults.snagged:
            rims.held(self._step_s, left, right, full_m_s, slips=self.slipping or self.high_centred)
            return
        rims_m_s = self._left_m_s, self._right_m_s
        if self._skid is not None:
            rims_m_s = self._skid.rims_m_s(self._left_m_s, self._right_m_s)
        rims.rolled(self._step_s, left, right, full_m_s, rims_m_s)

    def carry_to(self, x_m: float, y_m: float, heading_deg: float) -> None:
        """Put the body elsewhere, as a person does who carries it; what it has driven stays counted."""
        self.x_m, self.y_m, self.heading_rad = x_m, y_m, radians(heading_deg)
        self.touch, self._free_m = None, 0.0
        self.pitch_deg = self.roll_deg = 0.0
        self.high_centred = False

    def pull_back(self, distance_m: float) -> None:
        """Put the body level on the ground, as far behind where it is as is free up to that distance."""
        dx, dy = -distance_m * sin(self.heading_rad), -distance_m * cos(self.heading_rad)
        near = self._measure(distance_m + self._body.reach_m)
        share = 1.0 if self._hit(near, dx, dy, 0.0) is None else self._free_share(near, dx, dy, 0.0)
        self.carry_to(self.x_m + dx * share, self.y_m + dy * share, degrees(self.heading_rad))

    def lose_grip(self) -> None:
        """Have the wheels slip until they pull back."""
        self.slipping = True

    def advance_to(self, t_s: float) -> None:
        """Take whole steps up to a time; nothing happens if the world is there already."""
        while t_s >= self._next_step_s:
            self.steps += 1
            now_s = self.t_s = self._starts_s + self.steps * self._step_s
            self._next_step_s = now_s + self._step_s - ROUNDING_S
            if now_s >= self.deadman_at_s:
                self.deadman_at_s = inf
                self.command(0.0, 0.0)
            self._step()
            if (rims := self._rims) is not None:
                self._turn_rims(rims)
            self.after_step(self)

    def _step(self) -> None:
        if self._skid is not None:
            if self._hillside is not None:
                self._skid.lean(self._hillside.rise(self.heading_rad))
            left_m_s, right_m_s = self._skid.step(self._left_m_s, self._right_m_s)
        else:
            left_m_s = self._left_m_s + (self._left_target_m_s - self._left_m_s) * self._lag
            right_m_s = self._right_m_s + (self._right_target_m_s - self._right_m_s) * self._lag
        self._left_m_s, self._right_m_s = left_m_s, right_m_s
        if self.slipping and not self._break_free():
            return
        if self.body_faults is not NO_BODY_FAULTS:
            left_m_s, right_m_s = self._apply_faults(left_m_s, right_m_s)
        if self.pitch_deg:
            self.pitch_deg = self.pitch_deg * self._settling if abs(self.pitch_deg) > LEVEL_DEG else 0.0
        forward_m = (left_m_s + right_m_s) * self._half_step_s
        turn_rad = (left_m_s - right_m_s) * self._turn_per_m_s
        if abs(forward_m) <= PIECE_M and abs(turn_rad) <= PIECE_RAD:
            self._move(forward_m, turn_rad)
            return
        pieces = max(ceil(abs(forward_m) / PIECE_M), ceil(abs(turn_rad) / PIECE_RAD))
        for _ in range(pieces):
            if not self._move(forward_m / pieces, turn_rad / pieces):
                return

    def _apply_faults(self, left_m_s: float, right_m_s: float) -> tuple[float, float]:
        """Return how fast the sides really go: a snagged body not at all, a shoved one also by itself."""
        if self.body_faults.snagged:
            self._left_m_s = self._right_m_s = 0.0
            return 0.0, 0.0
        shove_m_s = self.body_faults.shove_m_s
        return left_m_s + shove_m_s, right_m_s + shove_m_s

    def _break_free(self) -> bool:
        """Return whether the wheels, which turn without grip, have begun to pull back: that frees them."""
        if not self._pulls_back:
            self._left_m_s = self._right_m_s = 0.0
            return False
        self.slipping = False
        self._slip_at_m = self._next_slip_m()
        return True

    def _move(self, forward_m: float, turn_rad: float) -> bool:
        """Move the body by a piece, up to the first contact; return whether nothing was in the way."""
        length_m = abs(forward_m)
        if length_m > STILL_M:
            turn_rad += self._wander.draw() * sqrt(length_m)
        heading_rad = self.heading_rad + turn_rad
        course_rad = heading_rad + self._steer_noise.draw()
        dx, dy = forward_m * sin(course_rad), forward_m * cos(course_rad)
        # The clearance known from earlier is used up before it is measured again.
        free_m = self._free_m = self._free_m - length_m
        if free_m > 0.0:
            self.touch = None
        elif (share := self._resolve_contact(dx, dy, turn_rad)) < 1.0:
            dx, dy, forward_m = dx * share, dy * share, forward_m * share
            heading_rad = self.heading_rad + turn_rad * share
        self.x_m += dx
        self.y_m += dy
        self.heading_rad = heading_rad
        if forward_m < 0.0:
            self.reverse_m -= forward_m
        else:
            ahead_m = self.forward_m = self.forward_m + forward_m
            if ahead_m >= self._slip_at_m:
                self.slipping = True
        return self.touch is None

    def _resolve_contact(self, dx: float, dy: float, turn_rad: float) -> float:
        """Return how much of a move is free, 1 for all of it; press against what stops it."""
        touched, self.touch = self.touch, None
        within_reach = self._measure(sqrt(dx * dx + dy * dy) + self._body.reach_m)
        hit = self._hit(within_reach, dx, dy, turn_rad) if within_reach else None
        if hit is None:
            return 1.0
        self._apply_contact(hit, first=touched is None)
        return 0.0 if touched is not None else self._free_share(within_reach, dx, dy, turn_rad)

    def _measure(self, reach_m: float) -> list[Obstacle]:
        """Return the obstacles within reach, and remember how far it is beyond that to the nearest one."""
        x_m, y_m = self.x_m, self.y_m
        free_m = self._seen_m - reach_m
        within_reach = []
        for obstacle in self._grid.near(x_m, y_m):
            near_x, near_y = obstacle.nearest(x_m, y_m)
            dx, dy = near_x - x_m, near_y - y_m
            gap_m = sqrt(dx * dx + dy * dy) - obstacle.radius_m - reach_m
            if gap_m <= 0.0:
                within_reach.append(obstacle)
            free_m = gap_m if gap_m < free_m else free_m
        self._free_m = free_m
        return within_reach

    def _hit(self, near: list[Obstacle], dx: float, dy: float, turn_rad: float) -> Obstacle | None:
        """Return the first obstacle that the body would overlap after a move, None if it would not."""
        x_m, y_m, heading_rad = self.x_m + dx, self.y_m + dy, self.heading_rad + turn_rad
        sin_h, cos_h = sin(heading_rad), cos(heading_rad)
        for obstacle in near:
            if self._body.overlaps(obstacle, x_m, y_m, sin_h, cos_h):
                return obstacle
        return None

    def _free_share(self, near: list[Obstacle], dx: float, dy: float, turn_rad: float) -> float:
        """Return how much of a blocked move is free, by halving; always a pose that was tested."""
        free, share = 0.0, 0.5
        for halving in range(2, HALVINGS + 2):
            if self._hit(near, dx * share, dy * share, turn_rad * share) is None:
                free = share
                share += 0.5**halving
            else:
                share -= 0.5**halving
        return free

    def _apply_contact(self, hit: Obstacle, *, first: bool) -> None:
        """Stall at an obstacle; the body rears up on a trunk while its wheels push."""
        self.touch = Touch(hit, side_of(hit, self.x_m, self.y_m, self.heading_rad))
        if hit.axis_deg is not None:
            duty = (self._left_target_m_s + self._right_target_m_s) / (2.0 * self._full_left_m_s)
            pitch_deg = self.pitch_deg / self._settling
            if self._climbing is None:
                self.pitch_deg = pitch_deg + duty * self.physics.climb_deg_s * self._step_s
            else:
                self.pitch_deg = pitch_deg + self._climb(self._climbing, duty, first=first)
                self.high_centred = self._climbing.is_on(hit, self.pitch_deg)
        self._left_m_s = self._right_m_s = 0.0

    def _climb(self, climbing: Climbing, duty: float, *, first: bool) -> float:
        """Return by how many degrees a step of pushing lifts the nose, or from behind the tail."""
        at_once_deg = copysign(climbing.meet((self._left_m_s + self._right_m_s) / 2.0), duty) if first else 0.0
        return at_once_deg + climbing.rate_deg_s(duty) * self._step_s
