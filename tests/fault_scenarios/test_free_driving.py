"""A healthy rover drives freely, and the detector has nothing to say of it; one with a dead side, and it has."""

from __future__ import annotations

from math import inf

import pytest

from tests.fault_scenarios.free_driving import drive_freely
from tests.fault_scenarios.free_minutes import ground
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.faults.kinds import Drive, Fault
from wayfarer.simhal.world.grounds import GroundName

pytest.importorskip("mujoco", reason="MuJoCo is not installed")  # here, for its first import starts a process


@pytest.mark.long
@pytest.mark.parametrize("torque_scale", [1.0, 3.0])
@pytest.mark.parametrize("friction", [0.1, 0.15, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("rover", ["sim", "forestrover", "minirover"])
def test_nothing_is_said_of_a_healthy_rover_on_any_ground(rover: str, friction: float, torque_scale: float) -> None:
    assert drive_freely(load_rover(rover), ground(friction, torque_scale), 60.0, seed=0) == []


def test_nothing_is_said_of_a_healthy_rover_on_slippery_ground() -> None:
    assert drive_freely(load_rover("sim"), ground(0.15, 1.0), 30.0, seed=0) == []


def test_dead_side_is_found_where_the_ground_lets_the_rover_turn() -> None:
    dead = Fault(3.0, inf, "world", "drive", Drive(left_gain=0.0))
    said = drive_freely(load_rover("sim"), ground(0.15, 1.0), 60.0, seed=0, faults=[dead])
    assert "drive_suspected" in {name for _, name in said}


def test_nothing_is_said_in_ten_minutes_on_mud_in_physics_light() -> None:
    assert drive_freely(load_rover("sim"), None, 600.0, seed=0, ground=GroundName.mud) == []
