"""Duty steps on free ground, from rest and back to it: ``--ground`` of the light world is compared with MuJoCo's.

``python -m tests.simhal.mujoco.duty_steps`` takes them in MuJoCo again and writes ``duty_steps.csv`` beside this file
(10 s). They were taken with MuJoCo 4.0.0.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.simhal.mujoco.fields import on_free_ground
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.world.simulated_world import SimulatedWorld

TABLE = Path(__file__).with_suffix(".csv")
ROVERS = ("sim", "forestrover", "minirover")
FRICTIONS = (0.15, 0.3, 0.5, 0.8)
STRAIGHT = ((0.2, 0.2), (0.5, 0.5), (1.0, 1.0), (-0.5, -0.5))
ON_THE_SPOT = ((0.2, -0.2), (0.3, -0.3), (0.45, -0.45), (0.6, -0.6), (0.8, -0.8), (1.0, -1.0))
ARCS = (
    *((0.42, 0.20), (0.6, 0.0), (0.6, 0.3), (0.5, -0.2), (0.8, 0.0), (1.0, 0.0), (1.0, 0.5)),
    *((0.9, -0.3), (0.2, 0.7), (-0.7, 0.0)),
)
LOOK_S = 0.05
EARLY_S, SETTLED_S, MEAN_OVER_S, STOPPED_S = 0.5, 2.0, 0.5, 1.5


class DutyStep(NamedTuple):
    """What a body does when its duties go from 0 to these and then back to 0.

    Speed and turn rate are the mean from 2 to 2.5 s, ``early`` is how far it has come in the first 0.5 s, and ``stop``
    how far it still comes after that.
    """

    rover: str
    friction: float
    left: float
    right: float
    speed_m_s: float
    turn_deg_s: float
    early_m: float
    early_deg: float
    stop_m: float
    stop_deg: float


def take(world: SimulatedWorld, rover: str, friction: float, left: float, right: float) -> DutyStep:
    """Take one in a world that is at rest on free ground."""
    track = [(world.forward_m - world.reverse_m, world.heading_rad)]
    track += _driven(world, left, right, SETTLED_S + MEAN_OVER_S)
    track += _driven(world, 0.0, 0.0, STOPPED_S)
    turned_deg = np.degrees(np.unwrap([heading_rad for _, heading_rad in track])).tolist()
    came = list(zip((gone_m for gone_m, _ in track), turned_deg, strict=True))
    early, before, after = (came[round(t_s / LOOK_S)] for t_s in (EARLY_S, SETTLED_S, SETTLED_S + MEAN_OVER_S))
    settled = [(end - start) / MEAN_OVER_S for start, end in zip(before, after, strict=True)]
    stop = [end - start for start, end in zip(after, came[-1], strict=True)]
    return DutyStep(rover, friction, left, right, *(round(value, 3) + 0.0 for value in (*settled, *early, *stop)))


def _driven(world: SimulatedWorld, left: float, right: float, for_s: float) -> Iterator[tuple[float, float]]:
    """Drive; yield how far the body has come ahead, and its heading."""
    world.command(left, right)
    from_s = world.t_s
    for look in range(round(for_s / LOOK_S)):
        world.advance_to(from_s + (look + 1) * LOOK_S)
        yield world.forward_m - world.reverse_m, world.heading_rad


def all_steps() -> Iterator[DutyStep]:
    """Take all of them."""
    for rover in ROVERS:
        for friction in FRICTIONS:
            for left, right in (*STRAIGHT, *ON_THE_SPOT, *ARCS):
                yield take(on_free_ground(load_rover(rover), friction), rover, friction, left, right)


def kept_steps() -> list[DutyStep]:
    """Read those of the table."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return [DutyStep(row[0], *map(float, row[1:])) for row in list(csv.reader(file))[1:]]


if __name__ == "__main__":
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows((DutyStep._fields, *all_steps()))
