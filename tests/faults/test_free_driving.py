"""A healthy rover drives freely: the detector says nothing."""

from __future__ import annotations

import pytest

from tests.faults.free_driving import drive_freely
from tests.faults.free_minutes import ground
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.world.physics import GroundName

pytest.importorskip("mujoco", reason="MuJoCo is not installed")  # here, for its first import starts a process


@pytest.mark.long
@pytest.mark.parametrize("torque_scale", [1.0, 3.0])
@pytest.mark.parametrize("friction", [0.1, 0.15, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("rover", ["sim", "forestrover", "minirover"])
def test_no_fault_is_said_of_a_healthy_rover_on_any_ground(rover: str, friction: float, torque_scale: float) -> None:
    assert not drive_freely(load_rover(rover), ground(friction, torque_scale), 60.0, seed=0)


def test_no_fault_is_said_of_a_healthy_rover_on_slippery_ground() -> None:
    assert not drive_freely(load_rover("sim"), ground(0.15, 1.0), 30.0, seed=0)


def test_no_fault_is_said_in_ten_minutes_on_mud_in_physics_light() -> None:
    assert not drive_freely(load_rover("sim"), None, 600.0, seed=0, ground=GroundName.mud)
