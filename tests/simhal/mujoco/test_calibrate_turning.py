"""``wayfarer calibrate turning`` of a rover in MuJoCo: against the closed forms of docs/explanation/physics.md."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.rover import T_WALL
from tests.simhal.mujoco.fields import A_M, B_M, CONFIG, least_turning_duty, rover_on
from tests.virtual import run_virtually
from wayfarer.commissioning.calibrate import calibrate
from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.config.calibration_file import Calibration, TurningEntry
from wayfarer.config.chassis import STANDARD_GRAVITY_M_S2
from wayfarer.config.factory import calibrated
from wayfarer.simhal.build_rover import device_depth
from wayfarer.simhal.random_streams import RandomStreams


class Willing:
    """A person who says yes."""

    async def say(self, text: str) -> None: ...

    async def ask(self, question: str) -> bool:
        return True

    async def number(self, question: str, default: float) -> float:
        return default

    async def note(self, question: str) -> str:
        return ""

    async def wait(self, text: str) -> None: ...


def measured(folder: Path, friction: float, torque_scale: float = 1.0) -> TurningEntry:
    """Of ForestRover with the noise of its compass and its motion sensor."""
    rover = device_depth(rover_on(friction, torque_scale), RandomStreams(0), CONFIG)
    place = HostEnvironment(folder / "logs", folder / "calibration.json", (), T_WALL, folder)
    entry = run_virtually(calibrate(CONFIG, rover, place, Willing(), ["turning"])).turning
    assert entry is not None
    return entry


@pytest.mark.parametrize("friction", [0.15, 0.3, 0.5, 0.8])
def test_dead_zone_and_track_are_those_of_the_closed_forms(tmp_path: Path, friction: float) -> None:
    entry = measured(tmp_path, friction)
    vehicle = calibrated(CONFIG, Calibration(turning=entry)).vehicle
    assert vehicle.turn_from_duty == pytest.approx(least_turning_duty(friction), rel=0.05)
    # The closed form's rate is free speed x duty beyond the least / (b + a2 / b): a track of twice that.
    assert vehicle.track_m == pytest.approx(2.0 * (B_M + A_M**2 / B_M), rel=0.08)
    assert entry.arc is not None
    assert 0.0 < entry.arc.from_duty < vehicle.turn_from_duty + 0.05


def test_body_whose_motors_cannot_overcome_the_moment_of_friction_is_found_out(tmp_path: Path) -> None:
    assert least_turning_duty(0.8) > 0.5
    entry = measured(tmp_path, 0.8, torque_scale=0.5)
    assert (entry.clockwise, entry.anticlockwise) == (None, None)
    assert calibrated(CONFIG, Calibration(turning=entry)) == CONFIG


def test_gain_of_speed_on_spinning_wheels_is_what_the_ground_holds(tmp_path: Path) -> None:
    entry = measured(tmp_path, 0.05)
    assert entry.speed is not None
    assert entry.speed.gain_m_s2 == pytest.approx(0.05 * STANDARD_GRAVITY_M_S2, rel=0.15)
