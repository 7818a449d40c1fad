"""The table of algorithms: the ten of the paper, and one more that uses the same sensors.

The paper's differ in four choices and in nothing else: the side of the turn, its angle, what follows the turn, and
whether a heading back at the goal ends the episode. Retry-Pledge is in ``retry``;
``docs/explanation/better-escape.md`` has its evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from random import Random

from wayfarer.escape import policies
from wayfarer.escape.api import EscapeHandler, EscapeSettings, Vehicle
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.phases import PLEDGE, STRIDES
from wayfarer.escape.retry import RetryHandler

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


def _row(name: str, family: str, summary: str, spec: AlgorithmSpec, requires: frozenset[str] = NOTHING) -> Algorithm:
    return Algorithm(name, family, summary, partial(PhasedHandler, spec), requires)


def _pledge(
    name: str,
    summary: str,
    *,
    side: policies.TurnSide = policies.clockwise,
    angle: policies.TurnAngle = policies.fixed_angle,
    resets: bool = True,
    requires: frozenset[str] = NOTHING,
) -> Algorithm:
    spec = AlgorithmSpec(PLEDGE, side, angle, resets=resets, keeps_side=True)
    return _row(name, "pledge", summary, spec, requires)


_ROWS = (
    _pledge("pledge", "the paper's baseline: unwind every turn before following the goal again", resets=False),
    _pledge("forest-pledge", "Pledge that also ends an episode when the heading is back at the goal"),
    _pledge("rand-pledge", "Forest-Pledge with a random side for each episode", side=policies.either),
    _pledge(
        "cv-pledge",
        "Forest-Pledge that first turns away from the touched side",
        side=policies.away_else_clockwise,
        requires=CONTACT,
    ),
    _pledge(
        "oo-pledge",
        "Forest-Pledge that first turns along an obstacle that leads towards the goal",
        side=policies.along_else_clockwise,
        requires=CONTACT,
    ),
    _pledge("levy-pledge", "Forest-Pledge with a Lévy-distributed turn angle", angle=policies.levy_angle),
    _row(
        "levy-walk",
        "stochastic",
        "a uniform new heading and a Lévy-distributed stride",
        AlgorithmSpec(STRIDES, policies.either, policies.uniform_angle, stride=policies.levy_stride),
    ),
    _row(
        "cv-levy",
        "stochastic",
        "a Lévy walk whose headings point away from the touched side",
        AlgorithmSpec(STRIDES, policies.away_else_either, policies.uniform_angle, stride=policies.levy_stride),
        CONTACT,
    ),
    _row(
        "cv-react",
        "reactive",
        "steer away from the touched side, then follow the goal again",
        AlgorithmSpec(STRIDES, policies.away_else_either, policies.fixed_angle),
        CONTACT,
    ),
    _row(
        "oo-react",
        "reactive",
        "follow an obstacle that leads towards the goal, else steer away from it",
        AlgorithmSpec(STRIDES, policies.along_else_away, policies.along_angle),
        CONTACT,
    ),
)

_ROWS_BEYOND = (
    Algorithm(
        "retry-pledge",
        "pledge",
        "Forest-Pledge that tries a second time if a stall may be a slip; no gain is shown in MuJoCo, and the rise of "
        "the nose that it looks for was never measured on a rover",
        RetryHandler,
    ),
)

CATALOGUE: Mapping[str, Algorithm] = {row.name: row for row in _ROWS}
"""The ten of the paper."""
BEYOND_THE_PAPER: Mapping[str, Algorithm] = {row.name: row for row in _ROWS_BEYOND}
BUILT_IN: Mapping[str, Algorithm] = {**CATALOGUE, **BEYOND_THE_PAPER}
