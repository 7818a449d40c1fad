"""A body for the decision logic of one rover file: it turns and moves as it is told, unless something holds it."""

from __future__ import annotations

from math import degrees
from random import Random

from tests.detector.rover import moved
from tests.escape.walk import observation
from wayfarer.angles import wrap360
from wayfarer.config.rover_file import load_rover
from wayfarer.detector import StallMonitor
from wayfarer.escape.api import Anomaly, Decision, Phase
from wayfarer.escape.catalogue import BUILT_IN
from wayfarer.hal import STOP

TICKS_MAX = 1000


class Body:
    """Feeds a handler tick by tick; what does not move is noticed by the rover's own stall detector.

    ``dead_band`` is the duty below which a side stands still; ``turns`` and ``moves`` say whether anything gives way.
    """

    def __init__(self, rover: str, algorithm: str, *, heading_deg: float = 0.0, dead_band: float = 0.0) -> None:
        config = load_rover(rover)
        self.tick_s = 1.0 / config.control_hz
        self.handler = BUILT_IN[algorithm].make(config.escape, config.vehicle, Random(1))
        self.turns = self.moves = True
        self.decision = Decision(STOP, Phase.HALT, "halt")
        self._vehicle = config.vehicle
        self._dead_band = dead_band
        self._stall = StallMonitor(config.detector, config.vehicle)
        self.seen = observation(heading_deg=heading_deg)

    def tick(self, *anomalies: Anomaly) -> Decision:
        left, right = self.decision.wheels
        full_m_s, seen = self._vehicle.max_speed_m_s, self.seen
        commanded_m = (left + right) / 2 * full_m_s * self.tick_s
        works = max(abs(left), abs(right)) >= self._dead_band
        self._stall.add(moved(commanded_m, commanded_m if self.moves and works else 0.0, self.tick_s))
        turn_rad = (left - right) * full_m_s / self._vehicle.track_m * self.tick_s
        self.seen = seen._replace(
            t_s=seen.t_s + self.tick_s,
            heading_deg=wrap360(seen.heading_deg + (degrees(turn_rad) if self.turns and works else 0.0)),
            travelled_m=seen.travelled_m + abs(commanded_m),
            anomalies=anomalies or ((Anomaly.IMMOBILISED,) if self._stall.found else ()),
        )
        self.decision = self.handler.decide(self.seen)
        return self.decision

    def reach(self, phase: Phase) -> None:
        """Meet something, and go on until a phase begins."""
        self.tick(Anomaly.IMMOBILISED)
        for _ in range(TICKS_MAX):
            if self.decision.phase is phase:
                return
            self.tick()
        raise AssertionError(f"{phase} did not begin")

    def while_in(self, phase: Phase) -> list[Decision]:
        """Go on until a phase has ended; return its decisions."""
        stay = [self.decision]
        for _ in range(TICKS_MAX):
            if self.tick().phase is not phase:
                return stay
            stay.append(self.decision)
        raise AssertionError(f"{phase} did not end")
