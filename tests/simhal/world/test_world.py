"""The world: nothing is driven through, and what happens does not depend on who looks."""

from __future__ import annotations

from dataclasses import replace
from itertools import compress, pairwise
from math import cos, degrees, hypot, radians, sin
from statistics import fmean

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.simhal.clearing import STEADY, VEHICLE
from tests.simhal.world.test_collision import body_points, gap_m
from wayfarer.escape.settings import Vehicle
from wayfarer.experiments.outcome import OutcomeMonitor
from wayfarer.hal import Side
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FlowSensorModel, HeadingSensorModel
from wayfarer.simhal.world.collision import obstacles_of
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

NOISY = Physics()
EXACT = replace(STEADY, motor_lag_s=1e-9)

Command = tuple[float, float]

duties = st.floats(-1, 1)
commands = st.tuples(duties, duties)


def forest_of(
    *, trunks: tuple[tuple[float, float, float, float], ...] = (), trees: tuple[tuple[float, float], ...] = (),
    start_m: tuple[float, float] = (25.0, 12.5), heading_deg: float = 0.0,
) -> Forest:  # fmt: skip
    lying = tuple(Trunk(*trunk, "across") for trunk in trunks)
    return replace(CLEARING, start_m=start_m, heading_deg=heading_deg, trunks=lying, trees_m=trees)


def exact_world(forest: Forest, *, vehicle: Vehicle = VEHICLE) -> World:
    """Return a world without noise, slips or motor lag."""
    return World(forest, vehicle, EXACT, RandomStreams(0))


def drive(world: World, left: float, right: float, seconds_s: float) -> None:
    world.command(left, right)
    world.advance_to(world.t_s + seconds_s)


def pose(world: World) -> tuple[float, float, float]:
    return world.x_m, world.y_m, world.heading_rad


# -- obstacles -------------------------------------------------------------------------------------------------------

away_m = st.floats(-6, 6)


@st.composite
def forests(draw: st.DrawFn) -> Forest:
    """Draw a thicket around a start that has room to turn on the spot, at any place of the world and beyond it."""
    x_m, y_m = draw(st.sampled_from([(25.0, 12.5), (0.1, 0.1), (-4.0, 55.0)]))
    trunks = draw(st.lists(st.tuples(away_m, away_m, st.floats(0, 3.15), st.floats(0.01, 9)), max_size=8))
    trees = draw(st.lists(st.tuples(away_m, away_m), max_size=12))
    return forest_of(
        trunks=tuple(
            (x_m + east_m, y_m + north_m, x_m + east_m + long_m * sin(axis), y_m + north_m + long_m * cos(axis))
            for east_m, north_m, axis, long_m in trunks
        ),
        trees=tuple((x_m + east_m, y_m + north_m) for east_m, north_m in trees),
        start_m=(x_m, y_m),
        heading_deg=draw(st.floats(0, 360, exclude_max=True)),
    )


def with_room_to_start(forest: Forest, reach_m: float) -> Forest:
    """Clear away what a rover turning on the spot would hit at once."""
    gaps_m = list(forest.gaps_m(*forest.start_m))
    trunks = tuple(compress(forest.trunks, (gap_m > reach_m for gap_m in gaps_m)))
    trees = tuple(compress(forest.trees_m, (gap_m > reach_m for gap_m in gaps_m[len(forest.trunks) :])))
    return replace(forest, trunks=trunks, trees_m=trees)


def deepest_overlap_m(world: World, forest: Forest, vehicle: Vehicle) -> float:
    """Return how deep the deepest sampled point of the body is inside an obstacle, negative if none is."""
    points = body_points(vehicle.length_m, vehicle.width_m, *pose(world))
    return max((-gap_m(points, obstacle) for obstacle in obstacles_of(forest)), default=-np.inf)


