"""What every world has, for simulated parts, faults and outcome, independent of the physics.

``world.World`` is physics-light, the default; ``mujoco.world.MujocoWorld`` has wheels that grip and slip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import asin, atan, atan2, cos, degrees, inf, radians, sin, tan
from typing import TYPE_CHECKING, Final

from mypy_extensions import mypyc_attr

from wayfarer.angles import clamp, wrap180
from wayfarer.hal import Side
from wayfarer.simhal.world.collision import BodyOutline, Obstacle, ObstacleGrid, low_trunks_of
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics

if TYPE_CHECKING:
    from wayfarer.simhal.world.wheeled_body import WheeledBody  # it needs numpy

# A task that wakes on the grid of steps may read a clock that is a rounding error short of it.
ROUNDING_S: Final = 1e-9
STALL_CURRENT_A: Final = 11.0  # of a side, if nobody says: two Pololu 37D of 12 V (data sheet: 5.5 A each)
FULL_BATTERY_V: Final = 12.6  # three lithium cells, charged
# Contacts within this angle of straight ahead are head-on.
HEAD_ON_DEG: Final = 10.0
# Made once: a body that presses against something touches it again in each step.
FRONT: Final = (Side.FRONT,)
REAR: Final = (Side.REAR,)
LEFT: Final = (Side.LEFT,)
RIGHT: Final = (Side.RIGHT,)


class Touch:
    """What the body ran into: the obstacle and the sides of the body that touch it."""

    def __init__(self, obstacle: Obstacle, sides: tuple[Side, ...]) -> None:
        self.obstacle = obstacle
        self.sides = sides


@dataclass(frozen=True, slots=True)
class BodyFaults:
    """What is wrong with the body.

    Each side turns ``gain`` times as fast as commanded (0 is dead, -1 wired the wrong way), and not at all below a
    duty of ``dead_band``. A ``snagged`` body cannot move, ``shove_m_s`` moves it ahead with any command.
    """

    left_gain: float = 1.0
    right_gain: float = 1.0
    dead_band: float = 0.0
    snagged: bool = False
    shove_m_s: float = 0.0

    def wheels(self, left: float, right: float) -> tuple[float, float]:
        """Return the duties that the sides turn with."""
        left = left if abs(left) >= self.dead_band else 0.0
        right = right if abs(right) >= self.dead_band else 0.0
        return left * self.left_gain, right * self.right_gain


NO_BODY_FAULTS: Final = BodyFaults()


@mypyc_attr(allow_interpreted_subclasses=True)
class SimulatedWorld:
    """Ground truth of one trial; each physics extends it.

    It has no task: a part calls ``advance_to`` with the time on the loop before it reads or commands. Positions are
    metres east (x) and north (y), headings radians clockwise from north, angles of the body as in ``wayfarer.hal``.
    ``forward_m``, ``reverse_m`` and ``right_m`` are how far the ground has passed under the body along its own axes
    since the beginning. ``deadman_at_s`` is when the wheels stop by themselves, for parts at device depth; chips have
    deadmen, and ``tick_chips`` lets them act. ``wheeled`` is the body for ``rims_m`` and ``motor_load``, None if it is
    not known, and ``stall_current_a`` the current of a side that is held at full duty. ``after_step`` is called
    with the world each time it has moved on. What may go wrong with the world itself (``set_faults``, ``lose_grip``,
    ``field_deg``, ``ground_pitch_deg``, ``ground_roll_deg``, ``battery_v``) is neutral unless a fault changes it.

    Args:
        forest: the geometry.
        physics: how it moves, and how its sensors err.
        starts_s: the time on the clock of its parts at which the world begins.
    """

    def __init__(self, forest: Forest, physics: Physics, starts_s: float = 0.0) -> None:
        self.physics = physics
        self.field_deg = self.ground_pitch_deg = self.ground_roll_deg = 0.0
        self.battery_v = FULL_BATTERY_V
        self.wheeled: WheeledBody | None = None
        self.stall_current_a = STALL_CURRENT_A
        self.deadman_at_s = inf
        self.tick_chips: Callable[[], None] = no_chips
        self.after_step: Callable[[SimulatedWorld], None] = no_observer
        # Read only for those who use a world.
        self.steps, self.t_s = 0, starts_s
        self.x_m, self.y_m = forest.start_m
        self.heading_rad = radians(forest.heading_deg)
        self.pitch_deg = self.roll_deg = 0.0
        self.forward_m = self.reverse_m = self.right_m = 0.0
        self.touch: Touch | None = None
        self.slipping = False  # its wheels turn, and it does not move
        self.high_centred = False  # it lies on its belly, and its wheels are off the ground
        self.body_faults = NO_BODY_FAULTS
        self.commanded = (0.0, 0.0)
        self._hillside = hillside_of(physics, forest)
        self._low_branches: LowBranches | None = None

    @property
    def path_m(self) -> float:
        """Distance driven, forwards and backwards."""
        return self.forward_m + self.reverse_m

    @property
    def rims_m(self) -> tuple[float, float]:
        """How far the rims of the left and right wheels have turned since somebody first asked, ahead positive."""
        raise NotImplementedError

    @property
    def motor_load(self) -> tuple[float, float]:
        """The current of the left and right motors, as a share of that of a side which is held at full duty: 0 to 2."""
        raise NotImplementedError

    def attitude(self) -> tuple[float, float, float]:
        """Return heading in radians, pitch and roll in degrees, as a perfect sensor on the body measures them.

        Pitch and roll are those of the body and of the ground together.
        """
        ground_pitch_deg, ground_roll_deg = self.ground_deg()
        return self.heading_rad, self.pitch_deg + ground_pitch_deg, self.roll_deg + ground_roll_deg

    def ground_deg(self) -> tuple[float, float]:
        """Return pitch and roll of the ground under the body: of a fault, of low branches, and of the hillside."""
        pitch_deg, roll_deg, heading_rad = self.ground_pitch_deg, self.ground_roll_deg, self.heading_rad
        if self._low_branches is not None:
            pitch_deg += self._low_branches.pitch_deg(self.x_m, self.y_m, sin(heading_rad), cos(heading_rad))
        if self._hillside is not None:
            slope_pitch_deg, slope_roll_deg = self._hillside.attitude_deg(heading_rad)
            pitch_deg, roll_deg = pitch_deg + slope_pitch_deg, roll_deg + slope_roll_deg
        return pitch_deg, roll_deg

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides, each in -1..1, from the next step on."""
        raise NotImplementedError

    def set_faults(self, **body_faults: float | bool) -> None:
        """Change what is wrong with the body, from the next step on."""
        self.body_faults = replace(self.body_faults, **body_faults)  # type: ignore[arg-type]
        if self.body_faults == NO_BODY_FAULTS:
            self.body_faults = NO_BODY_FAULTS
        self.command(*self.commanded)

    def lose_grip(self) -> None:
        """Have the wheels slip where the body is."""
        raise NotImplementedError

    def advance_to(self, t_s: float) -> None:
        """Take whole steps up to a time; nothing happens if the world is there already."""
        raise NotImplementedError

    def pull_back(self, distance_m: float) -> None:
        """Put the body level on the ground, as far behind where it is as is free up to that distance."""
        raise NotImplementedError


