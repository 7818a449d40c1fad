"""Ground that slopes as a whole, in both physics: what the sensors feel, how the body drives, what commands keep."""

from __future__ import annotations

import json
from dataclasses import replace
from math import cos, hypot, radians, sin
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.simhal.clearing import STEADY, VEHICLE
from tests.simhal.commands import facts_of, succeed
from tests.simhal.mujoco.fields import BODY, CONFIG, STALL_N, WEIGHT_N, drive, rover_on, speed_m_s
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.experiments.results import Results
from wayfarer.simhal.faults.world import Slope as SlopeFault
from wayfarer.simhal.mujoco.model import gravity_m_s2
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.simulated_world import Hillside
from wayfarer.simhal.world.skid_steering import SkidSteering
from wayfarer.simhal.world.world import World

SIM = ("sim", "--jobs", "1", "--trials", "2", "--budget-m", "5")


def sloping(slope_deg: float, direction_deg: float = 0.0) -> Physics:
    return replace(STEADY, slope_deg=slope_deg, slope_direction_deg=direction_deg)


# The goal uphill, on ground that rises to the right, downhill, on ground that rises to the left.
DIRECTIONS = [(0.0, (10.0, 0.0)), (90.0, (0.0, -10.0)), (180.0, (-10.0, 0.0)), (270.0, (0.0, 10.0))]


@pytest.mark.parametrize(("direction_deg", "tilt_deg"), DIRECTIONS)
def test_on_the_way_to_the_goal_the_slope_is_pitch_along_it_and_roll_across(
    direction_deg: float, tilt_deg: tuple[float, float]
) -> None:
    for world in (
        World(CLEARING, VEHICLE, sloping(10.0, direction_deg), RandomStreams(0)),
        rover_on(0.8, physics=sloping(10.0, direction_deg)),
    ):
        assert world.attitude()[1:] == pytest.approx(tilt_deg, abs=0.1)
        assert (world.pitch_deg, world.roll_deg) == pytest.approx((0.0, 0.0), abs=0.1), "of the body itself"


def test_direction_counts_from_the_forests_heading_and_stays_where_it_is_when_the_body_turns() -> None:
    world = World(replace(CLEARING, heading_deg=30.0), VEHICLE, sloping(10.0), RandomStreams(0))
    for heading_deg, tilt_deg in ((30.0, (10.0, 0.0)), (120.0, (0.0, 10.0)), (210.0, (-10.0, 0.0))):
        world.heading_rad = radians(heading_deg)
        assert world.attitude()[1:] == pytest.approx(tilt_deg)


@pytest.mark.parametrize("heading_deg", [0.0, 40.0, 200.0])
def test_tilt_is_that_of_gravity_on_the_plane_with_any_heading(heading_deg: float) -> None:
    hillside, heading_rad = Hillside(15.0, 70.0), radians(heading_deg)
    east, north, up = gravity_m_s2(*hillside.attitude_deg(heading_rad), heading_rad)
    along = STANDARD_GRAVITY_M_S2 * sin(radians(15.0))
    assert (east, north) == pytest.approx((-along * sin(radians(70.0)), -along * cos(radians(70.0))))
    assert up == pytest.approx(-STANDARD_GRAVITY_M_S2 * cos(radians(15.0)))
    assert hillside.rise(heading_rad) == pytest.approx(sin(radians(hillside.attitude_deg(heading_rad)[0])))


def test_slope_and_the_fault_slope_add_and_the_slope_remains() -> None:
    world = rover_on(0.8, physics=sloping(6.0))
    before = world.model.opt.gravity.tolist()
    with SlopeFault(pitch_deg=4.0).effect(world, None):  # type: ignore[arg-type]
        world.advance_to(0.1)
        assert world.attitude()[1] == pytest.approx(10.0, abs=0.2)
        assert world.model.opt.gravity.tolist() == pytest.approx(gravity_m_s2(10.0, 0.0, 0.0))
    world.advance_to(0.2)
    assert world.model.opt.gravity.tolist() == pytest.approx(before, abs=1e-3)


def test_body_slides_down_across_a_slope_that_is_steeper_than_its_grip() -> None:
    world = rover_on(0.2, physics=sloping(20.0, 90.0))
    world.advance_to(1.0)
    assert world.right_m < -0.1, "the ground rises to the right"


def on_ground(friction: float, slope_deg: float, direction_deg: float = 0.0) -> World:
    physics = sloping(slope_deg, direction_deg)
    skid = SkidSteering(BODY, friction, CONFIG.vehicle.track_m, physics.step_s)
    return World(CLEARING, CONFIG.vehicle, physics, RandomStreams(0), skid=skid)


def light_m_s(friction: float, slope_deg: float, direction_deg: float, duty: float) -> float:
    """The speed over half a second after two."""
    world = on_ground(friction, slope_deg, direction_deg)
    world.command(duty, duty)
    world.advance_to(2.0)
    from_m = world.forward_m - world.reverse_m
    world.advance_to(2.5)
    return 2.0 * (world.forward_m - world.reverse_m - from_m)


