"""The interface of a world, for simulated parts, faults and outcome, independent of the physics.

``world.World`` is physics-light, the default; ``mujoco.world.MujocoWorld`` has wheels that grip and slip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import asin, atan, atan2, cos, degrees, radians, sin, tan
from typing import Final, NamedTuple, Protocol

from wayfarer.angles import wrap180
from wayfarer.hal import Side
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics

# A task that wakes on the grid of steps may read a clock that is a rounding error short of it.
ROUNDING_S: Final = 1e-9
FULL_BATTERY_V: Final = 12.6  # three lithium cells, charged
# Contacts within this angle of straight ahead are head-on.
HEAD_ON_DEG: Final = 10.0


class Touch(NamedTuple):
    """What the body ran into: the obstacle and the sides of the body that touch it."""

    obstacle: Obstacle
    sides: tuple[Side, ...]


@dataclass(frozen=True, slots=True)
class BodyFaults:
    """What is wrong with the body.

    Each side turns ``gain`` times as fast as commanded (0 is dead, -1 wired the wrong way), and not at all below a
    duty of ``dead_band``. A ``snagged`` body cannot move, ``shove_m_s`` moves it ahead whatever its wheels do.
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


class SimulatedWorld(Protocol):
    """Ground truth of one trial.

    It has no task: a part calls ``advance_to`` with the time on the loop before it reads or commands. Positions are
    metres east (x) and north (y), headings radians clockwise from north, angles of the body as in ``wayfarer.hal``.
    ``forward_m``, ``reverse_m`` and ``right_m`` are how far the ground has passed under the body along its own axes
    since the beginning. ``deadman_at_s`` is when the wheels stop by themselves, for parts at device depth; chips have
    deadmen, and ``tick_chips`` lets them act. ``after_step`` is called with the world each time it has moved on. What
    may go wrong with the world itself (``set_faults``, ``slipping``, ``field_deg``, ``ground_pitch_deg``,
    ``ground_roll_deg``, ``battery_v``) is neutral unless a fault changes it.
    """

    physics: Physics
    slipping: bool
    field_deg: float
    ground_pitch_deg: float
    ground_roll_deg: float
    battery_v: float
    deadman_at_s: float
    tick_chips: Callable[[], None]
    after_step: Callable[[SimulatedWorld], None]
    # Read only for those who use a world.
    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    pitch_deg: float
    roll_deg: float
    touch: Touch | None
    high_centred: bool  # it lies on its belly, and its wheels are off the ground
    body_faults: BodyFaults
    commanded: tuple[float, float]

    def attitude(self) -> tuple[float, float, float]:
        """Return heading in radians, pitch and roll in degrees, as a perfect sensor on the body measures them.

        Pitch and roll are those of the body and of the ground together, and of what passes under the body.
        """

    @property
    def forward_m(self) -> float:
        """Distance driven ahead."""

    @property
    def reverse_m(self) -> float:
        """Distance driven backwards."""

    @property
    def right_m(self) -> float:
        """Sideways displacement, to the right."""

    @property
    def path_m(self) -> float:
        """Distance driven, forwards and backwards."""

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides, each in -1..1, from the next step on."""

    def set_faults(self, **body_faults: float | bool) -> None:
        """Change what is wrong with the body, from the next step on."""

    def advance_to(self, t_s: float) -> None:
        """Take whole steps up to a time; nothing happens where the world is there already."""

    def pull_back(self, distance_m: float) -> None:
        """Put the body level on the ground, as far behind where it is as is free up to that distance."""


def side_of(obstacle: Obstacle, x_m: float, y_m: float, heading_rad: float) -> tuple[Side, ...]:
    """Return the side of a body at which an obstacle lies, by the bearing of its nearest point."""
    near_x, near_y = obstacle.nearest(x_m, y_m)
    bearing_rad = atan2(near_x - x_m, near_y - y_m) - heading_rad
    off_deg = wrap180(degrees(bearing_rad))
    if abs(off_deg) <= HEAD_ON_DEG:
        return (Side.FRONT,)
    if abs(off_deg) >= 135.0:
        return (Side.REAR,)
    return (Side.RIGHT,) if off_deg > 0.0 else (Side.LEFT,)


def no_observer(_world: SimulatedWorld) -> None:
    """Stand in for the outcome monitor."""


def no_chips() -> None:
    """Stand in for the chips."""


# -- ground that slopes as a whole: the same everywhere ----------------------------------------------------------------


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
