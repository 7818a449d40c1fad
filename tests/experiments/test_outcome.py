"""The outcome monitor's calls, from ground truth alone."""

from __future__ import annotations

import pytest

from wayfarer.escape.api import Vehicle
from wayfarer.experiments.outcome import OutcomeMonitor
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())
TIP_DEG = 60.0


@pytest.fixture
def world() -> World:
    return World(CLEARING, Vehicle(0.4, 0.4, 0.5, 1.4), Physics(), RandomStreams(0))


@pytest.fixture
def calls() -> list[str]:
    return []


@pytest.fixture
def outcome_monitor(calls: list[str]) -> OutcomeMonitor:
    return OutcomeMonitor(CLEARING, 100.0, TIP_DEG, lambda reason, _text: calls.append(reason))


@pytest.mark.parametrize(
    ("truth", "outcome"),
    [
        ({"y_m": 50.0}, "escaped"),
        ({"y_m": 49.999}, None),
        ({"y_m": 50.1, "x_m": 50.1}, "escaped"),
        ({"x_m": 50.001}, "left_bounds"),
        ({"x_m": 50.0}, None),
        ({"x_m": -0.001}, "left_bounds"),
        ({"y_m": -0.001}, "left_bounds"),
        ({"forward_m": 60.0, "reverse_m": 39.999}, None),
        ({"forward_m": 60.0, "reverse_m": 40.0}, "entrapped"),
        ({"t_s": 399.9}, None),
        ({"t_s": 400.0}, "entrapped"),
        ({"pitch_deg": 59.9}, None),
        ({"pitch_deg": 60.0}, "tipped"),
        ({"pitch_deg": -60.0}, "tipped"),
        ({"y_m": 50.0, "forward_m": 100.0}, "escaped"),
        ({"pitch_deg": 60.0, "forward_m": 100.0}, "tipped"),
    ],
)
def test_outcome_follows_from_ground_truth(
    world: World, outcome_monitor: OutcomeMonitor, calls: list[str], truth: dict[str, float], outcome: str | None
) -> None:
    for name, value in truth.items():
        setattr(world, name, value)
    outcome_monitor.watch(world)
    assert outcome_monitor.outcome == outcome
    assert calls == ([outcome] if outcome else [])


def test_first_call_stands_and_is_made_once(world: World, outcome_monitor: OutcomeMonitor, calls: list[str]) -> None:
    world.x_m = 51.0
    outcome_monitor.watch(world)
    world.x_m, world.y_m = 25.0, 51.0
    outcome_monitor.watch(world)
    assert (outcome_monitor.outcome, calls) == ("left_bounds", ["left_bounds"])


def test_path_counts_reversing(world: World, outcome_monitor: OutcomeMonitor) -> None:
    world.forward_m, world.reverse_m, world.y_m = 40.0, 2.5, 50.0
    outcome_monitor.watch(world)
    assert outcome_monitor.path_m(world) == 42.5


def test_rover_that_left_bounds_still_has_the_way_north_to_go(world: World, outcome_monitor: OutcomeMonitor) -> None:
    world.forward_m, world.reverse_m, world.x_m, world.y_m = 40.0, 2.5, 50.5, 20.0
    outcome_monitor.watch(world)
    assert outcome_monitor.path_m(world) == 72.5


def test_entrapped_rover_has_only_the_path_that_it_drove(world: World, outcome_monitor: OutcomeMonitor) -> None:
    world.forward_m = 101.0
    outcome_monitor.watch(world)
    assert (outcome_monitor.outcome, outcome_monitor.path_m(world)) == ("entrapped", 101.0)
