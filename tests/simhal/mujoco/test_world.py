"""The world in MuJoCo behind the seam: what parts, outcome monitor and faults see of it, and do to it."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from math import degrees
from operator import attrgetter
from pathlib import Path
from random import Random

import mujoco
import pytest

from tests.simhal.mujoco.fields import BODY, drive, rover_on, speed_m_s, tree_at, trunk_across
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.hal import Side
from wayfarer.simhal.faults.kinds import KINDS
from wayfarer.simhal.faults.world import Drive, Slip, Slope, WorldFault
from wayfarer.simhal.mujoco import ground
from wayfarer.simhal.mujoco.ground import MUD_FRICTION
from wayfarer.simhal.mujoco.model import Unstable
from wayfarer.simhal.mujoco.world import OBSERVE_EVERY_STEPS, MujocoWorld
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.simulated_world import SimulatedWorld

TURN = (0.8, -0.8)


def state(world: MujocoWorld) -> list[float]:
    return [*world.data.qpos.tolist(), *world.data.qvel.tolist(), world.forward_m, world.reverse_m, world.right_m]


def test_rover_at_rest_stays_where_it_is() -> None:
    world = rover_on(0.5)
    world.advance_to(20.0)
    assert (world.x_m, world.y_m) == pytest.approx((25.0, 12.5), abs=1e-6)
    assert (world.path_m, world.pitch_deg, world.roll_deg) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


@pytest.mark.parametrize("heading_deg", [0.0, 60.0, 200.0, 330.0])
def test_rover_sets_out_along_its_heading(heading_deg: float) -> None:
    world = rover_on(0.5, forest=replace(CLEARING, heading_deg=heading_deg))
    assert degrees(world.heading_rad) % 360.0 == pytest.approx(heading_deg, abs=0.01)
    drive(world, 0.5, 0.5, 2.0)
    assert world.forward_m > 0.5
    assert world.reverse_m == 0.0


@pytest.mark.parametrize("roughness_m", [0.0, 0.01])
def test_what_happens_does_not_depend_on_who_asks_when(roughness_m: float) -> None:
    states = []
    for pieces in (1, 7, 61):
        world = rover_on(0.3, roughness_m=roughness_m, forest=tree_at(25.0, 13.5))
        for left, right in ((0.6, 0.5), (-0.5, -0.4), TURN):
            world.command(left, right)
            began_s = world.t_s
            for piece in range(1, pieces + 1):
                world.advance_to(began_s + 2.0 * piece / pieces)
            world.advance_to(began_s + 2.0)
        states.append(state(world))
    assert states[0] == states[1] == states[2]


@pytest.mark.parametrize("roughness_m", [0.0, 0.01])
def test_what_the_engine_is_spared_changes_no_bit(roughness_m: float, monkeypatch: pytest.MonkeyPatch) -> None:
    spared = mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
    forest = replace(trunk_across(14.5), trees_m=((24.4, 13.7), (25.0, 11.0), (40.0, 40.0)))
    touched: set[Obstacle | None] = set()
    states = []
    for spares in (True, False):
        if not spares:
            monkeypatch.setattr(ground, "BEYOND_BODY_M", 100.0)  # everything is near
        world = rover_on(0.4, forest=forest, roughness_m=roughness_m)
        assert bool(world.model.geom_contype[1:5].any()) is not spares
        if not spares:
            world.model.opt.disableflags &= ~spared
        world.after_step = lambda world: touched.add(world.touch and world.touch.obstacle)
        for left, right, for_s in ((0.5, 0.5, 4.0), (-0.6, -0.6, 6.0), (0.8, -0.8, 0.6), (0.5, 0.4, 2.0)):
            drive(world, left, right, for_s)
        states.append(state(world))
    assert states[0] == states[1]
    assert len(touched) == 3  # the trunk, the tree behind, and nothing


def test_watcher_looks_every_few_steps_and_sees_the_world() -> None:
    world, seen = rover_on(0.5), []

    def watch(moved: SimulatedWorld) -> None:
        assert moved is world
        seen.append(world.steps)

    world.after_step = watch
    for t_s in (0.05, 0.05, 0.3):
        world.advance_to(t_s)
    assert seen == list(range(OBSERVE_EVERY_STEPS, 76, OBSERVE_EVERY_STEPS))


def test_deadman_stops_the_wheels_in_time() -> None:
    world = rover_on(0.5)
    world.command(1.0, 1.0)
    world.deadman_at_s = 1.0
    world.advance_to(1.6)
    assert world.commanded == (0.0, 0.0)
    assert speed_m_s(world) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("tree_m", "duties", "side"),
    [
        ((25.0, 13.5), (0.5, 0.5), Side.FRONT),
        ((25.0, 11.5), (-0.5, -0.5), Side.REAR),
        ((25.25, 13.5), (0.5, 0.5), Side.RIGHT),
        ((24.75, 13.5), (0.5, 0.5), Side.LEFT),
    ],
)
def test_tree_is_felt_on_its_side(tree_m: tuple[float, float], duties: tuple[float, float], side: Side) -> None:
    world = rover_on(0.3, forest=tree_at(*tree_m))
    assert world.touch is None
    drive(world, *duties, 1.5)
    assert world.touch is not None
    assert world.touch.sides == (side,)
    assert world.touch.obstacle.axis_deg is None
    drive(world, -duties[0], -duties[1], 1.0)
    assert world.touch is None


def test_trunk_tells_along_which_bearing_it_lies() -> None:
    world = rover_on(0.3, forest=trunk_across(13.5))
    drive(world, 0.5, 0.5, 2.0)
    assert world.touch is not None
    assert world.touch.obstacle.axis_deg == pytest.approx(90.0)


def test_low_branch_tilts_the_body_and_no_bumper_feels_it() -> None:
    world, pitches_deg = rover_on(0.8, forest=trunk_across(13.2, 0.03)), []
    while world.y_m < 14.0:
        drive(world, 0.3, 0.3, 0.02)
        assert world.touch is None
        pitches_deg.append(world.pitch_deg)
    # Nose up by the branch's diameter over the wheelbase at most, then nose down; a tyre takes some of it.
    highest_deg = degrees(0.03 / (2.0 * BODY.wheels.half_base_m))
    assert 0.5 * highest_deg < max(pitches_deg) < 1.3 * highest_deg
    assert min(pitches_deg) < -0.5 * highest_deg


def test_dead_side_does_not_push() -> None:
    world = rover_on(0.1)
    world.set_faults(left_gain=0.0)
    drive(world, 0.8, 0.8, 2.0)
    assert degrees(world.heading_rad) < -10.0


def test_duty_within_the_dead_band_is_none() -> None:
    world = rover_on(0.5)
    world.set_faults(dead_band=0.3)
    drive(world, 0.29, 0.29, 1.0)
    assert world.path_m < 0.001


def test_snagged_body_spins_its_wheels_until_it_is_free() -> None:
    world = rover_on(0.3)
    world.set_faults(snagged=True)
    drive(world, 0.6, 0.6, 2.0)
    assert world.path_m < 0.05
    assert (world.x_m, world.y_m) == pytest.approx((25.0, 12.5), abs=0.05)
    assert world.slipping
    world.set_faults(snagged=False)
    drive(world, 0.6, 0.6, 2.0)
    assert world.path_m > 0.5


def test_shove_moves_a_body_whose_wheels_stand_still() -> None:
    world = rover_on(0.3)
    world.set_faults(shove_m_s=0.5)
    world.advance_to(3.0)
    assert world.forward_m > 0.3
    world.set_faults(shove_m_s=0.0)
    world.advance_to(5.0)
    assert speed_m_s(world) == pytest.approx(0.0, abs=0.01)


def test_body_on_its_belly_hangs_after_a_while() -> None:
    world = rover_on(0.8, forest=trunk_across(12.5, 0.06))  # put down on it
    world.advance_to(2.0)
    assert not world.high_centred
    world.advance_to(8.0)
    assert world.high_centred


def test_what_the_engine_warns_of_is_an_error_and_no_outcome_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    world = rover_on(0.5)
    world.data.qvel[0] = 1e11  # finite, and beyond what the engine takes: it would go on with wrong figures
    with pytest.raises(Unstable, match=r"up to 0\.020 s: .*Nan, Inf or huge value in QVEL at DOF 0\."):
        world.advance_to(1.0)
    assert not list(tmp_path.iterdir())


def test_place_that_is_no_number_is_an_error_even_without_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    world = rover_on(0.5)
    monkeypatch.setattr("mujoco.mj_step", lambda _model, data, _steps: data.qpos.fill(float("nan")))
    with pytest.raises(Unstable, match="the rover's place is not a number"):
        world.advance_to(1.0)


@pytest.mark.parametrize("kind", [kind for kind, each in KINDS.items() if issubclass(each, WorldFault)])
async def test_every_fault_of_the_world_begins_and_ends(kind: str) -> None:
    world = rover_on(0.3)
    faults_of = attrgetter("body_faults", "field_deg", "ground_pitch_deg", "ground_roll_deg", "battery_v")
    neutral = faults_of(world)
    drive(world, 0.5, 0.5, 1.0)
    params = {"slope": Slope(pitch_deg=10.0), "drive": Drive(left_gain=0.5)}.get(kind, KINDS[kind]())
    with params.effect(world, Random(0)):
        drive(world, 0.5, 0.5, 1.0)
        assert faults_of(world) != neutral or kind == "slip", "which the next test is about"
    drive(world, 0.5, 0.5, 3.0)
    assert faults_of(world) == neutral
    assert speed_m_s(world) > 0.4


def test_slip_fault_makes_driving_wheels_spin_until_they_are_out_of_it() -> None:
    standing = rover_on(0.8)
    with Slip().effect(standing, Random(0)):
        assert not standing.slipping, "wheels that stand still do not slip, mud or not"
    ways_m = {}
    for slips in (False, True):
        world = rover_on(0.8)
        fault = Slip().effect(world, Random(0))
        with fault if slips else nullcontext():
            drive(world, 1.0, 1.0, 0.3)
            assert world.slipping is slips
            ways_m[slips] = world.forward_m
        drive(world, 1.0, 1.0, 3.0)
        assert not world.slipping
        assert speed_m_s(world) > 1.2
    assert ways_m[True] == pytest.approx(0.5 * MUD_FRICTION * STANDARD_GRAVITY_M_S2 * 0.3**2, rel=0.1)
    assert ways_m[False] > 2.0 * ways_m[True]


def test_flow_sensor_is_at_the_middle_of_the_body() -> None:
    """Where the body turns on the spot, the ground goes round below it and does not pass."""
    world = rover_on(0.3)
    drive(world, *TURN, 2.0)
    assert degrees(world.heading_rad) % 360.0 > 90.0
    assert (world.forward_m, world.reverse_m, world.right_m) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)


def test_slope_pulls_the_body_down_and_is_felt() -> None:
    world = rover_on(0.5)
    with Slope(pitch_deg=15.0).effect(world, Random(0)):
        world.advance_to(2.0)
        assert world.reverse_m > 0.2, "nose up: it rolls backwards against its motors' brake"
        _, pitch, _ = HeadingSensorModel(world, RandomStreams(0)).sample(world.t_s)
        assert pitch / 10.0 == pytest.approx(15.0, abs=4.0)
    drive(world, 0.0, 0.0, 1.0)
    assert speed_m_s(world) == pytest.approx(0.0, abs=0.01)


def test_flow_sensor_sees_the_ground_pass_sideways() -> None:
    world = rover_on(0.3)
    flow = FlowSensorModel(world, RandomStreams(0))
    flow.sample(0.0)
    world.ground_roll_deg = 25.0  # right side down, steeper than the grip
    forward, right = flow.sample(2.0)
    assert world.right_m > 0.5
    assert right * FLOW_M_PER_COUNT == pytest.approx(world.right_m, abs=0.005)
    assert abs(forward * FLOW_M_PER_COUNT) < 0.05