def side_of(obstacle: Obstacle, x_m: float, y_m: float, heading_rad: float) -> tuple[Side, ...]:
    """Return the side of a body at which an obstacle lies, by the bearing of its nearest point."""
    near_x, near_y = obstacle.nearest(x_m, y_m)
    bearing_rad = atan2(near_x - x_m, near_y - y_m) - heading_rad
    off_deg = wrap180(degrees(bearing_rad))
    if abs(off_deg) <= HEAD_ON_DEG:
        return FRONT
    if abs(off_deg) >= 135.0:
        return REAR
    return RIGHT if off_deg > 0.0 else LEFT


def no_observer(_world: SimulatedWorld) -> None:
    """Stand in for the outcome monitor."""


def no_chips() -> None:
    """Stand in for the chips."""


# -- the ground --------------------------------------------------------------------------------------------------------

LOW_CELL_M: Final = 0.5  # of the map of low branches


class Hillside:
    """A plane that rises towards one bearing; headings and places are those in the plane."""

    def __init__(self, slope_deg: float, uphill_deg: float) -> None:
        self._uphill_rad = radians(uphill_deg)
        self._sin, self._tan = sin(radians(slope_deg)), tan(radians(slope_deg))

    def attitude_deg(self, heading_rad: float) -> tuple[float, float]:
        """Return pitch (nose up) and roll (right side down) of a body that stands on it with this heading."""
        off_rad = self._uphill_rad - heading_rad
        return degrees(asin(self._sin * cos(off_rad))), -degrees(atan(self._tan * sin(off_rad)))

    def rise(self, heading_rad: float) -> float:
        """Return by how many metres the ground rises a metre ahead: the share of the weight that pulls backwards."""
        return self._sin * cos(self._uphill_rad - heading_rad)


def hillside_of(physics: Physics, forest: Forest) -> Hillside | None:
    """Return the slope of a world, None if the ground is level; its direction counts from the forest's heading."""
    if not physics.slope_deg:
        return None
    return Hillside(physics.slope_deg, forest.heading_deg + physics.slope_direction_deg)


class LowBranches:
    """The branches that pass under the belly: they only tilt the body, nose up, then nose down."""

    def __init__(self, forest: Forest, clearance_m: float, body: BodyOutline) -> None:
        self._body = body
        self._grid = ObstacleGrid(low_trunks_of(forest, clearance_m), body.reach_m, LOW_CELL_M)

    def pitch_deg(self, x_m: float, y_m: float, sin_h: float, cos_h: float) -> float:
        """Return the pitch of a body there: a branch lifts the end that it is nearer to, by up to its thickness."""
        half_m, pitch_deg = self._body.half_length_m, 0.0
        for branch in self._grid.near(x_m, y_m):
            if self._body.overlaps(branch, x_m, y_m, sin_h, cos_h):
                near_x, near_y = branch.nearest(x_m, y_m)
                ahead_m = (near_x - x_m) * sin_h + (near_y - y_m) * cos_h
                pitch_deg += degrees(atan(branch.radius_m / half_m)) * clamp(ahead_m / half_m, -1.0, 1.0)
        return pitch_deg
