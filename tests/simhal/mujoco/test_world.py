"""The world in MuJoCo behind the seam: what parts, outcome monitor and faults see of it, and do to it; its ground."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from itertools import pairwise
from math import degrees, exp, hypot, pi, sqrt
from operator import attrgetter
from pathlib import Path
from random import Random

import mujoco
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.simhal.clearing import STEADY
from tests.simhal.mujoco.fields import BODY, drive, rover_on, speed_m_s, tree_at, trunk_across
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.hal import Side
from wayfarer.simhal.faults.kinds import KINDS
from wayfarer.simhal.faults.world import Drive, Slip, Slope, WorldFault
from wayfarer.simhal.mujoco import ground
from wayfarer.simhal.mujoco.ground import BUMP_M, CELL_M, MUD_CELL_M, MUD_FRICTION, MUD_RADIUS_M, Mud, rough_ground
from wayfarer.simhal.mujoco.model import NoRoom, Unstable
from wayfarer.simhal.mujoco.world import OBSERVE_EVERY_STEPS, MujocoWorld
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk
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
    touched: set[float | None] = set()
    states = []
    for spares in (True, False):
        if not spares:
            monkeypatch.setattr(ground, "BEYOND_BODY_M", 100.0)  # everything is near
        world = rover_on(0.4, forest=forest, roughness_m=roughness_m)
        assert bool(world.model.geom_contype[1:5].any()) is not spares
        if not spares:
            world.model.opt.disableflags &= ~spared
        world.after_step = lambda world: touched.add(None if world.touch is None else world.touch.obstacle.y0_m)
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
        assert not standing.slipping, "wheels that are stopped do not slip, mud or not"
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
    """If the body turns on the spot, the ground goes round below it and does not pass."""
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


# -- the ground --------------------------------------------------------------------------------------------------------


def test_rough_ground_has_its_standard_deviation_and_no_steps() -> None:
    field = rough_ground(0.02, RandomStreams(1))
    heights_m = field.heights_m
    assert heights_m.std() == pytest.approx(0.02, rel=1e-6)
    # White noise under a Gaussian of half BUMP_M: how much less alike heights are a cell apart.
    alike = exp(-((CELL_M / BUMP_M) ** 2))
    assert (heights_m[1:] - heights_m[:-1]).std() == pytest.approx(0.02 * sqrt(2.0 * (1.0 - alike)), rel=0.03)
    assert field.top_m(25.0, 25.0, 0.3) >= heights_m[heights_m.shape[0] // 2, heights_m.shape[1] // 2]


@pytest.mark.parametrize("width_m", [0.0, BODY.width_m])
def test_straight_ways_meet_mud_as_often_as_slips(width_m: float) -> None:
    """Mud begins where a row across the way has some and the row before had none.

    A row is bare if no patch's middle lies within a radius of it; so are two rows one cell apart. Middles are a Poisson
    process, so the expected number follows from both areas. 360 m of way a seed, on columns further apart than patches
    are wide; with 40 seeds the standard deviation is 2 %.
    """
    mean_m, seeds, ways_m, rows = 5.0, 40, range(5, 50, 5), range(50, 450)
    forest, physics = replace(CLEARING, start_m=(1.0, 1.0)), replace(STEADY, slip_mean_m=mean_m)
    half = round(width_m / 2.0 / MUD_CELL_M)
    begins = 0
    for seed in range(seeds):
        mud = Mud(forest, physics, width_m, RandomStreams(seed))
        for way_m in ways_m:
            columns = [way_m + (off + 0.5) * MUD_CELL_M for off in range(-half, half + 1)]
            muddy = [any(mud.is_muddy(x_m, (row + 0.5) * MUD_CELL_M) for x_m in columns) for row in rows]
            begins += sum(now and not before for before, now in pairwise(muddy))
    per_m2 = 1.0 / ((2.0 * MUD_RADIUS_M + width_m) * mean_m)
    bare = exp(-per_m2 * (pi * MUD_RADIUS_M**2 + 2.0 * MUD_RADIUS_M * 2.0 * half * MUD_CELL_M))
    expected = seeds * len(ways_m) * (len(rows) - 1) * bare * (1.0 - exp(-MUD_CELL_M / mean_m))
    assert begins == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize("slip_mean_m", [0.1, 1e-300])
def test_ground_holds_no_more_mud_than_it_has_room_for(slip_mean_m: float) -> None:
    """Without a bound the second would lay patches out for ever."""
    mud = Mud(CLEARING, replace(STEADY, slip_mean_m=slip_mean_m), BODY.width_m, RandomStreams(0))
    places = [(x / 2.0, y / 2.0) for x in range(2, 98) for y in range(40, 98)]
    assert sum(mud.is_muddy(*place) for place in places) / len(places) == pytest.approx(0.99, abs=0.005)


def test_no_mud_where_the_rover_starts() -> None:
    mud = Mud(CLEARING, replace(STEADY, slip_mean_m=0.5), BODY.width_m, RandomStreams(0))
    assert mud.anywhere
    assert not any(mud.is_muddy(25.0 + east / 10.0, 12.5 + north / 10.0) for east in range(-5, 6) for north in range(6))


# -- putting the body down ---------------------------------------------------------------------------------------------

HUNG_ON = {
    "a trunk below its middle": trunk_across(12.5, 0.06),
    "a trunk below its rear": trunk_across(12.4, 0.06),
    "a trunk along its axis": replace(CLEARING, trunks=(Trunk(25.0, 11.5, 25.0, 13.5, "left"),), trunk_diameter_m=0.06),
    "two trees": replace(CLEARING, trees_m=((25.0, 12.75), (25.0, 12.25))),
}


@pytest.mark.parametrize("forest", HUNG_ON.values(), ids=HUNG_ON)
@pytest.mark.parametrize("snagged", [False, True])
def test_pulling_back_frees_a_body_from_what_it_lies_on(forest: Forest, snagged: bool) -> None:
    world = rover_on(0.8, forest=forest)  # put down on it
    world.set_faults(snagged=snagged)
    world.advance_to(1.0)
    world.pull_back(0.15)
    put_down_m = world.x_m, world.y_m
    assert hypot(put_down_m[0] - 25.0, put_down_m[1] - 12.5) < 2.0 * BODY.length_m
    world.advance_to(2.0)
    assert not world.high_centred
    assert world.touch is None
    assert (world.pitch_deg, world.roll_deg) == pytest.approx((0.0, 0.0), abs=0.1)
    assert (world.x_m, world.y_m) == pytest.approx(put_down_m, abs=0.002)
    drive(world, -0.5, -0.5, 2.0)
    if snagged:
        assert (world.x_m, world.y_m) == pytest.approx(put_down_m, abs=0.05), "it is held again, and there"
    else:
        assert world.reverse_m > 0.1


def test_pulling_back_goes_behind_what_the_front_has_climbed() -> None:
    world = rover_on(0.8, forest=trunk_across(12.52, 0.06))
    world.pull_back(0.15)
    assert world.y_m == pytest.approx(12.52 - BODY.length_m / 2.0 - 0.15, abs=0.06)
    assert degrees(world.heading_rad) == pytest.approx(0.0, abs=0.1)


def test_pulling_back_stops_at_what_is_behind() -> None:
    free, blocked = rover_on(0.5), rover_on(0.5, forest=tree_at(25.0, 12.5 - 0.25 - 0.30))
    for world in (free, blocked):
        world.pull_back(0.15)
    assert free.y_m == pytest.approx(12.35, abs=0.002)
    assert blocked.y_m == pytest.approx(12.39, abs=0.01)  # its belly ends 0.186 m behind its middle


def test_there_is_no_room_where_trees_stand_closer_than_the_body_is_wide() -> None:
    trees_m = tuple((23.0 + 0.25 * east, 10.5 + 0.25 * north) for east in range(17) for north in range(17))
    world = rover_on(0.8, forest=replace(CLEARING, trees_m=trees_m))
    with pytest.raises(NoRoom, match=r"no free ground near x = 2\d\.\d\d m"):
        world.pull_back(0.15)


@given(
    st.lists(st.tuples(st.floats(23.5, 26.5), st.floats(11.0, 14.0)), max_size=8),
    st.floats(0.0, 360.0),
    st.sampled_from([0.0, 0.02]),
)
@example([(25.0, 12.0), (25.0, 12.884066157958692)], 0.0, 0.02)  # at rest free of the tree, and rocked against it
@settings(max_examples=15, deadline=None)
def test_body_is_never_put_down_in_contact(
    trees_m: list[tuple[float, float]], heading_deg: float, roughness_m: float
) -> None:
    forest = replace(CLEARING, trees_m=tuple(trees_m), heading_deg=heading_deg)
    world = rover_on(0.5, forest=forest, roughness_m=roughness_m)
    world.pull_back(0.15)
    world.advance_to(world.t_s + 0.02)
    assert world.touch is None
