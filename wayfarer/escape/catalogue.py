"""The table of algorithms: the ten of the paper, and one more that uses the same sensors.

The paper's differ in four choices and in nothing else: the side of the turn, its angle, what follows the turn, and
whether a heading back at the goal ends the episode. The choices are plain functions of the observation and a
``random.Random``; a row names them. Retry-Pledge is in ``retry``; ``docs/explanation/better-escape.md`` has its
evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from random import Random
from statistics import NormalDist
from typing import Final

from wayfarer.angles import axis_offset_deg, clamp, wrap180
from wayfarer.escape.api import CLOCKWISE, COUNTER_CLOCKWISE, EscapeHandler, Observation
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler, StrideLength, TurnAngle, TurnSide, short_stride
from wayfarer.escape.phases import PLEDGE, STRIDES
from wayfarer.escape.retry import RetryHandler
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import Side

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
    """Return the turn away from the touched side, or 0 if the contact favours neither."""
    sides = observation.contact.sides if observation.contact is not None else ()
    return (Side.LEFT in sides) - (Side.RIGHT in sides)


def away_else_clockwise(observation: Observation, _settings: EscapeSettings, _rng: Random) -> int:
    """Return the turn away from the contact; clockwise if there is none, as in a slip, or it is head-on."""
    return contact_side(observation) or CLOCKWISE


def away_else_either(observation: Observation, settings: EscapeSettings, rng: Random) -> int:
    """Return the turn away from the contact; either side if there is none or it is head-on."""
    return contact_side(observation) or either(observation, settings, rng)


def compatible_axis_deg(observation: Observation, settings: EscapeSettings) -> float | None:
    """Return the obstacle's axis relative to the goal heading, in [-90, 90), if it is compatible with it.

    Compatible means within 20 degrees (paper, section III-A, OO-Pledge); None otherwise or if it is not known.
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


NOTHING: frozenset[str] = frozenset()
CONTACT = frozenset({"contact"})

HandlerFactory = Callable[[EscapeSettings, Vehicle, Random], EscapeHandler]


@dataclass(frozen=True, slots=True)
class Algorithm:
    """One row: how to name, describe and make a handler.

    ``requires`` names the optional members of ``hal.Rover`` without which the algorithm cannot work; ``origin`` is
    ``wayfarer`` or where a third-party algorithm comes from.
    """

    name: str
    family: str
    summary: str
    make: HandlerFactory
    requires: frozenset[str] = NOTHING
    origin: str = "wayfarer"


def _row(
    name: str, family: str, summary: str, *, side: TurnSide = clockwise, angle: TurnAngle = fixed_angle,
    stride: StrideLength = short_stride, resets: bool = True, requires: frozenset[str] = NOTHING,
    handler: type[PhasedHandler] = PhasedHandler,
) -> Algorithm:  # fmt: skip
    """Return a row. Only the Pledge family probes, where ``resets`` counts, and keeps its side for a whole episode."""
    pledge = family == "pledge"
    spec = AlgorithmSpec(PLEDGE if pledge else STRIDES, side, angle, stride, resets=resets, keeps_side=pledge)
    return Algorithm(name, family, summary, partial(handler, spec), requires)


# fmt: off
_ROWS = (
    _row("pledge", "pledge", "the paper's baseline: unwind every turn before following the goal again", resets=False),
    _row("forest-pledge", "pledge", "Pledge that also ends an episode when the heading is back at the goal"),
    _row("rand-pledge", "pledge", "Forest-Pledge with a random side for each episode", side=either),
    _row("cv-pledge", "pledge", "Forest-Pledge that first turns away from the touched side",
         side=away_else_clockwise, requires=CONTACT),
    _row("oo-pledge", "pledge", "Forest-Pledge that first turns along an obstacle that leads towards the goal",
         side=along_else_clockwise, requires=CONTACT),
    _row("levy-pledge", "pledge", "Forest-Pledge with a Lévy-distributed turn angle", angle=levy_angle),
    _row("levy-walk", "stochastic", "a uniform new heading and a Lévy-distributed stride",
         side=either, angle=uniform_angle, stride=levy_stride),
    _row("cv-levy", "stochastic", "a Lévy walk whose headings point away from the touched side",
         side=away_else_either, angle=uniform_angle, stride=levy_stride, requires=CONTACT),
    _row("cv-react", "reactive", "steer away from the touched side, then follow the goal again",
         side=away_else_either, requires=CONTACT),
    _row("oo-react", "reactive", "follow an obstacle that leads towards the goal, else steer away from it",
         side=along_else_away, angle=along_angle, requires=CONTACT),
)
_ROWS_BEYOND = (
    _row("retry-pledge", "pledge",
         "Forest-Pledge that tries a second time if a stall may be a slip; it knows a trunk by the rise of its nose, "
         "which was never measured on a rover", handler=RetryHandler),
)
# fmt: on

CATALOGUE: Mapping[str, Algorithm] = {row.name: row for row in _ROWS}
"""The ten of the paper."""
BEYOND_THE_PAPER: Mapping[str, Algorithm] = {row.name: row for row in _ROWS_BEYOND}
BUILT_IN: Mapping[str, Algorithm] = {**CATALOGUE, **BEYOND_THE_PAPER}
