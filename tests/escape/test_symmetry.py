"""Which hand is which must not change a decision; that north must not either, ``check_algorithm`` looks."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.escape.walk import make, observation
from wayfarer.escape.api import Anomaly, Decision, Observation
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
    axis: int


ANOMALIES = st.one_of(st.just(()), st.sampled_from([(anomaly,) for anomaly in Anomaly]))


def ticks(sides: st.SearchStrategy[tuple[Side, ...]], axis: st.SearchStrategy[int]) -> st.SearchStrategy[list[Tick]]:
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


def play(name: str, walk: list[Tick], see: Callable[[Tick], Observation]) -> list[Decision]:
    handler = make(name)
    t_s = travelled_m = 0.0
    decisions = []
    for tick in walk:
        t_s += tick.dt_s
        travelled_m += tick.travelled_m
        decisions.append(handler.decide(see(tick)._replace(t_s=t_s, travelled_m=travelled_m)))
    return decisions


def as_it_is(tick: Tick) -> Observation:
    contact = ContactReading(0.0, tick.sides, tick.axis / GRID)
    return observation(heading_deg=tick.heading / GRID, anomalies=tick.anomalies, contact=contact)


HANDS = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}


def mirrored(tick: Tick) -> Observation:
    contact = ContactReading(0.0, tuple(HANDS[side] for side in tick.sides), -tick.axis % (180 * GRID) / GRID)
    return observation(heading_deg=-tick.heading % TURN / GRID, anomalies=tick.anomalies, contact=contact)


# Headings, axes and the differences between them never lie on a point that is its own mirror image (0, 90, 180).
ONE_SIDE = st.sampled_from([(Side.LEFT,), (Side.RIGHT,)])
SKEWED_TICKS = ticks(ONE_SIDE, st.integers(0, 180 * GRID // 4 - 1).map(lambda n: 4 * n + 1)).map(
    lambda walk: [tick._replace(heading=tick.heading // 4 * 4 + 2) for tick in walk]
)
COMPATIBLE_TICKS = SKEWED_TICKS.map(
    lambda walk: [tick._replace(axis=(tick.axis % (40 * GRID) - 20 * GRID) // 4 * 4 + 1) for tick in walk]
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
    assert play(name, walk, mirrored) == [swap(decision) for decision in play(name, walk, as_it_is)]
