"""The outcome monitor's calls, from ground truth alone."""

from __future__ import annotations

import pytest

from tests.simhal.clearing import steady_world
from wayfarer.experiments.outcome import OutcomeMonitor
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.world import World

TIP_DEG = 60.0


@pytest.fixture
def world() -> World:
    return steady_world()


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


@pytest.mark.parametrize(
    ("truth", "path_m"), [({"y_m": 50.0}, 42.5), ({"x_m": 50.5, "y_m": 20.0}, 72.5), ({"t_s": 400.0}, 42.5)]
)
def test_path_counts_reversing_and_out_of_bounds_the_way_that_remains_north(
    world: World, outcome_monitor: OutcomeMonitor, truth: dict[str, float], path_m: float
) -> None:
    for name, value in {"forward_m": 40.0, "reverse_m": 2.5, **truth}.items():
        setattr(world, name, value)
    outcome_monitor.watch(world)
    assert outcome_monitor.path_m(world) == path_m
