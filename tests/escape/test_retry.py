"""Retry-Pledge: how it differs from Forest-Pledge. Its promises are in ``tests/test_testing.py``."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest

from tests.escape.walk import SETTINGS, STUCK, VEHICLE, Walk
from wayfarer.angles import wrap180
from wayfarer.escape.api import Anomaly, Decision, Phase
from wayfarer.escape.catalogue import BUILT_IN
from wayfarer.escape.retry import MOST_IN_VAIN, NOSE_UP_DEG

STALL_TICKS = 6  # 0.3 s, as the detector needs


class Sensing(Walk):
    """A walk whose rover measures its motion and its tilt, in which nothing is without noise."""

    nose_deg, noise_deg = 0.0, 0.1
    stands = False
    sees_motion: bool | None = True  # False: it takes the wheels to drive; None: there is no sensor
    _measured_m = _from_m = 0.0
    _ticks = 0

    def tick(self, *anomalies: Anomaly, **touch: Any) -> Decision:
        seen = self.seen
        if not (self.stands and self.sees_motion):
            self._measured_m += seen.travelled_m - self._from_m
        self._from_m = seen.travelled_m
        self._ticks += 1
        self.seen = seen._replace(
            pitch_deg=self.nose_deg + self._ticks % 2 * self.noise_deg,
            measured_m=None if self.sees_motion is None else self._measured_m,
        )
        return super().tick(*anomalies, **touch)

    def drive(self, distance_m: float) -> None:
        until_m = self.seen.travelled_m + distance_m
        while self.seen.travelled_m < until_m:
            self.tick()

    def stop(self, *anomalies: Anomaly, nose_deg: float = 0.0) -> None:
        """Push until the stall is noticed; the nose has risen by so much meanwhile."""
        level_deg = self.nose_deg
        self.stands, self.nose_deg = True, level_deg + nose_deg
        for _ in range(STALL_TICKS):
            self.tick()
        self.tick(*(anomalies or STUCK))
        self.stands, self.nose_deg = False, level_deg

    def answer_deg(self) -> float:
        """Return how far from its goal the rover heads until it follows it, or probes, again."""
        widest = 0.0
        while self.decision.phase not in {Phase.FOLLOW, Phase.PROBE}:
            self.tick()
            widest = max(widest, abs(wrap180(self.seen.heading_deg)))
        return widest


def driven(name: str = "retry-pledge", **senses: Any) -> Sensing:
    """A rover that has driven freely."""
    walk = Sensing(name)
    for key, value in senses.items():
        setattr(walk, key, value)
    walk.drive(5.0)
    return walk


def is_retried(walk: Sensing) -> bool:
    return walk.answer_deg() < 5.0


def meet_wall(walk: Sensing) -> tuple[bool, bool]:
    """Meet a wall twice, and return whether each time it is tried again; afterwards it drives freely."""
    answers = []
    for _ in range(2):
        walk.stop()
        answers.append(is_retried(walk))
        walk.drive(0.05)
    walk.to(Phase.FOLLOW)
    walk.drive(3.0)
    return answers[0], answers[1]


def test_it_draws_no_chance() -> None:
    rng = Random(1)
    before = rng.getstate()
    walk = Sensing("retry-pledge")
    walk.handler = BUILT_IN["retry-pledge"].make(SETTINGS, VEHICLE, rng)
    for _ in range(3):
        walk.drive(1.0)
        walk.stop()
        walk.to(Phase.FOLLOW)
    assert rng.getstate() == before


def test_slip_is_answered_straight_ahead() -> None:
    for name, retried in (("retry-pledge", True), ("forest-pledge", False)):
        walk = driven(name)
        walk.stop()
        assert is_retried(walk) is retried


def test_wall_is_answered_at_its_second_contact() -> None:
    assert meet_wall(driven()) == (True, False)


def test_second_try_backs_off_only_a_little() -> None:
    def back_m(walk: Sensing) -> float:
        walk.stop()
        from_m = walk.seen.travelled_m
        walk.go_on(lambda decision: decision.phase is not Phase.BACK_OFF)
        return walk.seen.travelled_m - from_m

    assert back_m(driven()) < 0.6 * back_m(driven("forest-pledge"))


@pytest.mark.parametrize("slope_deg", [-10.0, 0.0, 10.0])
def test_nose_that_rose_is_a_wall_at_its_first_contact_on_any_slope(slope_deg: float) -> None:
    for risen_deg, retried in ((0.0, True), (NOSE_UP_DEG - 0.5, True), (NOSE_UP_DEG + 0.5, False)):
        walk = driven(nose_deg=slope_deg)
        walk.stop(nose_deg=risen_deg)
        assert is_retried(walk) is retried


def test_single_reading_of_the_nose_is_noise() -> None:
    walk = driven()
    walk.stands = True
    for _ in range(STALL_TICKS):
        walk.tick()
    walk.nose_deg = NOSE_UP_DEG + 2.0
    walk.tick(*STUCK)
    assert is_retried(walk)


@pytest.mark.parametrize("anomaly", [each for each in Anomaly if each is not Anomaly.IMMOBILISED])
def test_tilt_and_touch_are_no_slips(anomaly: Anomaly) -> None:
    for anomalies in ((anomaly,), (Anomaly.IMMOBILISED, anomaly)):
        walk = driven()
        walk.stop(*anomalies)
        assert not is_retried(walk)


@pytest.mark.parametrize("senses", [{"noise_deg": 0.0}, {"sees_motion": False}, {"sees_motion": None}])
def test_rover_that_lacks_tilt_or_motion_sensor_drives_as_forest_pledge(senses: dict[str, Any]) -> None:
    """It would push until it climbs, and climb until it tips."""
    walks = [driven(name, **senses) for name in ("retry-pledge", "forest-pledge")]
    for _ in range(4):
        for walk in walks:
            walk.stop()
            walk.drive(2.0)
        assert walks[0].seen == walks[1].seen


def test_stop_right_after_the_start_has_nothing_to_compare_the_nose_with() -> None:
    walk = Sensing("retry-pledge")
    walk.nose_deg = 10.0
    walk.stop()
    assert is_retried(walk)


def test_second_tries_end_once_many_in_a_row_have_met_something() -> None:
    walk = driven()
    assert [meet_wall(walk) for _ in range(MOST_IN_VAIN + 2)] == [(True, False)] * MOST_IN_VAIN + [(False, False)] * 2
    walk.handler.reset()
    walk.drive(3.0)
    assert meet_wall(walk) == (True, False), "a new mission begins"


def test_slip_that_is_driven_past_begins_the_row_again() -> None:
    walk = driven()
    for _ in range(2 * MOST_IN_VAIN):
        assert meet_wall(walk) == (True, False)
        walk.stop()
        assert is_retried(walk)
        walk.drive(3.0)


def test_there_is_no_second_try_after_a_blocked_turn() -> None:
    walk = driven()
    walk.stop()
    walk.answer_deg()
    walk.drive(0.05)
    walk.stop()
    walk.turns = False
    walk.to(Phase.PROBE)
    walk.turns = True
    assert walk.handler.memory()["blocked_turns"] == 1
    walk.drive(0.4)
    walk.stop()
    assert not is_retried(walk)