@settings(max_examples=100, deadline=None)
@given(
    forest=forests(),
    vehicle=st.builds(Vehicle, st.floats(0.2, 1.2), st.floats(0.2, 1.2), st.floats(0.2, 1.2), st.floats(0.1, 5)),
    course=st.lists(st.tuples(commands, st.integers(1, 12)), min_size=1, max_size=8),
    seed=st.integers(0, 1000),
)
def test_body_never_overlaps_an_obstacle(
    forest: Forest, vehicle: Vehicle, course: list[tuple[Command, int]], seed: int
) -> None:
    forest = with_room_to_start(forest, hypot(vehicle.length_m, vehicle.width_m) / 2)
    world = World(forest, vehicle, Physics(), RandomStreams(seed))
    overlaps_m: list[float] = []
    world.after_step = lambda _: overlaps_m.append(deepest_overlap_m(world, forest, vehicle))
    for (left, right), steps in course:
        drive(world, left, right, steps * 0.05)
    assert max(overlaps_m) <= 1e-9


@pytest.mark.parametrize("max_speed_m_s", [0.1, 1.4, 5.0])
@pytest.mark.parametrize("heading_deg", [0.0, 45.0, 70.0])
def test_no_speed_carries_the_rover_through_a_trunk(max_speed_m_s: float, heading_deg: float) -> None:
    """The trunk and the body are thinner than a step at the highest speed is long."""
    wall_m = 15.5
    forest = replace(forest_of(trunks=((0.0, wall_m, 50.0, wall_m),), heading_deg=heading_deg), trunk_diameter_m=0.04)
    world = exact_world(forest, vehicle=Vehicle(0.2, 0.2, 0.5, max_speed_m_s))
    drive(world, 1.0, 1.0, 15.0 / max_speed_m_s)
    corner_m = 0.1 * (cos(radians(heading_deg)) + sin(radians(heading_deg)))
    assert world.y_m == pytest.approx(wall_m - 0.02 - corner_m, abs=0.01)
    assert world.touch is not None


def test_attitude_is_that_of_the_body_and_the_ground_together() -> None:
    world = exact_world(CLEARING)
    world.heading_rad, world.pitch_deg, world.roll_deg = 0.5, 1.0, 2.0
    world.ground_pitch_deg, world.ground_roll_deg = 10.0, 20.0
    assert world.attitude() == (0.5, 11.0, 22.0)


def test_a_long_rover_meets_what_is_far_from_its_centre() -> None:
    world = exact_world(forest_of(trees=((25.0, 20.0),)), vehicle=Vehicle(5.0, 0.4, 0.5, 1.0))
    drive(world, 1.0, 1.0, 6.0)
    assert world.y_m == pytest.approx(20.0 - 0.25 - 2.5, abs=0.02)


def test_motion_stops_at_contact_and_odometers_with_it() -> None:
    world = exact_world(forest_of(trees=((25.0, 14.0),)))
    drive(world, 1.0, 1.0, 5.0)
    stopped_at, forward_m = pose(world), world.forward_m
    assert forward_m == pytest.approx(14.0 - 0.25 - 0.2 - 12.5, abs=0.01)
    drive(world, 1.0, 1.0, 5.0)
    assert (pose(world), world.forward_m) == (stopped_at, forward_m)
    assert (world.pitch_deg, world.roll_deg) == (0.0, 0.0), "a tree is no trunk to rear up on"


@given(heading_deg=st.floats(0, 360), distance_m=st.floats(0.5, 3), speed=st.floats(0.1, 1))
def test_way_back_is_free(heading_deg: float, distance_m: float, speed: float) -> None:
    ahead = radians(heading_deg)
    middle_x, middle_y = 25.0 + distance_m * sin(ahead), 12.5 + distance_m * cos(ahead)
    across_x, across_y = 9.0 * cos(ahead), -9.0 * sin(ahead)
    trunk = (middle_x - across_x, middle_y - across_y, middle_x + across_x, middle_y + across_y)
    world = exact_world(forest_of(trunks=(trunk,), heading_deg=heading_deg))
    drive(world, speed, speed, 1.5 * distance_m / (1.4 * speed))
    assert world.touch is not None
    came_m = world.forward_m
    drive(world, -speed, -speed, 0.05)
    assert world.touch is None
    drive(world, -speed, -speed, came_m / (1.4 * speed) - 0.05 + 1e-6)
    assert world.reverse_m == pytest.approx(came_m, abs=1.4 * speed * 0.05 + 1e-6)
    assert (world.x_m, world.y_m) == pytest.approx((25.0, 12.5), abs=1.4 * speed * 0.05 + 1e-6)


