"""The world in MuJoCo behind the seam: what parts, referee and faults see of it, and do to it."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, exp, inf, sqrt

import pytest

from tests.simhal.mujoco.fields import BODY, CLEARING, EXACT, drive, rover_on, speed_m_s, tree_at, trunk_across
from wayfarer.hal import Side
from wayfarer.simhal.faults import KINDS, Drive, Fault, Layer, Slope
from wayfarer.simhal.injection.world_layer import world_fault
from wayfarer.simhal.mujoco.ground import BUMP_M, CELL_M, Mud, rough_ground
from wayfarer.simhal.mujoco.world import LOOK_EVERY, MujocoWorld, Unstable
from wayfarer.simhal.senses import FLOW_M_PER_COUNT, FlowSense, HeadingSense
from wayfarer.simhal.simulated_world import SimulatedWorld
from wayfarer.simhal.streams import Streams

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


def test_more_duty_on_the_left_turns_clockwise() -> None:
    world = rover_on(0.3)
    drive(world, *TURN, 0.5)
    assert degrees(world.heading_rad) > 10.0


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


def test_watcher_looks_every_few_steps_and_sees_the_world() -> None:
    world, seen = rover_on(0.5), []

    def watch(moved: SimulatedWorld) -> None:
        assert moved is world
        seen.append(world.steps)

    world.after_step = watch
    for t_s in (0.05, 0.05, 0.3):
        world.advance_to(t_s)
    assert seen == list(range(LOOK_EVERY, 76, LOOK_EVERY))


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
    world.harm(left_gain=0.0)
    drive(world, 0.8, 0.8, 2.0)
    assert degrees(world.heading_rad) < -10.0


def test_duty_within_the_dead_band_is_none() -> None:
    world = rover_on(0.5)
    world.harm(dead_band=0.3)
    drive(world, 0.29, 0.29, 1.0)
    assert world.path_m < 0.001


def test_snagged_body_spins_its_wheels_until_it_is_free() -> None:
    world = rover_on(0.3)
    world.harm(snagged=True)
    drive(world, 0.6, 0.6, 2.0)
    assert world.path_m < 0.05
    assert world.slipping
    world.harm(snagged=False)
    drive(world, 0.6, 0.6, 2.0)
    assert world.path_m > 0.5


def test_shove_moves_a_body_whose_wheels_stand_still() -> None:
    world = rover_on(0.3)
    world.harm(shove_m_s=0.5)
    world.advance_to(3.0)
    assert world.forward_m > 0.3
    world.harm(shove_m_s=0.0)
    world.advance_to(5.0)
    assert speed_m_s(world) == pytest.approx(0.0, abs=0.01)


def test_slip_fault_spills_mud_under_the_wheels() -> None:
    world = rover_on(0.8)
    world.slipping = True
    assert not world.slipping, "wheels that stand still do not slip, mud or not"
    drive(world, 1.0, 1.0, 0.25)
    assert world.slipping
    drive(world, 1.0, 1.0, 3.0)
    assert not world.slipping, "it has left the patch"


def test_pulling_back_stops_at_what_is_behind() -> None:
    free, blocked = rover_on(0.5), rover_on(0.5, forest=tree_at(25.0, 12.5 - 0.25 - 0.30))
    for world in (free, blocked):
        world.pull_back(0.15)
    assert free.y_m == pytest.approx(12.35, abs=0.002)
    assert blocked.y_m == pytest.approx(12.39, abs=0.01)  # its belly ends 0.186 m behind its middle


def test_body_on_its_belly_hangs_after_a_while() -> None:
    world = rover_on(0.8, forest=trunk_across(12.5, 0.06))  # put down on it
    world.advance_to(2.0)
    assert not world.hangs
    world.advance_to(8.0)
    assert world.hangs


def test_state_that_is_not_finite_is_an_error_and_no_outcome() -> None:
    world = rover_on(0.5)
    world.data.qvel[0] = float("nan")
    with pytest.raises(Unstable, match=r"not finite at 0\.020 s"):
        world.advance_to(1.0)


def test_rough_ground_has_its_standard_deviation_and_no_steps() -> None:
    field = rough_ground(0.02, Streams(1))
    heights_m = field.heights_m
    assert heights_m.std() == pytest.approx(0.02, rel=1e-6)
    # White noise under a Gaussian of half BUMP_M: how much less alike heights are a cell apart.
    alike = exp(-((CELL_M / BUMP_M) ** 2))
    assert (heights_m[1:] - heights_m[:-1]).std() == pytest.approx(0.02 * sqrt(2.0 * (1.0 - alike)), rel=0.03)
    assert field.top_m(25.0, 25.0, 0.3) >= heights_m[heights_m.shape[0] // 2, heights_m.shape[1] // 2]


def test_straight_ways_meet_mud_as_often_as_slips() -> None:
    """2,000 m of straight way per mean distance; the number of patches is Poisson's."""
    mean_m, width_m, ways = 5.0, BODY.width_m, 50
    met = 0
    for seed in range(ways):
        mud = Mud(replace(CLEARING, start_m=(1.0, 1.0)), replace(EXACT, slip_mean_m=mean_m), width_m, Streams(seed))
        half_m = width_m / 2.0
        inside = [
            any(mud.lies_at(25.0 + off_m, at / 10.0) for off_m in (-half_m, 0.0, half_m)) for at in range(50, 450)
        ]
        met += sum(now and not before for before, now in zip([False, *inside], inside, strict=False))
    # Patches that overlap are met once; at this density that is one in seven.
    assert 0.70 * ways * 40.0 / mean_m < met < 1.05 * ways * 40.0 / mean_m


