"""Ground that moves although the wheels were told to stand, and what only looks like it."""

from __future__ import annotations

from math import copysign, cos, inf, radians, sin
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.detector.rover import BACK, FULL, MAX_SPEED_M_S, TICK_S, Rover, started
from wayfarer.detector.detector import DetectorTick
from wayfarer.detector.ground import LOAD_MAX
from wayfarer.detector.motion import AFTER_S, FOR_S, SLIDES_S
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.simhal.world.wheeled_body import ROLLING_RESISTANCE

G_M_S2 = 9.81
PERIOD_S = 0.05


def stopped(wheels: WheelCommand = FULL) -> Rover:
    """A rover that drove and was told to stop just now."""
    rover = started()
    for _ in range(20):
        rover.tick(wheels, wheels.left * MAX_SPEED_M_S * TICK_S)
    return rover


def runs_away(rover: Rover, speed_m_s: float, **fields: Any) -> list[bool]:
    """Stand for a second, while the ground goes by at that speed."""
    return [
        Condition.RUNAWAY in rover.tick(STOP, speed_m_s * PERIOD_S, dt_s=PERIOD_S, **fields).conditions
        for _ in range(20)
    ]


@pytest.mark.parametrize("speed_m_s", [0.12, 1.0, -0.12, -1.0])
@pytest.mark.parametrize("wheels", [FULL, BACK])
def test_rover_that_goes_on_is_running_away_within_half_a_second_of_the_stop(
    speed_m_s: float, wheels: WheelCommand
) -> None:
    found = runs_away(stopped(wheels), speed_m_s)
    assert (found.index(True) + 1) * PERIOD_S <= 0.5 + 1e-9
    assert found[found.index(True) :] == [True] * (20 - found.index(True)), "for as long as it goes on"


@pytest.mark.parametrize(
    ("pitch_deg", "speed_m_s", "away"),
    [
        (12.0, -0.15, False),
        (-12.0, 0.15, False),
        (12.0, 0.15, True),
        (12.0, -0.5, False),
        (2.0, -0.15, True),
    ],
)
def test_body_that_rolls_or_slides_downhill_is_not_driven(pitch_deg: float, speed_m_s: float, away: bool) -> None:
    """Motors that are told 0 do not hold it; motion uphill is another thing."""
    assert any(runs_away(stopped(), speed_m_s, pitch_deg=pitch_deg)) is away


def on_a_hill(pitch_deg: float, wheels: WheelCommand = FULL) -> Rover:
    """A rover that was armed where the ground rises so ahead, drove and was told to stop just now."""
    rover = started()
    rover.tick(pitch_deg=pitch_deg)
    rover.detector.begin_mission(DetectorTick(rover.t_s))
    for _ in range(20):
        rover.tick(wheels, wheels.left * MAX_SPEED_M_S * TICK_S, pitch_deg=pitch_deg)
    return rover


def found_after_s(rover: Rover, speed_m_s: float, **fields: Any) -> float:
    """Stand for a minute, while the ground goes by at that speed; return when that is a runaway."""
    for tick in range(1200):
        if Condition.RUNAWAY in rover.tick(STOP, speed_m_s * PERIOD_S, dt_s=PERIOD_S, **fields).conditions:
            return (tick + 1) * PERIOD_S
    return inf


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(
    ("pitch_deg", "speed_m_s", "within_s"),
    [
        (-4.0, 4.0, 0.5),
        (4.0, -4.0, 0.5),
        (-15.0, 4.0, 0.5),
        (-4.0, 0.9, SLIDES_S + 0.5),
        (-15.0, 0.9, SLIDES_S + 0.5),
        (15.0, -0.9, SLIDES_S + 0.5),
    ],
)
def test_motor_that_drives_on_downhill_is_found(
    pitch_deg: float, speed_m_s: float, within_s: float, *, signed: bool
) -> None:
    """A slope excused any speed, for ever: gravity moves a body whose motors brake for a while, or slowly."""
    speed_m_s = speed_m_s if signed else abs(speed_m_s)
    rover = on_a_hill(pitch_deg)
    assert found_after_s(rover, speed_m_s, pitch_deg=pitch_deg, signed=signed) <= within_s + 1e-9


@pytest.mark.parametrize("pitch_deg", [-6.0, 6.0])
def test_compass_that_is_mounted_askew_does_not_hide_a_motor_that_drives_on(pitch_deg: float) -> None:
    """It says that level ground falls; the rover was armed on other ground, and has turned since."""
    assert found_after_s(stopped(), -0.15 * pitch_deg, pitch_deg=pitch_deg) <= SLIDES_S + 0.5


