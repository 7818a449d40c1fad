"""Why a trial was entrapped: ways that are made for each cause, and trials in which a cause is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from math import cos, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.config.rover_file import load_rover
from wayfarer.escape.api import Phase
from wayfarer.experiments.entrapment_cause import Cause, entrapment
from wayfarer.experiments.trajectory import Trajectory, TrajectoryPoint, run_with_trajectory
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk
from wayfarer.simhal.world.shortest_path import is_closed

ROVER = load_rover("sim")
BOX = (  # four trunks around the start, end to end
    Trunk(22.0, 10.0, 22.0, 15.0, "right"),
    Trunk(28.0, 10.0, 28.0, 15.0, "right"),
    Trunk(22.0, 10.0, 28.0, 10.0, "across"),
    Trunk(22.0, 15.0, 28.0, 15.0, "across"),
)
CLOSED = replace(CLEARING, trunks=BOX)


@pytest.fixture(scope="module", autouse=True)
def layouts_asked_once() -> Iterator[None]:
    """Whether a layout is closed takes a tenth of a second to find out; most tests ask it of the same one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("wayfarer.experiments.entrapment_cause.is_closed", cache(is_closed))
        yield


def way(*points: TrajectoryPoint) -> Trajectory:
    return Trajectory(list(points), [])


def cause(trajectory: Trajectory, forest: Forest = CLEARING) -> Cause:
    return entrapment(forest, ROVER, trajectory).why


def around(laps: float, radius_m: float = 3.0) -> Trajectory:
    """Follow a circle for so many laps, a point every quarter of a second."""
    count = round(80 * laps)
    angles_rad = [2.0 * pi * number / 80 for number in range(count)]
    return way(
        *(
            TrajectoryPoint(25.0 + radius_m * sin(a), 12.5 + radius_m * cos(a), Phase.PROBE, 0.25 * number)
            for number, a in enumerate(angles_rad)
        )
    )


def to_and_fro(turned_deg: float, *, touches: bool) -> Trajectory:
    """Back off, turn away for half a second, go on; in one place."""
    points = []
    for number in range(40):
        t_s, heading_deg = 1.5 * number, number * turned_deg
        points += [
            TrajectoryPoint(25.0, 12.5, Phase.BACK_OFF, t_s, heading_deg, touches),
            TrajectoryPoint(25.0, 12.4, Phase.TURN_AWAY, t_s + 0.5, heading_deg),
            TrajectoryPoint(25.0, 12.4, Phase.PROBE, t_s + 1.0, heading_deg + turned_deg),
        ]
    return way(*points)


@pytest.mark.parametrize(("laps", "why"), [(6.0, Cause.ORBITING), (0.9, Cause.OUT_OF_TIME)])
def test_way_that_comes_to_no_new_ground_is_orbiting(laps: float, why: Cause) -> None:
    assert cause(around(laps)) is why


@pytest.mark.parametrize(
    ("turned_deg", "touches", "why"),
    [
        (60.0, True, Cause.WEDGED),
        (60.0, False, Cause.STALLED),
        (5.0, True, Cause.CANNOT_TURN),
        (5.0, False, Cause.CANNOT_TURN),
    ],
)
def test_way_in_one_place_is_told_by_turns_and_contact(turned_deg: float, touches: bool, why: Cause) -> None:
    assert cause(to_and_fro(turned_deg, touches=touches)) is why


def test_turn_that_an_obstacle_blocks_says_nothing_of_turning() -> None:
    blocked = [point._replace(touches=True) for point in to_and_fro(0.0, touches=True).points]
    found = entrapment(CLEARING, ROVER, way(*blocked))
    assert (found.why, found.turned, found.touching) == (Cause.WEDGED, None, 1.0)


def test_standing_after_giving_up_does_not_count() -> None:
    orbit = around(6.0).points
    end = orbit[-1]
    stood = [end._replace(phase=Phase.HALT, t_s=end.t_s + wait_s) for wait_s in (0.05, 10_000.0)]
    assert cause(way(*orbit, *stood)) is Cause.ORBITING


@given(st.lists(st.tuples(st.floats(0, 50), st.floats(0, 50), st.sampled_from(Phase), st.booleans()), min_size=1))
def test_every_way_has_a_cause_and_shares_are_shares(seen: list[tuple[float, float, Phase, bool]]) -> None:
    points = [TrajectoryPoint(x_m, y_m, phase, 0.5 * n, 0.0, hit) for n, (x_m, y_m, phase, hit) in enumerate(seen)]
    found = entrapment(CLEARING, ROVER, way(*points))
    assert found.why is not Cause.CLOSED
    assert 0.0 <= found.touching <= 1.0
    assert 0.0 <= found.new <= 1.0


def test_layout_is_closed_where_not_even_an_edge_can_be_reached() -> None:
    assert not is_closed(CLEARING)
    assert is_closed(CLOSED)
    assert not is_closed(replace(CLEARING, trunks=BOX[:3]))
    wall = replace(CLEARING, trunks=(Trunk(0.0, 30.0, 50.0, 30.0, "across"),))
    assert not is_closed(wall)  # over the other edges


@pytest.mark.parametrize(("gap_m", "why"), [(0.5, Cause.NARROW), (0.9, Cause.ORBITING)])
def test_way_out_that_is_no_wider_than_the_diagonal_is_narrow(gap_m: float, why: Cause) -> None:
    edge_m = 25.0 + (gap_m + CLEARING.trunk_diameter_m) / 2.0  # the body of sim.toml: 0.4 m wide, 0.57 m across
    north = Trunk(22.0, 15.0, 50.0 - edge_m, 15.0, "across"), Trunk(edge_m, 15.0, 28.0, 15.0, "across")
    assert cause(around(6.0), replace(CLEARING, trunks=(*BOX[:3], *north))) is why


def test_trial_in_a_closed_layout_says_so() -> None:
    spec = TrialSpec(0, "forest-pledge", CLOSED, 5, ROVER, budget_m=60.0)
    result, trajectory = run_with_trajectory(spec)
    assert result.outcome == "entrapped"
    assert cause(trajectory, CLOSED) is Cause.CLOSED
    assert cause(trajectory) is Cause.ORBITING  # were it not for the trunks all round