@pytest.mark.parametrize(
    ("tree_off_m", "command", "side"),
    [
        ((0.0, 1.5), (1.0, 1.0), Side.FRONT),
        ((0.3, 1.5), (1.0, 1.0), Side.RIGHT),
        ((-0.3, 1.5), (1.0, 1.0), Side.LEFT),
        ((0.0, -1.5), (-1.0, -1.0), Side.REAR),
    ],
)
@pytest.mark.parametrize("turned_deg", [0.0, 130.0])
def test_touch_names_the_side_of_the_body(
    tree_off_m: tuple[float, float], command: Command, side: Side, turned_deg: float
) -> None:
    turned, (east_m, north_m) = radians(turned_deg), tree_off_m
    tree_m = (
        25.0 + east_m * cos(turned) + north_m * sin(turned),
        12.5 - east_m * sin(turned) + north_m * cos(turned),
    )
    world = exact_world(forest_of(trees=(tree_m,), heading_deg=turned_deg))
    drive(world, *command, 3.0)
    assert world.touch is not None
    assert world.touch.sides == (side,)


# -- tilt ------------------------------------------------------------------------------------------------------------


def test_pushing_onto_a_trunk_rears_the_rover_up_until_it_tips() -> None:
    forest = forest_of(trunks=((20.0, 14.0, 30.0, 14.0),))
    world = exact_world(forest)
    outcome_monitor = OutcomeMonitor(forest, 1000.0, EXACT.tip_deg, lambda *_: None)
    world.after_step = outcome_monitor.watch
    pitches_deg = []
    world.command(1.0, 1.0)
    while outcome_monitor.outcome is None:
        world.advance_to(world.t_s + 0.05)
        pitches_deg.append(world.pitch_deg)
    assert outcome_monitor.outcome == "tipped"
    climb_deg_s = EXACT.climb_deg_s
    assert pitches_deg[-1] == pytest.approx(EXACT.tip_deg, abs=climb_deg_s * 0.05)
    assert all(early_deg <= late_deg for early_deg, late_deg in pairwise(pitches_deg))


def test_nose_goes_down_when_backing_onto_a_trunk_and_settles_when_free() -> None:
    world = exact_world(forest_of(trunks=((20.0, 11.0, 30.0, 11.0),)))
    drive(world, -0.5, -0.5, 2.5)
    assert world.pitch_deg < -5.0
    drive(world, 0.2, 0.2, 3.0)
    assert world.pitch_deg == 0.0


# -- slip ------------------------------------------------------------------------------------------------------------


def test_slip_holds_the_rover_until_it_backs_off() -> None:
    world = World(forest_of(), VEHICLE, Physics(slip_mean_m=0.5), RandomStreams(3))
    world.command(0.5, 0.5)
    while not world.slipping:
        world.advance_to(world.t_s + 0.05)
    held_at = pose(world)
    for command in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (0.0, 0.0), (0.2, -0.1)):
        drive(world, *command, 1.0)
        assert (world.slipping, pose(world)) == (True, held_at)
    drive(world, -0.5, -0.5, 0.5)
    assert not world.slipping
    assert world.reverse_m > 0.1


@pytest.mark.parametrize("slip_mean_m", [0.5, 2.0])
def test_slips_come_half_a_metre_plus_an_exponential_distance_apart(slip_mean_m: float) -> None:
    from scipy.stats import kstest  # not at the top: see test_statistics.py

    world = World(forest_of(), VEHICLE, Physics(slip_mean_m=slip_mean_m, slip_free_m=0.5), RandomStreams(5))
    freed_at_m, gaps_m = 0.0, list[float]()
    while len(gaps_m) < 400:
        drive(world, 0.2, 0.2, 0.05)
        if world.slipping:
            gaps_m.append(world.forward_m - freed_at_m)
            drive(world, -0.2, -0.2, 0.2)
            freed_at_m = world.forward_m
    assert min(gaps_m) >= 0.5
    assert fmean(gaps_m) == pytest.approx(0.5 + slip_mean_m, rel=0.15)
    assert kstest([gap_m - 0.5 for gap_m in gaps_m], "expon", args=(0, slip_mean_m)).pvalue > 0.01


# -- kinematics ------------------------------------------------------------------------------------------------------


