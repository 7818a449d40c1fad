"""A compass that shows the heading of some tenths of a second ago."""

from __future__ import annotations

from collections import deque
from random import Random

import pytest

from wayfarer.angles import wrap180
from wayfarer.escape.api import Observation, Phase
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.escape.handler import PhasedHandler
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.escape.turn_control import STEP, CompassLag, TurnController
from wayfarer.hal import WheelCommand

TICK_S = 0.05
VEHICLE = Vehicle(0.4, 0.4, 0.5, 1.4)
LAGS = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]


def turning(lag_ticks: int, share: float = 1.0, noise_deg: float = 1.0, seed: int = 0) -> CompassLag:
    """Turn to and fro, five times 40 degrees, and let the compass show it so many ticks late."""
    lag, chance = CompassLag(), Random(seed)
    headings_deg = deque([0.0] * (lag_ticks + 1), maxlen=lag_ticks + 1)
    true_deg = shown_deg = 0.0
    for n in range(200):
        expected_deg = 5.0 * (-1) ** (n // 40) if n % 40 < 8 else 0.0
        true_deg += share * expected_deg
        headings_deg.append(true_deg)
        now_deg = headings_deg[0] + chance.gauss(0.0, noise_deg)
        lag.update(now_deg - shown_deg, expected_deg)
        shown_deg = now_deg
    for _ in range(4):  # the next turn, of which a lag hides a part
        true_deg += share * 5.0
        headings_deg.append(true_deg)
        lag.update(headings_deg[0] - shown_deg, 5.0)
        shown_deg = headings_deg[0]
    return lag


@pytest.mark.parametrize("lag_ticks", [4, 6, 8, 10])
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_turn_that_is_not_shown_yet_is_expected(lag_ticks: int, share: float) -> None:
    assert turning(lag_ticks, share).pending_deg == pytest.approx(20.0 * share, abs=4.0)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("lag_ticks", [0, 1])
def test_compass_that_is_prompt_is_left_as_it_is(lag_ticks: int, seed: int) -> None:
    assert turning(lag_ticks, seed=seed).pending_deg == 0.0


def test_body_that_is_held_teaches_no_lag() -> None:
    assert turning(0, share=0.0).pending_deg == 0.0


def test_lag_is_kept_and_the_turn_forgotten_after_a_hold() -> None:
    lag = turning(8)
    lag.forget()
    assert lag.pending_deg == 0.0
    for _ in range(STEP):
        lag.update(0.0, 5.0)
    assert lag.pending_deg > 0.0


def test_heading_that_jumps_by_hand_does_not_lose_the_counter() -> None:
    """What was predicted and never shown is taken back."""
    turns = TurnController(VEHICLE)
    turns.lag = turning(8)
    gained_deg = turns.observe(0.0, 0.0, None)
    pending_deg = turns.lag.pending_deg
    gained_deg = turns.observe(TICK_S, 90.0, WheelCommand(0.0, 0.0))
    assert gained_deg == pytest.approx(90.0 - pending_deg)
    assert turns.lag.pending_deg == 0.0


class Turning:
    """A body on ideal ground under Forest-Pledge, with a goal that changes: it turns on the spot."""

    def __init__(self, lag_s: float) -> None:
        handler = CATALOGUE["forest-pledge"].make(EscapeSettings(), VEHICLE, Random(0))
        assert isinstance(handler, PhasedHandler)
        self.handler = handler
        ticks = round(lag_s / TICK_S) + 1
        self._shown_deg = deque([0.0] * ticks, maxlen=ticks)
        self.heading_deg = self._rate = self.t_s = 0.0
        self._applied = WheelCommand(0.0, 0.0)

    def turn_to(self, goal_deg: float, for_s: float = 4.0) -> list[float]:
        """Follow a goal; return by how much the heading was off at each tick."""
        off_deg = []
        for _ in range(round(for_s / TICK_S)):
            self.t_s += TICK_S
            seen = Observation(
                self.t_s, self._shown_deg[0] % 360.0, 0.0, 0.0, (), None, goal_deg % 360.0, self.t_s, self.t_s,
                self._applied,
            )  # fmt: skip
            decision = self.handler.decide(seen)
            assert decision.phase is Phase.FOLLOW
            self._applied = decision.wheels
            wanted = (decision.wheels.left - decision.wheels.right) * 1.4 / 0.5 * 57.3
            self._rate += (wanted - self._rate) * TICK_S / (TICK_S + 0.1)
            self.heading_deg += self._rate * TICK_S
            self._shown_deg.append(self.heading_deg)
            off_deg.append(wrap180(self.heading_deg - goal_deg))
        return off_deg


@pytest.mark.parametrize("lag_s", LAGS)
def test_heading_stays_near_the_goal_where_the_lag_is_known(lag_s: float) -> None:
    """Without a prediction it swings by 100 degrees at a lag of half a second."""
    body = Turning(lag_s)
    body.handler._turns.lag = turning(round(lag_s / TICK_S))
    for n in range(4):
        off_deg = body.turn_to(50.0 * (n % 2))
    assert max(abs(each) for each in off_deg[-30:]) < 20.0
