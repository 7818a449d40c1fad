"""Classifies why a trial ended entrapped, from the rover's true path.

Looked at is the second half, by time, of what it drove: what went on when it had long ceased to get anywhere. The
bounds are from no source, chosen to be plain; the figures that are held against them are told with the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from math import hypot
from typing import NamedTuple

from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.api import Phase
from wayfarer.experiments.trajectory import Trajectory, TrajectoryPoint
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.shortest_path import is_closed

PLACE_M = 1.0  # the side of the squares that count as places: a lap beside the last one is a return
IN_ONE_PLACE_LENGTHS = 2.0  # a path that stays within so many body lengths leads nowhere
TURNS_BELOW_SHARE = 0.2  # of the turn that was asked for; lag and blocked turns leave 0.6 to 0.8 in physics-light
ASKED_AT_LEAST_DEG = 180.0  # in all; less asked for says nothing
AGAINST_FROM_SHARE = 0.1  # of the time: a rover that backs off and tries again touches nothing most of it
NEW_BELOW_SHARE = 1.0 / 3.0  # of the places of the second half


class Cause(StrEnum):
    """What kept a rover in, in the order in which it is asked."""

    CLOSED = "closed layout"
    CANNOT_TURN = "cannot turn"
    WEDGED = "wedged"
    STALLED = "stalled in the open"
    NARROW = "narrow way"
    ORBITING = "orbiting"
    OUT_OF_TIME = "out of time"


EXPLAINED = {
    Cause.CLOSED: "no free path leads to the goal line or over an edge, for a body of this width",
    Cause.CANNOT_TURN: f"away from obstacles, under {TURNS_BELOW_SHARE:.0%} of the commanded turn was completed",
    Cause.WEDGED: f"it stayed within {IN_ONE_PLACE_LENGTHS:g} lengths of its body, touching something",
    Cause.STALLED: f"it stayed within {IN_ONE_PLACE_LENGTHS:g} lengths of its body and touched hardly anything",
    Cause.NARROW: "a path out is as wide as this body, none as wide as its diagonal: it cannot turn everywhere",
    Cause.ORBITING: f"under {NEW_BELOW_SHARE:.0%} of the places that it visited were new",
    Cause.OUT_OF_TIME: "it still came to new places when its time or path was used up",
}


class Entrapment(NamedTuple):
    """Why a rover did not get out, and the figures of the second half of its trial.

    ``middle_m`` is the middle of the ground that it kept to, east and north, and ``extent_m`` its diagonal;
    ``touching`` is the share of the time in which it was against something, ``turned`` the share of the turn on the
    spot that was asked for in the open and came about (None where hardly any was), and ``new`` the share of its places
    where it had not been in the first half.
    """

    why: Cause
    middle_m: tuple[float, float]
    extent_m: float
    touching: float
    turned: float | None
    new: float


def entrapment(forest: Forest, rover: RoverConfig, trajectory: Trajectory) -> Entrapment:
    """Return why the rover of this trajectory was entrapped."""
    vehicle, points = rover.vehicle, _driven(trajectory.points)
    halfway_s = (points[0].t_s + points[-1].t_s) / 2.0
    late = [point for point in points if point.t_s >= halfway_s]
    xs_m, ys_m = [point.x_m for point in late], [point.y_m for point in late]
    west_m, east_m, south_m, north_m = min(xs_m), max(xs_m), min(ys_m), max(ys_m)
    extent_m, touching = hypot(east_m - west_m, north_m - south_m), _touching(late)
    turned = _turned(late, rover.escape.turn_deg_s)
    places, before = _places(late), _places([point for point in points if point.t_s < halfway_s])
    new = len(places - before) / len(places)
    if is_closed(forest, vehicle.width_m):
        why = Cause.CLOSED
    elif turned is not None and turned < TURNS_BELOW_SHARE:
        why = Cause.CANNOT_TURN
    elif extent_m <= IN_ONE_PLACE_LENGTHS * vehicle.length_m:
        why = Cause.WEDGED if touching >= AGAINST_FROM_SHARE else Cause.STALLED
    elif is_closed(forest, hypot(vehicle.width_m, vehicle.length_m)):
        why = Cause.NARROW
    else:
        why = Cause.ORBITING if new < NEW_BELOW_SHARE else Cause.OUT_OF_TIME
    middle_m = (west_m + east_m) / 2.0, (south_m + north_m) / 2.0
    return Entrapment(why, middle_m, extent_m, touching, turned, new)


def _driven(points: Sequence[TrajectoryPoint]) -> Sequence[TrajectoryPoint]:
    """Return the path without the standstill at its end after the rover gave up."""
    last = max((number for number, point in enumerate(points) if point.phase is not Phase.HALT), default=0)
    return points[: last + 2]


def _touching(points: Sequence[TrajectoryPoint]) -> float:
    """Return the share of the time that was spent against something."""
    lasted_s = points[-1].t_s - points[0].t_s
    return sum(after.t_s - at.t_s for at, after in pairwise(points) if at.touches) / lasted_s if lasted_s else 0.0


def _turned(points: Sequence[TrajectoryPoint], asked_deg_s: float) -> float | None:
    """Return how much of the turn that was asked for while nothing was touched came about."""
    asked_deg = turned_deg = 0.0
    for at, after in pairwise(points):
        if at.phase is Phase.TURN_AWAY and not at.touches:
            asked_deg += asked_deg_s * (after.t_s - at.t_s)
            turned_deg += abs(after.heading_deg - at.heading_deg)
    return turned_deg / asked_deg if asked_deg >= ASKED_AT_LEAST_DEG else None


def _places(points: Sequence[TrajectoryPoint]) -> set[tuple[int, int]]:
    return {(int(point.x_m // PLACE_M), int(point.y_m // PLACE_M)) for point in points}
