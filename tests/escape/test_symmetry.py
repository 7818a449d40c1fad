"""What must not change a decision: where north is, and which hand is which."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.escape.walk import make, observation
from wayfarer.escape.api import Anomaly, Decision, Observation
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import ContactReading, Side, WheelCommand

# Angles are whole multiples of 1/64 degree: sums of them are exact, so that equality can be too.
GRID = 64
TURN = 360 * GRID


class Tick(NamedTuple):
    """One observation on the grid, before it is turned or mirrored."""

    dt_s: float
    heading: int
    travelled_m: float
    anomalies: tuple[Anomaly, ...]
    sides: tuple[Side, ...]
    axis: int | None


ANOMALIES = st.one_of(st.just(()), st.sampled_from([(anomaly,) for anomaly in Anomaly]))


def ticks(
    sides: st.SearchStrategy[tuple[Side, ...]], axis: st.SearchStrategy[int | None]
) -> st.SearchStrategy[list[Tick]]:
    tick = st.builds(
        Tick,
        st.sampled_from([0.0625, 0.25, 2.0]),
        st.integers(0, TURN - 1),
        st.sampled_from([0.0, 0.0625, 0.5]),
        ANOMALIES,
        sides,
        axis,
    )
    return st.lists(tick, min_size=5, max_size=40)


ANY_TICKS = ticks(st.lists(st.sampled_from(Side), unique=True).map(tuple), st.none() | st.integers(0, 180 * GRID - 1))


def play(name: str, walk: list[Tick], see: Callable[[Tick], Observation]) -> list[Decision]:
    handler = make(name)
    t_s = travelled_m = 0.0
    decisions = []
    for tick in walk:
        t_s += tick.dt_s
        travelled_m += tick.travelled_m
        decisions.append(handler.decide(see(tick)._replace(t_s=t_s, travelled_m=travelled_m)))
    return decisions


def turned(by: int) -> Callable[[Tick], Observation]:
    def see(tick: Tick) -> Observation:
        axis_deg = None if tick.axis is None else (tick.axis + by) % (180 * GRID) / GRID
        return observation(
            heading_deg=(tick.heading + by) % TURN / GRID,
            goal_heading_deg=by % TURN / GRID,
            anomalies=tick.anomalies,
            contact=ContactReading(0.0, tick.sides, axis_deg),
        )

    return see


@pytest.mark.parametrize("name", CATALOGUE)
@given(walk=ANY_TICKS, by=st.integers(0, TURN - 1))
@settings(max_examples=25, deadline=None)
def test_turning_all_headings_changes_nothing(name: str, walk: list[Tick], by: int) -> None:
    assert play(name, walk, turned(by)) == play(name, walk, turned(0))


HANDS = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}


def mirrored(tick: Tick) -> Observation:
    axis_deg = None if tick.axis is None else -tick.axis % (180 * GRID) / GRID
    return observation(
        heading_deg=-tick.heading % TURN / GRID,
        anomalies=tick.anomalies,
        contact=ContactReading(0.0, tuple(HANDS[side] for side in tick.sides), axis_deg),
    )


# Headings, axes and the differences between them never lie on a point that is its own mirror image (0, 90, 180).
ONE_SIDE = st.sampled_from([(Side.LEFT,), (Side.RIGHT,)])
SKEWED_TICKS = ticks(ONE_SIDE, st.integers(0, 180 * GRID // 4 - 1).map(lambda n: 4 * n + 1)).map(
    lambda walk: [tick._replace(heading=tick.heading // 4 * 4 + 2) for tick in walk]
)
COMPATIBLE_TICKS = SKEWED_TICKS.map(
    lambda walk: [tick._replace(axis=((tick.axis or 0) % (40 * GRID) - 20 * GRID) // 4 * 4 + 1) for tick in walk]
)


def swap(decision: Decision) -> Decision:
    left, right = decision.wheels
    return decision._replace(wheels=WheelCommand(right, left))


@pytest.mark.parametrize(
    ("name", "walks"),
    [
        ("cv-pledge", SKEWED_TICKS),
        ("cv-react", SKEWED_TICKS),
        ("cv-levy", SKEWED_TICKS),
        ("oo-react", SKEWED_TICKS),
        ("oo-pledge", COMPATIBLE_TICKS),
    ],
)
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_mirroring_the_world_mirrors_the_wheels(
    name: str, walks: st.SearchStrategy[list[Tick]], data: st.DataObject
) -> None:
    walk = data.draw(walks)
    assert play(name, walk, mirrored) == [swap(decision) for decision in play(name, walk, turned(0))]