@given(
    pitch_deg=st.floats(-22.0, 22.0),
    load=st.floats(0.2, LOAD_MAX),
    friction=st.floats(0.06, 0.8),
    speed_m_s=st.floats(-1.0, 1.0),
    knows_heading=st.booleans(),
    signed=st.booleans(),
)
def test_braked_body_on_a_hill_is_not_running_away(
    pitch_deg: float, load: float, friction: float, speed_m_s: float, *, knows_heading: bool, signed: bool
) -> None:
    """It rolls as fast as its motors let it, or its wheels slide for a while; also while the compass is silent."""
    fall, speed_m_s = -sin(radians(pitch_deg)), copysign(speed_m_s, -pitch_deg)
    rover, grip_m_s2 = on_a_hill(pitch_deg), friction * G_M_S2 * cos(radians(pitch_deg))
    assume(abs(pitch_deg) > 4.5 or friction > 0.13)  # on flatter mud it would have to slide faster and faster
    rolls_m_s = load * MAX_SPEED_M_S * copysign(max(0.0, abs(fall) - ROLLING_RESISTANCE), fall)
    slides_s = 0.0
    for _ in range(200):
        braked_m_s2 = (rolls_m_s - speed_m_s) / 0.1 - G_M_S2 * fall
        slides_s = slides_s + PERIOD_S if abs(braked_m_s2) > grip_m_s2 else 0.0
        assume(slides_s < SLIDES_S - 0.5)
        speed_m_s += (max(-grip_m_s2, min(grip_m_s2, braked_m_s2)) + G_M_S2 * fall) * PERIOD_S
        moved_m = speed_m_s * PERIOD_S if signed else abs(speed_m_s * PERIOD_S)
        tick = rover.tick(STOP, moved_m, dt_s=PERIOD_S, pitch_deg=pitch_deg, compass=knows_heading, signed=signed)
        assert Condition.RUNAWAY not in tick.conditions


@pytest.mark.parametrize("signed", [True, False])
def test_body_that_rolls_back_from_a_trunk_on_level_ground_is_not_running_away(*, signed: bool) -> None:
    rover, speed_m_s = stopped(), 0.0
    for tick in range(60):
        pitch_deg = max(0.0, 18.0 - tick)
        speed_m_s = max(-0.4, speed_m_s - 0.1) if pitch_deg > 3.0 else min(0.0, speed_m_s + 0.1)
        moved_m = speed_m_s * PERIOD_S if signed else -speed_m_s * PERIOD_S
        found = rover.tick(STOP, moved_m, dt_s=PERIOD_S, pitch_deg=pitch_deg, signed=signed).conditions
        assert Condition.RUNAWAY not in found


def test_runaway_ends_with_the_motion() -> None:
    rover = stopped()
    assert runs_away(rover, 0.5)[-1]
    assert not any(runs_away(rover, 0.0))


@pytest.mark.parametrize(
    ("speed_m_s", "fields", "away"),
    [
        (0.0, {}, False),
        (0.08, {}, False),
        (-0.08, {}, False),
        (1.0, {"quality": 0.1}, False),
        (0.5, {"signed": False}, True),
    ],
)
def test_creeping_and_poor_sight_are_no_runaway_and_a_sense_without_direction_sees_one(
    speed_m_s: float, fields: dict[str, Any], away: bool
) -> None:
    found = runs_away(stopped(BACK), speed_m_s, **fields)
    assert (found[-1], any(found)) == (away, away)


@pytest.mark.parametrize(("wheels", "moved_m"), [(FULL, [TICK_S]), (STOP, [0.02, -0.02])], ids=["it goes", "it rocks"])
def test_rover_that_is_told_to_go_or_rocks_to_and_fro_is_not_running_away(
    wheels: WheelCommand, moved_m: list[float]
) -> None:
    rover = stopped()
    assert {rover.tick(wheels, each).conditions for each in moved_m * 40} == {()}


@given(
    speed_m_s=st.floats(0.05, 1.4),
    friction=st.floats(0.06, 0.8),
    offset_s=st.floats(0.0, PERIOD_S),
    way=st.sampled_from([1, -1]),
)
def test_rover_that_slides_to_a_stop_on_leaves_is_not_running_away(
    speed_m_s: float, friction: float, offset_s: float, way: int
) -> None:
    """From mud to dry soil, from the highest speed of a shipped rover, at any phase of the readings."""
    rover = started()
    rover.tick(WheelCommand(float(way), float(way)), 0.0, dt_s=PERIOD_S)
    stops_s = speed_m_s / (friction * G_M_S2)

    def slid_m(t_s: float) -> float:
        t_s = min(max(t_s, 0.0), stops_s)
        return speed_m_s * t_s - friction * G_M_S2 * t_s**2 / 2

    for tick in range(60):
        since_s = tick * PERIOD_S + offset_s
        moved_m = way * (slid_m(since_s) - slid_m(since_s - PERIOD_S))
        assert Condition.RUNAWAY not in rover.tick(STOP, moved_m, dt_s=PERIOD_S).conditions


def test_short_window_of_sliding_would_be_a_runaway() -> None:
    """The test above can fail: on ice the rover is still sliding when the time for coasting is over."""
    assert runs_away(stopped(), MAX_SPEED_M_S)[9]
    assert pytest.approx(0.5, abs=1e-5) == AFTER_S + FOR_S
