"""Under another stack's planner: whether the rover is stuck, who has the wheels, and when."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, nan, radians, sin
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.walk import TICK_S, VEHICLE, make
from wayfarer.api.failsafe import NO_HEADING, FailSafe, StuckDetector
from wayfarer.api.handlers import make_handler
from wayfarer.escape.api import Anomaly, Decision, Phase
from wayfarer.hal import STOP


class Ride:
    """Asks a fail-safe once per tick; the body turns as the handler tells it, and goes straight under the planner."""

    def __init__(self, algorithm: str = "forest-pledge", free_run_m: float = 1.0) -> None:
        self.failsafe = FailSafe(make(algorithm), VEHICLE, free_run_m=free_run_m)
        self.t_s = self.heading_deg = 0.0
        self.turns = True
        self.decision: Decision | None = None

    def tick(self, *, stuck: bool = False, blind: bool = False) -> Decision | None:
        if self.decision is not None and self.turns:
            left, right = self.decision.wheels
            self.heading_deg += (left - right) * VEHICLE.max_speed_m_s / VEHICLE.track_m * TICK_S * 57.29578
        self.t_s += TICK_S
        self.decision = self.failsafe.update(self.t_s, self.heading_deg, 0.0, stuck=stuck, blind=blind)
        return self.decision

    def until_given_back(self) -> list[Decision]:
        """Go on freely until the planner has the wheels again; return what the handler decided."""
        decisions: list[Decision] = []
        for _ in range(2000):
            decision = self.tick()
            if decision is None:
                return decisions
            decisions.append(decision)
        raise AssertionError(f"still {self.decision} after 100 s")

    def planner_drives(self, for_s: float) -> None:
        for _ in range(round(for_s / TICK_S)):
            assert self.tick() is None


def driven_m(decision: Decision) -> float:
    return sum(decision.wheels) / 2 * VEHICLE.max_speed_m_s * TICK_S


def free_run_m(decisions: list[Decision]) -> float:
    """How far the handler followed the goal in the end."""
    metres = 0.0
    for decision in reversed(decisions):
        if decision.phase is not Phase.FOLLOW:
            return metres
        metres += driven_m(decision)
    return metres


def test_planner_that_gets_on_is_never_disturbed() -> None:
    ride = Ride()
    ride.planner_drives(60.0)
    assert not ride.failsafe.drives


@pytest.mark.parametrize("algorithm", ["forest-pledge", "pledge", "levy-walk"])
def test_stuck_planner_loses_its_wheels_at_once_and_gets_them_back_after_an_episode_and_a_free_run(
    algorithm: str,
) -> None:
    ride = Ride(algorithm)
    ride.planner_drives(1.0)
    first = ride.tick(stuck=True)
    assert first is not None
    assert first.phase is Phase.BACK_OFF
    assert sum(first.wheels) < 0.0
    decisions = ride.until_given_back()
    assert decisions[-1].phase is Phase.FOLLOW
    assert free_run_m(decisions) == pytest.approx(1.0, abs=0.15)


def test_free_run_begins_again_with_each_episode() -> None:
    ride = Ride()
    ride.tick(stuck=True)
    while ride.decision is not None and ride.decision.phase is not Phase.FOLLOW:
        ride.tick()
    for _ in range(5):
        ride.tick()
    again = ride.tick(stuck=True)
    assert again is not None
    assert again.phase is Phase.BACK_OFF
    assert free_run_m(ride.until_given_back()) == pytest.approx(1.0, abs=0.15)


def test_blind_planner_is_stood_in_for_until_it_sees() -> None:
    ride = Ride()
    for _ in range(100):
        decision = ride.tick(blind=True)
        assert decision is not None
        assert decision.phase is Phase.FOLLOW
    assert ride.tick() is None


def test_planner_that_sees_again_waits_for_the_episode_to_end() -> None:
    ride = Ride()
    ride.tick(blind=True)
    ride.tick(stuck=True, blind=True)
    assert ride.until_given_back()[-1].phase is Phase.FOLLOW


def test_rover_that_is_free_is_kept_while_the_planner_is_blind() -> None:
    ride = Ride()
    ride.tick(stuck=True, blind=True)
    for _ in range(400):
        assert ride.tick(blind=True) is not None
    assert ride.tick() is None


def test_turns_that_were_blocked_at_one_place_change_nothing_at_the_next() -> None:
    """At one place the third blocked turn goes to the other side, after a shorter back-off."""
    ride = Ride(free_run_m=0.5)
    ride.turns = False
    for _ in range(2):
        ride.tick(stuck=True)
        while ride.decision is not None and ride.decision.phase is not Phase.FOLLOW:
            ride.tick()
    ride.until_given_back()
    ride.turns = True
    ride.planner_drives(20.0)
    ride.tick(stuck=True)
    decisions = ride.until_given_back()
    backed_off_m = sum(driven_m(each) for each in decisions if each.phase is Phase.BACK_OFF)
    (first_turn, *_) = (each.wheels for each in decisions if each.phase is Phase.TURN_AWAY)
    assert backed_off_m == pytest.approx(-0.15, abs=0.05)
    assert first_turn.left > 0.0 > first_turn.right


def test_planner_that_relapses_waits_twice_as_long_each_time_up_to_a_limit() -> None:
    ride = Ride()
    runs_m = []
    for _ in range(7):
        ride.tick(stuck=True)
        runs_m.append(free_run_m(ride.until_given_back()))
        ride.planner_drives(2.0)
    assert runs_m == pytest.approx([1.0, 2.0, 4.0, 8.0, 16.0, 16.0, 16.0], abs=0.15)


def test_planner_that_got_on_for_long_is_trusted_again() -> None:
    ride = Ride()
    for _ in range(2):
        ride.tick(stuck=True)
        ride.until_given_back()
    ride.planner_drives(10.0)
    ride.tick(stuck=True)
    assert free_run_m(ride.until_given_back()) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("unknown_deg", [nan, inf, -inf])
def test_wheels_stand_while_the_heading_is_unknown_and_the_manoeuvre_goes_on_afterwards(unknown_deg: float) -> None:
    rides = Ride(), Ride()
    for ride in rides:
        ride.tick(stuck=True)
    lost = rides[0]
    for _ in range(100):
        lost.t_s += TICK_S
        assert lost.failsafe.update(lost.t_s, unknown_deg, 0.0, stuck=False) is NO_HEADING
    lost.decision = NO_HEADING
    after = [[ride.tick() for _ in range(20)] for ride in rides]
    for late, other in zip(*after, strict=True):  # the time without a heading does not count
        assert late is not None
        assert other is not None
        assert late.why == other.why
        assert late.wheels == pytest.approx(other.wheels, abs=1e-9)


def test_goal_that_is_not_finite_stands_the_wheels_too() -> None:
    decision = Ride().failsafe.update(1.0, 0.0, nan, stuck=True)
    assert decision is not None
    assert decision.wheels == STOP


@pytest.mark.parametrize(("stuck", "takes_over"), [(np.True_, True), (np.False_, False), (1, True), ((), False)])
@pytest.mark.parametrize("number", [float, np.float16, np.float32, np.float64, np.int64, np.array])
def test_whatever_is_true_counts_and_numbers_of_numpy_are_numbers(
    stuck: Any, takes_over: bool, number: Callable[[int], Any]
) -> None:
    failsafe = FailSafe(make_handler("levy-walk", vehicle=VEHICLE), VEHICLE, free_run_m=number(1))
    decision = failsafe.update(number(1), number(370), number(5), stuck=stuck, blind=np.False_)
    assert (decision is not None) is takes_over
    assert failsafe.drives is takes_over


def test_same_time_gives_the_same_answer() -> None:
    ride = Ride()
    first = ride.tick(stuck=True)
    for t_s in (ride.t_s, ride.t_s - 1.0, nan):
        assert ride.failsafe.update(t_s, 90.0, 0.0, stuck=False) is first


def test_gap_between_two_calls_is_not_counted_as_driven() -> None:
    """A back-off of 0.15 m at 0.6 m/s takes 0.25 s; the first fifth of a second of a gap counts."""
    ride = Ride()
    ride.tick(stuck=True)
    ride.t_s += 60.0
    decision = ride.tick()
    assert decision is not None
    assert decision.phase is Phase.BACK_OFF


@given(
    st.lists(
        st.tuples(st.floats(0.0, 1.0), st.floats(allow_nan=True, allow_infinity=True), st.booleans(), st.booleans()),
        max_size=80,
    )
)
def test_whatever_it_is_told_the_planner_has_its_wheels_or_the_handler_gives_duties(
    ticks: list[tuple[float, float, bool, bool]],
) -> None:
    failsafe, t_s = FailSafe(make("forest-pledge"), VEHICLE), 0.0
    for dt_s, heading_deg, stuck, blind in ticks:
        last_t_s, t_s = t_s, t_s + dt_s
        decision = failsafe.update(t_s, heading_deg, 30.0, stuck=stuck, blind=blind)
        assert failsafe.drives is (decision is not None)
        if decision is None:
            assert t_s == last_t_s or not (stuck or blind)
        else:
            assert all(abs(duty) <= 1.0 for duty in decision.wheels)


# -- whether it is stuck -----------------------------------------------------------------------------------------------

Measure = Callable[[float, float, float], dict[str, Any]]  # from metres ahead since the last tick, east and north


class Body:
    """Moves as it is commanded, with a lag of 0.3 s, unless it is held; its odometry has noise."""

    def __init__(self, measure: Measure | None = None, **settings: float) -> None:
        self.detector = StuckDetector(VEHICLE, **settings)
        self._measure = measure or (lambda ahead_m, _east_m, _north_m: {"forward_m": ahead_m})
        self._rng = Random(1)
        self.t_s = self.speed_m_s = self.east_m = self.north_m = self.pitch_deg = 0.0
        self.heading_deg = 40.0
        self.held = False

    def tick(self, speed_m_s: float = 0.5, turn_deg_s: float = 0.0) -> bool:
        self.t_s += TICK_S
        self.speed_m_s += 0.15 * ((0.0 if self.held else speed_m_s) - self.speed_m_s)
        self.heading_deg += 0.0 if self.held else turn_deg_s * TICK_S
        ahead_m = self.speed_m_s * TICK_S + self._rng.gauss(0.0, 0.001)
        self.east_m += ahead_m * sin(radians(self.heading_deg))
        self.north_m += ahead_m * cos(radians(self.heading_deg))
        return self.detector.update(
            self.t_s, self.heading_deg + self._rng.gauss(0.0, 0.3), speed_m_s=speed_m_s, turn_deg_s=turn_deg_s,
            pitch_deg=self.pitch_deg, **self._measure(ahead_m, self.east_m, self.north_m),
        )  # fmt: skip

    def stuck_after_s(self, for_s: float = 5.0, speed_m_s: float = 0.5, turn_deg_s: float = 0.0) -> float:
        """How long it takes to be found stuck; infinity if it is not."""
        ticks = round(for_s / TICK_S)
        return next((n * TICK_S for n in range(1, ticks + 1) if self.tick(speed_m_s, turn_deg_s)), inf)


MEASURES: dict[str, Measure] = {
    "odometry": lambda ahead_m, _east_m, _north_m: {"forward_m": ahead_m},
    "NumPy's": lambda ahead_m, _east_m, _north_m: {"forward_m": np.float32(ahead_m)},
    "position": lambda _ahead_m, east_m, north_m: {"position_m": (east_m, north_m)},
}


@pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)
def test_body_that_is_held_is_stuck_and_one_that_moves_is_not(measure: Measure) -> None:
    body = Body(measure)
    assert body.stuck_after_s(20.0, turn_deg_s=20.0) == inf, "in a curve"
    assert body.stuck_after_s(5.0, -0.5) == inf, "in reverse"
    body.held = True
    assert body.stuck_after_s() <= 1.5
    assert body.detector.anomalies == (Anomaly.IMMOBILISED,)
    assert body.detector.trouble == ""
    body.held = False
    body.stuck_after_s(1.0, -0.5)
    assert body.stuck_after_s() == inf


def test_nothing_is_claimed_of_a_body_that_is_not_commanded_to_drive() -> None:
    body = Body()
    body.held = True
    assert body.stuck_after_s(30.0, 0.0) == inf
    assert body.stuck_after_s(30.0, 0.05) == inf
    assert body.stuck_after_s(30.0, 0.0, 60.0) == inf, "a turn on the spot"
    assert body.stuck_after_s(30.0, nan) == inf


def test_motion_that_nobody_measured_is_no_standstill_and_is_said() -> None:
    body = Body(lambda *_: {})
    assert body.stuck_after_s(2.0) == inf
    assert body.detector.trouble == "the motion sensor is silent"
    unknown = Body(lambda *_: {"forward_m": nan})
    assert unknown.stuck_after_s(2.0) == inf
    assert unknown.detector.conditions == ("motion_unknown",)
    body = Body(lambda *_: {})
    assert 2.0 < body.stuck_after_s(10.0) < 8.0, "something may have held it for three metres"


def test_tilt_counts_from_the_ground_on_which_it_was_put() -> None:
    body = Body(tilt_deg=15.0)
    assert body.stuck_after_s() == inf
    body.pitch_deg = 22.0
    assert body.stuck_after_s() < 0.5
    assert body.detector.anomalies == (Anomaly.NOSE_UP,)
    body.detector.reset()
    assert body.stuck_after_s() == inf, "somebody has put it on a steeper slope"


def test_heading_that_is_silent_is_said() -> None:
    detector = StuckDetector(VEHICLE)
    assert detector.heading_deg is None
    for tick in range(20):
        detector.update(tick * TICK_S, 370.0 + tick * 0.1 if tick < 10 else None, speed_m_s=0.5, forward_m=0.025)
    assert detector.heading_deg == pytest.approx(10.9)
    assert detector.trouble == "the compass is silent"


def test_position_that_was_put_elsewhere_is_no_motion() -> None:
    body = Body(MEASURES["position"])
    body.stuck_after_s(2.0)
    body.east_m += 100.0
    body.detector.reset()
    body.held = True
    assert body.stuck_after_s() <= 1.5


def test_same_time_is_the_same_tick() -> None:
    body = Body()
    body.held = True
    body.stuck_after_s()
    for t_s in (body.t_s, body.t_s - 1.0, nan):
        assert body.detector.update(t_s, 0.0, speed_m_s=0.5, forward_m=0.5)


@given(st.lists(st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 7), max_size=40))
def test_detector_answers_whatever_the_numbers_are(ticks: list[tuple[float, ...]]) -> None:
    detector = StuckDetector(VEHICLE)
    for n, (dt_s, heading_deg, speed_m_s, turn_deg_s, forward_m, pitch_deg, measured_t_s) in enumerate(ticks):
        position_m = (forward_m, pitch_deg) if n % 5 == 4 else None
        stuck = detector.update(
            n + (dt_s if abs(dt_s) < 1.0 else 0.0), heading_deg, speed_m_s=speed_m_s, turn_deg_s=turn_deg_s,
            forward_m=forward_m, position_m=position_m, pitch_deg=pitch_deg, measured_t_s=measured_t_s,
        )  # fmt: skip
        assert stuck is bool(detector.anomalies)
        assert isinstance(detector.trouble, str)
