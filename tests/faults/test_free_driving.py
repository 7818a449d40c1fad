"""A healthy rover drives freely: the detector may suspect a side, which a self-test clears, and says nothing else."""

from __future__ import annotations

from math import inf

import pytest

from tests.faults.free_driving import drive_freely
from tests.faults.free_minutes import ground
from wayfarer.config.rover_file import load_rover
from wayfarer.safety.conditions import Condition
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Drive
from wayfarer.simhal.world.physics import GroundName

pytest.importorskip("mujoco", reason="MuJoCo is not installed")  # here, for its first import starts a process


def besides_suspicions(said: list[tuple[float, str]]) -> list[tuple[float, str]]:
    return [each for each in said if each[1] != Condition.DRIVE_SUSPECTED.value]


@pytest.mark.long
@pytest.mark.parametrize("torque_scale", [1.0, 3.0])
@pytest.mark.parametrize("friction", [0.1, 0.15, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("rover", ["sim", "forestrover", "minirover"])
def test_no_fault_is_said_of_a_healthy_rover_on_any_ground(rover: str, friction: float, torque_scale: float) -> None:
    assert not besides_suspicions(drive_freely(load_rover(rover), ground(friction, torque_scale), 60.0, seed=0))


def test_no_fault_is_said_of_a_healthy_rover_on_slippery_ground() -> None:
    assert not besides_suspicions(drive_freely(load_rover("sim"), ground(0.15, 1.0), 30.0, seed=0))


def test_dead_side_is_found_where_the_ground_lets_the_rover_turn() -> None:
    dead = Fault(3.0, inf, "world", "drive", Drive(left_gain=0.0))
    said = drive_freely(load_rover("sim"), ground(0.15, 1.0), 60.0, seed=0, faults=[dead])
    assert "drive_suspected" in {name for _, name in said}


def test_no_fault_is_said_in_ten_minutes_on_mud_in_physics_light() -> None:
    said = drive_freely(load_rover("sim"), None, 600.0, seed=0, ground=GroundName.mud)
    assert not besides_suspicions(said)
    assert len(said) <= 10, "a suspicion costs 3 s"
