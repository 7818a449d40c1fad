"""Builders for the tests of the decision logic: an observation, and a walk that feeds a handler tick by tick."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees
from random import Random
from typing import Any

from wayfarer.angles import wrap360
from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.catalogue import BUILT_IN
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.hal import STOP, ContactReading, Side

SETTINGS = EscapeSettings()
VEHICLE = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=1.4)
TICK_S = 0.05
STUCK = (Anomaly.IMMOBILISED,)

AHEAD = Observation(
    t_s=0.0,
    heading_deg=0.0,
    pitch_deg=0.0,
    roll_deg=0.0,
    anomalies=(),
    contact=None,
    goal_heading_deg=0.0,
    travelled_m=0.0,
)


def observation(**changes: Any) -> Observation:
    """An observation of a level rover on its goal heading, with changes."""
    return AHEAD._replace(**changes)


def touch(*sides: Side, bearing_deg: float | None = None) -> ContactReading:
    return ContactReading(0.0, sides, bearing_deg)


def make(name: str, seed: int = 1, settings: EscapeSettings = SETTINGS) -> EscapeHandler:
    return BUILT_IN[name].make(settings, VEHICLE, Random(seed))


class Walk:
    """Feeds a handler; heading and distance follow its wheels unless ``turns`` or ``travels`` says otherwise."""

    def __init__(
        self, name: str, *, seed: int = 1, goal_heading_deg: float = 0.0, heading_deg: float = 0.0,
        settings: EscapeSettings = SETTINGS,
    ) -> None:  # fmt: skip
        self.handler = make(name, seed, settings)
        self.seen = observation(goal_heading_deg=goal_heading_deg, heading_deg=heading_deg)
        self.turns = True
        self.travels = True
        self.decision = Decision(STOP, Phase.HALT, "halt")
        self.tick()

    @property
    def counter_deg(self) -> float:
        return float(self.handler.memory()["counter_deg"])

    def tick(self, *anomalies: Anomaly, contact: ContactReading | None = None, turn_deg: float = 0.0) -> Decision:
        left, right = self.decision.wheels
        full_m_s, seen = VEHICLE.max_speed_m_s, self.seen
        if self.turns:
            turn_deg += degrees((left - right) * full_m_s / VEHICLE.track_m) * TICK_S
        travelled_m = abs(left + right) / 2 * full_m_s * TICK_S if self.travels else 0.0
        self.seen = seen._replace(
            t_s=seen.t_s + TICK_S,
            heading_deg=wrap360(seen.heading_deg + turn_deg),
            travelled_m=seen.travelled_m + travelled_m,
            anomalies=anomalies,
            contact=contact,
        )
        self.decision = self.handler.decide(self.seen)
        return self.decision

    def go_on(self, reached: Callable[[Decision], bool], *anomalies: Anomaly) -> Decision:
        """Tick until a decision is reached."""
        for _ in range(2000):
            if reached(self.decision):
                return self.decision
            self.tick(*anomalies)
        raise AssertionError(f"still {self.decision} after 100 s")

    def to(self, phase: Phase, *anomalies: Anomaly) -> Decision:
        """Reach a phase, starting an episode if there is none."""
        if phase is not Phase.FOLLOW and self.decision.phase is Phase.FOLLOW:
            self.tick(*(anomalies or STUCK))
        return self.go_on(lambda decision: decision.phase is phase)
