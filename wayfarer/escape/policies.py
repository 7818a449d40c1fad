"""The choices in which the ten algorithms differ: turn direction, turn angle, stride length.

Each is a plain function of the observation and a ``random.Random``; an algorithm is a row of them (``catalogue``).
Sides are signs of a turn: +1 clockwise (right), -1 counter-clockwise (left).
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from statistics import NormalDist
from typing import Final

from wayfarer.angles import axis_offset_deg, wrap180
from wayfarer.clamp import clamp
from wayfarer.escape.api import EscapeSettings, Observation
from wayfarer.hal import Side

CLOCKWISE: Final = 1
COUNTER_CLOCKWISE: Final = -1

TurnSide = Callable[[Observation, EscapeSettings, Random], int]
TurnAngle = Callable[[Observation, EscapeSettings, Random], float]
StrideLength = Callable[[EscapeSettings, Random], float]

# The released simulator draws Lévy(0, 1) in its pixels of 0.05 m.
LEVY_STRIDE_SCALE_M: Final = 0.05
# Lévy-Pledge draws its angle from Lévy(0, 1) in degrees (paper, table I).
LEVY_TURN_SCALE_DEG: Final = 1.0
_NORMAL: Final = NormalDist()


def clockwise(_observation: Observation, _settings: EscapeSettings, _rng: Random) -> int:
    """Return clockwise always: a fixed hand follows a wall to its end."""
    return CLOCKWISE


def either(_observation: Observation, _settings: EscapeSettings, rng: Random) -> int:
    """Return either side with equal chance."""
    return CLOCKWISE if rng.random() < 0.5 else COUNTER_CLOCKWISE


def contact_side(observation: Observation) -> int:
    """Return the turn away from the touched side, or 0 where the contact favours neither."""
    sides = observation.contact.sides if observation.contact is not None else ()
    return (Side.LEFT in sides) - (Side.RIGHT in sides)


def away_else_clockwise(observation: Observation, _settings: EscapeSettings, _rng: Random) -> int:
    """Return the turn away from the contact; clockwise where there is none, as in a slip, or it is head-on."""
    return contact_side(observation) or CLOCKWISE


def away_else_either(observation: Observation, settings: EscapeSettings, rng: Random) -> int:
    """Return the turn away from the contact; either side where there is none or it is head-on."""
    return contact_side(observation) or either(observation, settings, rng)


def compatible_axis_deg(observation: Observation, settings: EscapeSettings) -> float | None:
    """Return the obstacle's axis relative to the goal heading, in [-90, 90), if it is compatible with it.

    Compatible means within 20 degrees (paper, section III-A, OO-Pledge); None otherwise or where it is not known.
    """
    if observation.contact is None or observation.contact.obstacle_bearing_deg is None:
        return None
    offset_deg = axis_offset_deg(observation.contact.obstacle_bearing_deg, observation.goal_heading_deg)
    return offset_deg if abs(offset_deg) <= settings.compatible_within_deg else None


def along_else_clockwise(observation: Observation, settings: EscapeSettings, _rng: Random) -> int:
    """Return the side to which a compatible obstacle leans from the goal heading, else clockwise."""
    offset_deg = compatible_axis_deg(observation, settings)
    return COUNTER_CLOCKWISE if offset_deg is not None and offset_deg < 0 else CLOCKWISE


def along_else_away(observation: Observation, settings: EscapeSettings, rng: Random) -> int:
    """Return the turn onto a compatible obstacle's axis, else the turn away from the contact."""
    turn_deg = _turn_onto_axis_deg(observation, settings)
    if turn_deg is None:
        return away_else_either(observation, settings, rng)
    return COUNTER_CLOCKWISE if turn_deg < 0 else CLOCKWISE


def fixed_angle(_observation: Observation, settings: EscapeSettings, _rng: Random) -> float:
    """Return the configured turn angle, 30 degrees in the paper."""
    return settings.turn_angle_deg


def levy_angle(_observation: Observation, settings: EscapeSettings, rng: Random) -> float:
    """Return a Lévy-distributed turn angle, clipped to 10..50 degrees (paper, table I)."""
    return clipped_levy(rng, LEVY_TURN_SCALE_DEG, settings.levy_turn_min_deg, settings.levy_turn_max_deg)


def uniform_angle(_observation: Observation, _settings: EscapeSettings, rng: Random) -> float:
    """Return any angle up to a half turn; with a side drawn as well the new heading is uniform."""
    return rng.uniform(0.0, 180.0)


def along_angle(observation: Observation, settings: EscapeSettings, _rng: Random) -> float:
    """Return the angle onto a compatible obstacle's axis, else the configured turn angle."""
    turn_deg = _turn_onto_axis_deg(observation, settings)
    return settings.turn_angle_deg if turn_deg is None else abs(turn_deg)


def short_stride(settings: EscapeSettings, _rng: Random) -> float:
    """Return the fixed stride of the reactive algorithms, in metres."""
    return settings.react_stride_m


def levy_stride(settings: EscapeSettings, rng: Random) -> float:
    """Return a Lévy-distributed stride, in metres."""
    return clipped_levy(rng, LEVY_STRIDE_SCALE_M, settings.levy_stride_min_m, settings.levy_stride_max_m)


def levy(rng: Random, scale: float) -> float:
    """Draw from Lévy(0, scale): positive, no mean, half of the draws above 2.2 times the scale.

    A Lévy variable is ``scale / z**2`` for a standard normal z; the quantile form needs one uniform draw.
    """
    z = _NORMAL.inv_cdf((1.0 - rng.random()) / 2.0)  # never 0, which has no quantile
    return scale / (z * z) if z else float("inf")


def clipped_levy(rng: Random, scale: float, low: float, high: float) -> float:
    """Draw from Lévy(0, scale), clipped to [low, high]."""
    return clamp(levy(rng, scale), low, high)


def _turn_onto_axis_deg(observation: Observation, settings: EscapeSettings) -> float | None:
    offset_deg = compatible_axis_deg(observation, settings)
    if offset_deg is None:
        return None
    return wrap180(observation.goal_heading_deg + offset_deg - observation.heading_deg)