def test_no_mud_where_the_rover_starts() -> None:
    mud = Mud(CLEARING, replace(EXACT, slip_mean_m=0.5), BODY.width_m, Streams(0))
    assert mud.anywhere
    assert not any(mud.lies_at(25.0 + east / 10.0, 12.5 + north / 10.0) for east in range(-5, 6) for north in range(6))


@pytest.mark.parametrize("kind", [kind for kind, row in KINDS.items() if row.layer is Layer.WORLD])
async def test_every_fault_of_the_world_begins_and_ends(kind: str) -> None:
    world = rover_on(0.3)
    neutral = (world.mishaps, world.field_deg, world.ground_pitch_deg, world.ground_roll_deg, world.battery_v)
    drive(world, 0.5, 0.5, 1.0)
    params = {"slope": Slope(pitch_deg=10.0), "drive": Drive(left_gain=0.5)}.get(kind, KINDS[kind].params())
    with world_fault(Fault(0.0, inf, "world", kind, params), world):
        drive(world, 0.5, 0.5, 1.0)
        lasting = (world.mishaps, world.field_deg, world.ground_pitch_deg, world.ground_roll_deg, world.battery_v)
        assert lasting != neutral or kind == "slip"
    drive(world, 0.5, 0.5, 3.0)
    assert neutral == (
        world.mishaps, world.field_deg, world.ground_pitch_deg, world.ground_roll_deg, world.battery_v
    )  # fmt: skip
    assert speed_m_s(world) > 0.4


def test_slope_pulls_the_body_down_and_is_felt() -> None:
    world = rover_on(0.5)
    with world_fault(Fault(0.0, inf, "world", "slope", Slope(pitch_deg=15.0)), world):
        world.advance_to(2.0)
        assert world.reverse_m > 0.2, "nose up: it rolls backwards against its motors' brake"
        _, pitch, _ = HeadingSense(world, Streams(0)).sample(world.t_s)
        assert pitch / 10.0 == pytest.approx(15.0, abs=4.0)
    drive(world, 0.0, 0.0, 1.0)
    assert speed_m_s(world) == pytest.approx(0.0, abs=0.01)


def test_flow_sensor_sees_the_ground_pass_sideways() -> None:
    world = rover_on(0.3)
    flow = FlowSense(world, Streams(0))
    flow.sample(0.0)
    world.ground_roll_deg = 25.0  # right side down, steeper than the grip
    forward, right = flow.sample(2.0)
    assert world.right_m > 0.5
    assert right * FLOW_M_PER_COUNT == pytest.approx(world.right_m, abs=0.005)
    assert abs(forward * FLOW_M_PER_COUNT) < 0.05