@given(duty=st.floats(0.01, 1))
def test_equal_and_opposite_wheels_turn_on_the_spot_clockwise_for_left(duty: float) -> None:
    world = exact_world(forest_of())
    drive(world, duty, -duty, 1.0)
    assert (world.x_m, world.y_m, world.path_m) == (25.0, 12.5, 0.0)
    assert world.heading_rad == pytest.approx(2 * duty * VEHICLE.max_speed_m_s / VEHICLE.track_m)


@given(left=st.floats(0.1, 1), right=st.floats(0.1, 1))
def test_unequal_wheels_drive_an_arc_of_the_radius_that_the_track_gives(left: float, right: float) -> None:
    world = exact_world(forest_of())
    drive(world, left, right, 1.0)
    speed_m_s, lead_m_s = 1.4 * (left + right) / 2, 1.4 * (left - right)
    turned_rad = lead_m_s / VEHICLE.track_m
    chord_m = speed_m_s * abs(np.sinc(turned_rad / 2 / np.pi))
    assert world.heading_rad == pytest.approx(turned_rad)
    assert world.forward_m == pytest.approx(speed_m_s)
    assert hypot(world.x_m - 25.0, world.y_m - 12.5) == pytest.approx(chord_m, rel=0.01)
    assert (world.x_m > 25.0) == (left > right) or left == pytest.approx(right)


@given(heading_deg=st.floats(0, 360, exclude_max=True), duty=st.floats(0.1, 1))
def test_heading_is_clockwise_from_north(heading_deg: float, duty: float) -> None:
    world = exact_world(forest_of(heading_deg=heading_deg))
    drive(world, duty, duty, 1.0)
    east_m, north_m = 1.4 * duty * sin(radians(heading_deg)), 1.4 * duty * cos(radians(heading_deg))
    assert (world.x_m - 25.0, world.y_m - 12.5) == pytest.approx((east_m, north_m), abs=1e-9)


def test_motors_take_their_lag_to_reach_speed() -> None:
    world = World(forest_of(), VEHICLE, replace(EXACT, motor_lag_s=0.5), RandomStreams(0))
    speeds_m_s = []
    for _ in range(60):
        before_m = world.forward_m
        drive(world, 1.0, 1.0, 0.05)
        speeds_m_s.append((world.forward_m - before_m) / 0.05)
    assert speeds_m_s == sorted(speeds_m_s)
    assert speeds_m_s[9] == pytest.approx(1.4 * (1 - np.exp(-1.0)))
    assert speeds_m_s[-1] == pytest.approx(1.4, rel=0.01)


def test_odometers_count_each_direction_up() -> None:
    world = exact_world(forest_of())
    drive(world, 1.0, 1.0, 2.0)
    drive(world, -0.5, -0.5, 1.0)
    drive(world, 1.0, -1.0, 1.0)
    drive(world, 1.0, 1.0, 1.0)
    assert (world.forward_m, world.reverse_m, world.path_m) == pytest.approx((4.2, 0.7, 4.9))


def test_rovers_differ_from_trial_to_trial_as_the_physics_say() -> None:
    turns_rad, drifts_rad = [], []
    for seed in range(200):
        physics = replace(EXACT, side_gain_sd=NOISY.side_gain_sd, track_sd=NOISY.track_sd)
        world = World(forest_of(), VEHICLE, physics, RandomStreams(seed))
        drive(world, 1.0, 1.0, 1.0)
        drifts_rad.append(world.heading_rad)
        drive(world, 1.0, -1.0, 1.0)
        turns_rad.append(world.heading_rad - drifts_rad[-1])
    spread_rad = 1.4 / 0.5 * NOISY.side_gain_sd * 2**0.5
    assert np.std(drifts_rad) == pytest.approx(spread_rad, rel=0.15)
    assert np.std(np.log(turns_rad)) == pytest.approx(hypot(NOISY.track_sd, NOISY.side_gain_sd / 2**0.5), rel=0.15)


def test_heading_wanders_with_the_root_of_the_distance() -> None:
    def spread_deg(seconds_s: float) -> float:
        physics = replace(EXACT, heading_noise_deg=NOISY.heading_noise_deg)
        headings_rad = []
        for seed in range(200):
            world = World(forest_of(), VEHICLE, physics, RandomStreams(seed))
            drive(world, 1.0, 1.0, seconds_s)
            headings_rad.append(world.heading_rad)
        return degrees(float(np.std(headings_rad)))

    per_root_m = NOISY.heading_noise_deg / NOISY.noise_per_m**0.5
    assert spread_deg(1.0) == pytest.approx(per_root_m * 1.4**0.5, rel=0.15)
    assert spread_deg(4.0) == pytest.approx(per_root_m * 5.6**0.5, rel=0.15)