@pytest.mark.parametrize("slope_deg", [5.0, 15.0])
@pytest.mark.parametrize("duty", [-0.3, 0.3, 1.0])
def test_gravity_takes_uphill_what_it_gives_downhill_as_in_the_closed_form(slope_deg: float, duty: float) -> None:
    taken_m_s = CONFIG.vehicle.max_speed_m_s * WEIGHT_N * sin(radians(slope_deg)) / STALL_N
    level_m_s = light_m_s(0.65, 0.0, 0.0, duty)
    assert light_m_s(0.65, slope_deg, 0.0, duty) == pytest.approx(level_m_s - taken_m_s, abs=0.001)
    assert light_m_s(0.65, slope_deg, 180.0, duty) == pytest.approx(level_m_s + taken_m_s, abs=0.001)
    assert light_m_s(0.65, slope_deg, 90.0, duty) == pytest.approx(level_m_s, abs=0.001)


@pytest.mark.parametrize(("slope_deg", "direction_deg"), [(5.0, 0.0), (10.0, 0.0), (15.0, 180.0)])
@pytest.mark.parametrize("duty", [0.0, 0.3, 1.0])
def test_light_world_drives_up_and_down_as_mujoco_does(slope_deg: float, direction_deg: float, duty: float) -> None:
    world = rover_on(0.5, physics=sloping(slope_deg, direction_deg))
    drive(world, duty, duty, 2.0)
    assert light_m_s(0.5, slope_deg, direction_deg, duty) == pytest.approx(speed_m_s(world), abs=0.05)


def test_slope_steeper_than_the_grip_cannot_be_climbed() -> None:
    assert light_m_s(0.3, 15.0, 0.0, 1.0) > 0.5
    assert light_m_s(0.3, 20.0, 0.0, 1.0) < -0.5


def test_body_without_duty_holds_on_a_gentle_slope_and_creeps_down_a_steeper_one() -> None:
    held, creeping = on_ground(0.65, 2.5), on_ground(0.65, 10.0)  # rolling resistance holds 0.05, 2.9 degrees
    for world in (held, creeping):
        world.advance_to(3.0)
    assert held.path_m == 0.0
    assert creeping.reverse_m > 0.1


def test_on_ideal_ground_the_body_goes_as_commanded() -> None:
    ways = []
    for slope_deg in (0.0, 20.0):
        world = World(CLEARING, VEHICLE, sloping(slope_deg), RandomStreams(0))
        world.command(0.5, 0.4)
        world.advance_to(3.0)
        ways.append((world.x_m, world.y_m, world.heading_rad))
    assert ways[0] == ways[1]


def test_rover_is_put_down_where_it_was_and_gravity_pulls_again_at_once() -> None:
    world = rover_on(0.5, physics=sloping(12.0, 30.0))
    drive(world, 0.5, 0.5, 1.0)
    place, gravity = (world.x_m, world.y_m), world.model.opt.gravity.tolist()
    world.pull_back(0.0)
    assert hypot(world.x_m - place[0], world.y_m - place[1]) < 0.01
    assert world.model.opt.gravity.tolist() == pytest.approx(gravity, abs=0.01)


# -- through the commands ----------------------------------------------------------------------------------------


def test_slope_is_drawn_kept_told_and_rebuilt(run: Run, tmp_path: Path) -> None:
    asked = (*SIM, "--set", "sim.slope_deg=2:12", "--set", "sim.slope_direction_deg=90")
    succeed(run, *asked, "--out", tmp_path / "out", "--log-dir", tmp_path / "log")
    results = Results.open(tmp_path / "out")
    assert results.plan.base.set == {"sim.slope_deg": (2.0, 12.0), "sim.slope_direction_deg": 90}
    assert results.rebuild().set == results.plan.base.set
    assert facts_of(results)["sim.slope_deg"] == "2 to 12, drawn for each trial"
    slopes_deg = [row.drawn["sim.slope_deg"] for row in results.rows]
    assert all(isinstance(slope_deg, float) and 2.0 <= slope_deg <= 12.0 for slope_deg in slopes_deg)
    assert slopes_deg[0] != slopes_deg[1]
    logs = sorted(path for path in (tmp_path / "log").rglob("*.jsonl"))
    for log, slope_deg in zip(logs, slopes_deg, strict=True):
        header = json.loads(log.read_text(encoding="utf-8").splitlines()[0])
        assert header["sim"] == {"slope_deg": slope_deg, "slope_direction_deg": 90.0}
    other = (*SIM, "--set", "sim.slope_deg=2:11", "--set", "sim.slope_direction_deg=90")
    err = refusal(run, *other, "--out", tmp_path / "out", "--resume")
    assert "set.sim.slope_deg is [2.0, 12.0] there and [2.0, 11.0] here" in err


def test_slope_can_be_swept(run: Run, tmp_path: Path) -> None:
    sweep = ("sweep", "ground=ideal,dry-soil", "sim.slope_deg=0,10", "--trials", "1", "--budget-m", "5")
    succeed(run, *sweep, "--jobs", "1", "--out", tmp_path / "out")
    rows = [row.split(",") for row in (tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()[1:]]
    assert [row[1:3] for row in rows] == [["ideal", "0"], ["ideal", "10"], ["dry-soil", "0"], ["dry-soil", "10"]]
    assert rows[2][3:] != rows[3][3:], "it drives uphill"
