"""The fail-safe between another stack's planner and its base: who drives, and when nobody may."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from random import Random

import pytest
from wayfarer_failsafe.guard import Guard, GuardSettings, Output, State
from wayfarer_failsafe.messages import STANDSTILL

from tests.ros2.stack import PERIOD_S, SETTINGS, drive, imu, odometry, twist


class Ride:
    """A guard with a body in free ground, or one that something holds; every message comes before every tick."""

    def __init__(self, settings: GuardSettings = SETTINGS) -> None:
        self.guard, self._rng = Guard(settings), Random(2)
        self.t_s = self.speed_m_s = self.heading_deg = 0.0
        self.held, self.silent, self.roll_deg = False, "", 0.0
        self.output = Output(STANDSTILL, State.IDLE, "", {})

    def tick(self, ahead_m_s: float = 0.5, turn_rad_s: float = 0.0, noise_m_s: float = 0.0) -> Output:
        self.t_s += PERIOD_S
        ahead, turn = self.output.speeds
        self.speed_m_s += 0.15 * ((0.0 if self.held else ahead) - self.speed_m_s)  # a lag of 0.3 s
        self.heading_deg -= 57.3 * (0.0 if self.held else turn) * PERIOD_S
        if self.silent != "imu":
            noise = self._rng.gauss
            self.guard.take_imu(imu(self.heading_deg + noise(0, 0.3), noise(0, 0.3), self.roll_deg), self.t_s)
        if self.silent != "odom":
            speed_m_s = nan if self.silent == "odom is nan" else self.speed_m_s + noise_m_s
            self.guard.take_odometry(odometry(speed_m_s), self.t_s)
        if self.silent != "cmd":
            self.guard.take_command(twist(ahead_m_s, turn_rad_s), self.t_s)
        self.output = self.guard.tick(self.t_s)
        return self.output

    def for_s(self, seconds: float, ahead_m_s: float = 0.5, turn_rad_s: float = 0.0) -> Output:
        for _ in range(round(seconds / PERIOD_S)):
            self.tick(ahead_m_s, turn_rad_s)
        return self.output


def test_gets_out_of_a_forest_where_the_planner_alone_stays() -> None:
    guard = Guard(SETTINGS)
    out, time_s, said = drive(0, guard, 120.0)
    assert out
    assert guard.takeovers > 1
    assert said[-1].values["takeovers"] == str(guard.takeovers)
    assert not drive(0, None, time_s)[0]


def test_no_alarm_on_free_ground_with_noisy_odometry() -> None:
    """Two minutes of speeds, stops, turns on the spot and reversals, each for up to 4 s; noise of 0.1 m/s."""
    rng, ride, ends_s, asked = Random(1), Ride(), 0.0, (0.0, 0.0)
    states = set()
    while ride.t_s < 120.0:
        if ride.t_s >= ends_s:
            ends_s = ride.t_s + rng.uniform(0.2, 4.0)
            asked = rng.choice([0.0, 0.05, 0.3, 0.6, 1.0, -0.4]), rng.choice([0.0, 0.0, 0.5, -1.5])
        states.add(ride.tick(*asked, noise_m_s=rng.gauss(0.0, 0.1)).state)
        assert ride.output.speeds == asked
    assert states == {State.PLANNER}


def test_planner_passes_unchanged_until_the_body_is_held_and_has_the_wheels_again_when_it_is_free() -> None:
    ride = Ride()
    assert ride.for_s(2.0, 0.5, 0.1).speeds == (0.5, 0.1)
    ride.held = True
    ride.for_s(1.0)
    assert (ride.output.state, ride.guard.takeovers) == (State.RESCUE, 1)
    assert ride.output.text == "the escape handler drives: turn_away"
    ride.held = False
    assert ride.for_s(20.0).state is State.PLANNER


def test_way_out_is_where_the_planner_last_drove_straight_on_unless_it_is_given() -> None:
    for given, goal in ((nan, 90.0), (45.0, 45.0)):
        ride = Ride(replace(SETTINGS, goal_heading_deg=given))
        ride.heading_deg = 90.0
        ride.for_s(2.0)
        ride.for_s(1.0, 0.5, 1.0)  # a turn of 57 degrees to the left
        ride.held = True
        output = ride.for_s(1.0, 0.5, 1.0)
        assert output.state is State.RESCUE
        assert float(output.values["goal_heading_deg"]) == pytest.approx(goal, abs=2.0)


def test_planner_that_stands_on_purpose_is_not_stuck() -> None:
    ride = Ride()
    ride.held = True
    assert ride.for_s(30.0, 0.0).state is State.PLANNER


@pytest.mark.parametrize(
    ("silent", "state", "within_s", "text"),
    [
        ("imu", State.STOPPED, 0.35, "stopped: the IMU is silent"),
        ("odom", State.STOPPED, 0.5, "stopped: the odometry is silent"),
        ("odom is nan", State.STOPPED, 0.5, "stopped: the odometry is silent"),
        ("cmd", State.IDLE, 0.6, "stopped: no command from the planner"),
    ],
)
@pytest.mark.parametrize("rescuing", [False, True])
def test_silence_stops_the_wheels_whoever_drives(
    silent: str, state: State, within_s: float, text: str, rescuing: bool
) -> None:
    ride = Ride()
    ride.for_s(2.0)
    ride.held = rescuing
    before = ride.for_s(1.0)
    assert before.state is (State.RESCUE if rescuing else State.PLANNER)
    ride.silent = silent
    output = ride.for_s(within_s)
    assert (output.speeds, output.state, output.text) == (STANDSTILL, state, text)
    for _ in range(100):
        assert ride.tick().speeds == STANDSTILL
    ride.silent = ""
    assert ride.for_s(1.0).state in {State.PLANNER, State.RESCUE}


def test_nothing_moves_before_every_sense_has_spoken_and_the_planner_has_asked() -> None:
    for silent in ("imu", "odom", "cmd"):
        ride = Ride()
        ride.silent = silent
        for _ in range(20):
            assert ride.tick().speeds == STANDSTILL
    assert Guard(SETTINGS).tick(0.0).speeds == STANDSTILL


def test_command_that_is_no_number_is_a_stop() -> None:
    ride = Ride()
    ride.for_s(1.0)
    assert ride.tick(nan).speeds == STANDSTILL


def test_slope_on_which_it_is_started_is_no_trunk() -> None:
    ride = Ride()
    ride.roll_deg = 22.0
    assert ride.for_s(3.0).state is State.PLANNER
    ride.roll_deg = 0.0
    assert ride.for_s(3.0).state is State.RESCUE, "it lies on something, counted from the ground"


def test_body_on_its_side_stops() -> None:
    ride = Ride()
    ride.for_s(1.0)
    ride.roll_deg = 90.0
    output = ride.for_s(0.5)
    assert (output.speeds, output.state) == (STANDSTILL, State.STOPPED)


def test_disabled_it_never_takes_over() -> None:
    ride = Ride()
    ride.guard.enable(False)
    ride.held = True
    output = ride.for_s(10.0)
    assert (output.speeds, output.state, ride.guard.takeovers) == ((0.5, 0.0), State.DISABLED, 0)
    ride.silent = "cmd"
    assert ride.for_s(1.0).speeds == STANDSTILL


def test_rescue_that_was_disabled_is_not_resumed() -> None:
    ride = Ride()
    ride.for_s(1.0)
    ride.held = True
    assert ride.for_s(2.0).state is State.RESCUE
    ride.guard.enable(False)
    ride.held = False
    assert ride.for_s(5.0).state is State.DISABLED
    ride.guard.enable(True)
    assert ride.tick().state is State.PLANNER


def test_body_that_stays_held_needs_a_person_and_is_tried_again_when_that_person_says_so() -> None:
    ride = Ride(replace(SETTINGS, give_up_s=20.0))
    ride.for_s(1.0)
    ride.held = True
    output = ride.for_s(40.0)
    assert (output.speeds, output.state) == (STANDSTILL, State.GAVE_UP)
    ride.held = False
    assert ride.for_s(10.0).state is State.GAVE_UP
    ride.guard.enable(False)
    ride.guard.enable(True)
    assert ride.for_s(10.0).state is State.PLANNER


def test_only_where_it_is_allowed_does_it_drive_without_the_planner() -> None:
    ride = Ride(replace(SETTINGS, alone=True))
    ride.silent = "cmd"
    assert ride.for_s(2.0).speeds == STANDSTILL, "nobody has asked for anything yet"
    ride.silent = ""
    ride.for_s(2.0)
    ride.silent = "cmd"
    assert ride.for_s(1.0).state is State.RESCUE
    ride.silent = ""
    assert ride.for_s(1.0).state is State.PLANNER
