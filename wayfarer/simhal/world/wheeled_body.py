"""The rover as a body on four driven wheels: its parameters, from its file or assumed; and how it climbs a branch."""

from __future__ import annotations

from math import asin, degrees, hypot, radians, sin
from typing import Final, NamedTuple

from wayfarer.config.settings import CLIMBING_KEYS, STANDARD_GRAVITY_M_S2, WHEEL_KEYS, Chassis
from wayfarer.errors import BadConfig
from wayfarer.escape.settings import Vehicle
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.physics import Physics

# Chosen by us, to be plain; none of them decides where a closed form of the tests lies.
TYRE_WIDTH_PER_RADIUS: Final = 0.9
WHEEL_SHARE_OF_WEIGHT: Final = 0.03  # each; the rest is spread evenly over the body
# What each motor's rotor adds to the inertia, as if this share of the weight were at the rim of its wheel: 0.6 kg for
# ForestRover. A rotor of 5e-6 kg m2 behind a gear of 1 to 27 would be 0.9 kg there.
ROTOR_SHARE_OF_WEIGHT: Final = 0.1
ROLLING_RESISTANCE: Final = 0.05  # of the load: small tyres on firm soil; on leaf litter up to twice that
# If a file gives no ground clearance, as that of the abstract rover: ForestRover's 41 mm over its 65 mm.
CLEARANCE_PER_RADIUS: Final = 0.041 / 0.065


class WheelGeometry(NamedTuple):
    """Where the four wheels are: half the wheelbase, half the distance between left and right, and their radius."""

    half_base_m: float
    half_track_m: float
    radius_m: float


class WheeledBody(NamedTuple):
    """What a rover file says of the body, all of it known.

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
    def wheels(self) -> WheelGeometry:
        """Where the wheels are: their outer edges are the body's outline."""
        radius_m = self.wheel_radius_m
        return WheelGeometry(self.length_m / 2.0 - radius_m, (self.width_m - self.tyre_width_m) / 2.0, radius_m)

    @property
    def box_half_m(self) -> tuple[float, float]:
        """Half the length and width of the box between the wheels, which stand out by half a radius at each end."""
        return self.wheels.half_base_m + self.wheel_radius_m / 2.0, self.width_m / 2.0 - 1.1 * self.tyre_width_m

    @property
    def rims_kg(self) -> float:
        """What turns with the wheels, as a mass at their rims: wheels (an ellipsoid's two fifths) and rotors."""
        return 4.0 * (0.4 * WHEEL_SHARE_OF_WEIGHT + ROTOR_SHARE_OF_WEIGHT) * self.weight_kg

    @property
    def yaw_inertia_kg_m2(self) -> float:
        """Moment of inertia about the vertical: the box, and the wheels where they stand."""
        half_base_m, half_track_m, _ = self.wheels
        wheels = 4.0 * WHEEL_SHARE_OF_WEIGHT
        box_m2 = hypot(*self.box_half_m) ** 2 / 3.0
        return self.weight_kg * ((1.0 - wheels) * box_m2 + wheels * (half_base_m**2 + half_track_m**2))


def body_of(name: str, vehicle: Vehicle, chassis: Chassis, asked_by: str) -> WheeledBody:
    """Return the body of a rover of this name; ``asked_by`` is the option that needs one.

    Raises:
        BadConfig: its file does not give all that a body with wheels needs, or gives what cannot be built.
    """
    if missing := chassis.missing(WHEEL_KEYS):
        raise BadConfig(
            f"rover '{name}' has no chassis.{missing[0]}, and {asked_by} needs a body with wheels;"
            " use --rover sim, forestrover or minirover, or add [chassis] to its file, as in their files"
        )
    weight_kg, motors_n_m, radius_m, height_m = (getattr(chassis, key) for key in WHEEL_KEYS)
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
    return WheeledBody(
        vehicle.length_m, vehicle.width_m, height_m, clearance_m, weight_kg, radius_m, motors_n_m, vehicle.max_speed_m_s
    )


# -- climbing ----------------------------------------------------------------------------------------------------------
# A rover of known weight and motors drives over a low branch, and may climb a thicker one. Two mishaps end a climb for
# a blind rover (paper, section IV-C, "due to inertia, rovers sometimes climbed onto fallen branches"): it turns over,
# or the branch is under its belly and its wheels are off the ground.


class Climbing:
    """Models climbing onto a branch.

    ``strength`` is the torque of the motors over the moment of the weight about one axle, which they must overcome to
    lift the other: 0.35 for ForestRover, 0.24 for MiniRover. ``Physics.climb_deg_s`` is how fast a strength of 1 lifts
    it at full duty and average grip. Chosen by us, to be plain: the grip of bark is exponentially distributed,
    one draw a contact (most of it is slippery, sometimes a stub holds), and all the energy of the speed at contact goes
    into lifting the nose.
    """

    def __init__(self, vehicle: Vehicle, chassis: Chassis, physics: Physics, streams: RandomStreams) -> None:
        clearance_m, weight_kg, motors_n_m = chassis.ground_clearance_m, chassis.weight_kg, chassis.motors_n_m
        if clearance_m is None or weight_kg is None or motors_n_m is None:
            raise ValueError(f"the chassis does not give {', '.join(chassis.missing(CLIMBING_KEYS))}")
        self.clearance_m = clearance_m
        self._length_m = vehicle.length_m
        self.strength = motors_n_m / (weight_kg * STANDARD_GRAVITY_M_S2 * vehicle.length_m / 2.0)
        self._deg_s = physics.climb_deg_s * self.strength
        self._next_grip = streams.generator("world.grip").exponential
        self._grip = 1.0

    def meet(self, speed_m_s: float) -> float:
        """Return by how many degrees a rover that runs into a branch is lifted at once; its wheels get a new grip.

        The centre of mass rises half as far as the nose: half v squared is g times half the lift.
        """
        self._grip = float(self._next_grip())
        lift_m = min(speed_m_s * speed_m_s / STANDARD_GRAVITY_M_S2, self._length_m)
        return degrees(asin(lift_m / self._length_m))

    def rate_deg_s(self, duty: float) -> float:
        """Return how fast pushing lifts the nose, or for a negative duty the tail, in degrees per second."""
        return duty * self._deg_s * self._grip

    def is_on(self, obstacle: Obstacle, pitch_deg: float) -> bool:
        """Return whether the body is up so far that the branch is under its belly."""
        return self._length_m * abs(sin(radians(pitch_deg))) >= 2.0 * obstacle.radius_m
