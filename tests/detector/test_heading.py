"""Compass, or wheel commands: which heading decisions use."""

from __future__ import annotations

from typing import Any

import pytest

from tests.detector.rover import BACK, FULL, PIVOT, TICK_S, VEHICLE, Detection, Rover
from wayfarer.detector.compass import BELIEVE_AFTER_S, RECKON_AFTER_S
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition

RECKONED = (Condition.HEADING_RECKONED,)
LEFT_TURN = WheelCommand(-1.0, 1.0)
TICKS_S = round(1 / TICK_S)
# How far one tick of a turn on the spot at full duty turns a body that obeys.
STEP_DEG = 2 * VEHICLE.max_speed_m_s / VEHICLE.track_m * TICK_S * 57.29578


class Mission(Rover):
    """A rover that is armed, and has a heading of its own: it turns by a share of what is commanded."""

    def __init__(self, share: float = 1.0, *, armed: bool = True, **watches: Any) -> None:
        super().__init__(watches_motion=False, **watches)
        self.armed, self.share = armed, share
        self.true_deg = 90.0
        self.go(1)

    def go(self, ticks: int, applied: WheelCommand = STOP, *, compass: bool = True) -> Detection:
        """Some ticks of one command; return what the last one found."""
        for _ in range(ticks):
            self.true_deg += self.share * STEP_DEG * (applied.left - applied.right) / 2
            found = self.tick(applied, None, compass=compass, heading_deg=self.true_deg % 360.0)
        return found

    def lose_compass(self) -> None:
        """Stand until the heading is reckoned."""
        while not set(RECKONED) <= set(self.go(1, compass=False).conditions):
            assert self.t_s < 60.0

    @property
    def error_deg(self) -> float:
        """How far the heading that is used is off."""
        return (self.heading_deg - self.true_deg + 180.0) % 360.0 - 180.0


def test_heading_is_reckoned_three_seconds_after_the_compass_fell_silent() -> None:
    rover = Mission()
    began_s = rover.t_s
    assert rover.go(10, compass=False).conditions == (Condition.COMPASS_STALE,)
    rover.lose_compass()
    assert rover.t_s - began_s == pytest.approx(RECKON_AFTER_S + 0.25, abs=0.1)


@pytest.mark.parametrize("turn", [PIVOT, LEFT_TURN])
def test_reckoned_heading_follows_the_commands(turn: WheelCommand) -> None:
    rover = Mission()
    rover.lose_compass()
    assert rover.go(10, turn, compass=False).conditions == RECKONED
    assert abs(rover.true_deg - 90.0) > 60.0
    assert rover.error_deg == pytest.approx(0.0, abs=1.0)
    rover.go(10, FULL, compass=False)
    rover.go(10, BACK, compass=False)
    assert rover.error_deg == pytest.approx(0.0, abs=1.0)


def test_what_was_turned_until_the_loss_was_noticed_is_reckoned_too() -> None:
    rover = Mission()
    rover.go(4, PIVOT)
    rover.go(5, PIVOT, compass=False)
    rover.lose_compass()
    assert rover.error_deg == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("share", [0.5, 0.8, 1.2])
def test_share_of_the_commands_that_the_ground_allows_is_learnt_from_turns_with_a_compass(share: float) -> None:
    rover = Mission(share)
    for _ in range(12):
        rover.go(8, PIVOT)
        rover.go(4, FULL)
        rover.go(8, LEFT_TURN)
        rover.go(4)
    rover.lose_compass()
    rover.go(8, PIVOT, compass=False)
    turned_deg = rover.true_deg - 90.0
    assert rover.error_deg == pytest.approx(0.0, abs=0.05 * turned_deg)


def test_turns_that_something_blocks_teach_nothing() -> None:
    rover = Mission(0.1)
    for _ in range(12):
        rover.go(8, PIVOT)
        rover.go(4)
    rover.share = 1.0
    rover.lose_compass()
    rover.go(8, PIVOT, compass=False)
    assert rover.error_deg == pytest.approx(0.0, abs=1.0)


def test_compass_is_believed_again_after_a_second() -> None:
    rover = Mission(0.7)
    rover.lose_compass()
    rover.go(10, PIVOT, compass=False)
    assert abs(rover.error_deg) > 20.0
    assert rover.go(round(BELIEVE_AFTER_S * TICKS_S) - 1).conditions == RECKONED
    assert rover.go(4).conditions == ()
    assert rover.error_deg == 0.0


def test_spells_of_sense_shorter_than_a_second_do_not_make_a_rover_stand_for_ever() -> None:
    rover = Mission()
    for _ in range(10):
        rover.go(10, compass=False)
        rover.go(10)
    assert rover.go(10, compass=False).conditions == RECKONED


@pytest.mark.parametrize("watches", [{"armed": False}, {"may_reckon": False}], ids=["disarmed", "among people"])
def test_heading_is_reckoned_only_in_a_mission_that_may(watches: dict[str, bool]) -> None:
    rover = Mission(**watches)
    assert rover.go(8 * TICKS_S, compass=False).conditions == (Condition.COMPASS_LOST,)


def test_tilt_of_a_compass_that_fell_silent_is_forgotten() -> None:
    rover = Mission()
    rover.tick(STOP, None, heading_deg=90.0, pitch_deg=15.0)
    rover.lose_compass()
    assert rover.detector.compass is not None
    assert rover.detector.compass.pitch_deg == 0.0