# -- time ------------------------------------------------------------------------------------------------------------

moments_s = st.lists(st.floats(0, 8), max_size=30)


@settings(max_examples=50, deadline=None)
@given(course=st.lists(commands, min_size=1, max_size=8), looks_s=moments_s, seed=st.integers(0, 100))
def test_state_depends_on_commands_alone_and_not_on_who_looks(
    course: list[Command], looks_s: list[float], seed: int
) -> None:
    def end_of(looks_s: list[float]) -> tuple[object, ...]:
        forest = forest_of(trunks=((20.0, 14.0, 30.0, 14.5),), trees=((26.0, 13.0), (24.0, 11.5)))
        world = World(forest, VEHICLE, Physics(slip_mean_m=1.0), RandomStreams(seed))
        for second_s, command in enumerate(course):
            world.advance_to(second_s)
            world.command(*command)
            for look_s in looks_s:
                if second_s <= look_s < second_s + 1:
                    world.advance_to(look_s)
        world.advance_to(len(course))
        touched = world.touch and (world.touch.obstacle.x0_m, world.touch.sides)
        return *pose(world), world.forward_m, world.reverse_m, world.pitch_deg, world.slipping, touched

    assert end_of(looks_s) == end_of([])


@given(t_s=st.floats(0, 100), earlier_s=st.floats(0, 100))
def test_world_takes_whole_steps_and_never_goes_back(t_s: float, earlier_s: float) -> None:
    world = exact_world(forest_of())
    world.command(0.1, 0.1)
    world.advance_to(t_s)
    assert t_s - 0.05 - 1e-9 <= world.t_s <= t_s + 2e-9
    steps = world.steps
    world.advance_to(min(t_s, earlier_s))
    assert world.steps == steps


def test_rounded_times_on_the_grid_take_each_step_once() -> None:
    world, t_s = exact_world(forest_of()), 0.0
    for step in range(1, 20_000):
        t_s += 0.05
        world.advance_to(t_s)
        assert world.steps == step


def test_watcher_sees_every_step_once_and_in_order() -> None:
    world = exact_world(forest_of())
    seen: list[int] = []
    world.after_step = lambda _: seen.append(world.steps)
    for t_s in (0.2, 0.2, 1.0):
        world.advance_to(t_s)
    assert seen == list(range(1, 21))


def test_world_goes_on_beyond_its_edges() -> None:
    world = exact_world(forest_of(start_m=(1.0, 25.0), heading_deg=270.0))
    drive(world, 1.0, 1.0, 60.0)
    assert world.x_m == pytest.approx(1.0 - 84.0)


def test_light_world_and_its_senses_are_what_they_were() -> None:
    """Version 0.1's figures: published tables and recorded campaigns rest on them.

    Machines differ in the last bit of a sine; the sensors' quanta are the same on all of them.
    """
    forest = forest_of(trunks=((22.0, 15.0, 28.0, 16.0),), trees=((26.0, 13.5),))
    streams = RandomStreams(7)
    world = World(forest, VEHICLE, Physics(slip_mean_m=1.0), streams)
    flow, heading = FlowSensorModel(world, streams), HeadingSensorModel(world, streams)
    samples = []
    course = [(0.7, 0.7), (-0.4, -0.4), (0.4, -0.4), (0.6, 0.3), (-0.3, 0.5), (0.7, 0.7)] * 5
    for second, (left, right) in enumerate(course, 1):
        world.command(left, right)
        samples.append((*heading.sample(float(second)), *flow.sample(float(second))))
    pose = (24.398693147586364, 11.10263490539099, 7.747271962966911)
    assert (world.x_m, world.y_m, world.heading_rad) == pytest.approx(pose, rel=1e-12)
    assert (world.forward_m, world.reverse_m) == pytest.approx((8.188051821033264, 2.7554805701234946), rel=1e-12)
    assert [sum(column) for column in zip(*samples, strict=True)] == [43792, -1, 3, 25714, -4]
