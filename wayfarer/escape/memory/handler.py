"""The handler that remembers contacts and plans around them; Pledge is its fallback."""

from __future__ import annotations

import os
from collections import deque
from math import atan2, cos, degrees, hypot, radians, sin
from random import Random
from typing import Final

from wayfarer.angles import wrap180
from wayfarer.escape import policies
from wayfarer.escape.api import Decision, EscapeSettings, Observation, Phase, Vehicle
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.memory.contact_map import ContactMap
from wayfarer.escape.memory.route import plan
from wayfarer.escape.memory.trunks import Point
from wayfarer.escape.phases import PLEDGE, PLANNED, PhaseEvent

P = {k[2:]: float(v) for k, v in os.environ.items() if k.startswith("M_")}


def par(name: str, default: float) -> float:
    return P.get(name, default)


class MemoryHandler(PhasedHandler):
    """Decides one tick at a time; implements ``EscapeHandler``."""

    def __init__(self, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        body_m = vehicle.width_m
        self._body_m = body_m
        self._map = ContactMap(body_m)
        spec = AlgorithmSpec(PLANNED, policies.clockwise, policies.fixed_angle, keeps_side=True, reckons=True)
        super().__init__(spec, settings, vehicle, rng)

    def reset(self) -> None:
        super().reset()
        self._map.clear()
        self._way: list[Point] = []
        self._last_hand = 1.0
        self._suspect_m = -1e9  # path at the last anomaly that may have been a slip
        self._suspect: Point = (0.0, 0.0)
        self._planned_m = 0.0
        self._slips = self._walls = 0.0
        self._pitches: deque[tuple[float, float]] = deque(maxlen=45)
        self._best_ahead_m = 0.0
        self._budget = par("budget", 60.0)
        self._contacts = 0
        self._stint = 0
        self._crowded = False
        self._met_m: deque[float] = deque(maxlen=int(par("crowd_n", 7)))
        self._mode(str(int(par("cycle", 12)))[0])
        self._plans = 0

    def _aim(self, observation: Observation) -> Observation:
        """Return the observation with the heading of the way as its goal."""
        reckoning = self._reckoning
        a, r = reckoning.ahead_m, reckoning.right_m
        self._keep_books(observation, a)
        self._true_goal_deg = observation.goal_heading_deg
        self._pitches.append((observation.t_s, observation.pitch_deg))
        if observation.travelled_m - self._suspect_m > par("againm", 1.0) and self._suspect_m > -1e8:
            self._suspect_m = -1e9
            self._slips += 1.0
        if self._pledge or not self._way:
            return observation
        if self._manoeuvre.phase is Phase.FOLLOW:
            ta, tr = self._way[0]
            near = hypot(ta - a, tr - r) < par("reach", 0.4) * self._body_m
            if near or observation.travelled_m - self._planned_m > par("replan", 1.0):
                if near:
                    self._way = self._way[1:]
                self._replan(observation)
        return observation._replace(goal_heading_deg=self._heading_deg(observation))

    def _heading_deg(self, observation: Observation) -> float:
        if not self._way:
            return observation.goal_heading_deg
        reckoning = self._reckoning
        ta, tr = self._way[0]
        return (observation.goal_heading_deg + degrees(atan2(tr - reckoning.right_m, ta - reckoning.ahead_m))) % 360.0

    def _replan(self, observation: Observation) -> None:
        reckoning = self._reckoning
        self._planned_m = observation.travelled_m
        self._way, _ = plan(
            (reckoning.ahead_m, reckoning.right_m), self._map.nodes(), self._map.barriers(), 2.0
        )
        self._plans += 1

    def _keep_books(self, observation: Observation, a: float) -> None:
        """Switch between plan and Pledge by their budgets."""
        if a > self._best_ahead_m + 2.5 * self._body_m:
            self._best_ahead_m = a
            self._contacts = 0
            if self._pledge and not self._crowded:
                self._mode('1')
            self._stint = 0
            self._budget = par("budget", 60.0)

    def _choose_by_crowd(self) -> None:
        """Leave the wheels to Pledge where contacts are so close that there is nothing to plan with."""
        met = self._met_m
        if len(met) < met.maxlen:
            return
        per_contact = (met[-1] - met[0]) / (len(met) - 1) / self._body_m
        if not self._crowded and per_contact < par("crowd_in", 2.5):
            self._crowded = True
            self._mode("2")
            self._way = []
        elif self._crowded and per_contact > par("crowd_out", 4.0):
            self._crowded = False
            self._mode("1")

    def _mode(self, digit: str) -> None:
        self._pledge = digit != "1"
        self._spec_transitions = PLEDGE if self._pledge else PLANNED
        self._hand = -1 if digit in "35" else 1
        self._escape_plan.resets = digit in "45"
        self._resets = digit in "45"
        self._escape_plan.counter_deg = 0.0

    def _plan(self, observation: Observation, *, new_episode: bool) -> None:
        super()._plan(observation, new_episode=new_episode)
        self._escape_plan.resets = self._resets
        reckoning, escape_plan = self._reckoning, self._escape_plan
        left = self._manoeuvre.phase
        bearing = radians(observation.heading_deg - self._true_goal_deg)
        place = (reckoning.ahead_m, reckoning.right_m)
        slip = left is not Phase.TURN_AWAY and self._is_slip(observation, place)
        if slip:
            escape_plan.back_off_m *= par("slipback", 0.6)
            escape_plan.turn_deg = 0.0
            escape_plan.stride_m = 0.0
            return
        self._contacts += 1
        self._met_m.append(observation.travelled_m)
        self._choose_by_crowd()
        if self._contacts > self._budget and self._manoeuvre.phase is not Phase.TURN_AWAY:
            self._stint += 1
            cycle = str(int(par("cycle", 12)))
            if self._stint % len(cycle) == 0:
                self._budget *= par("double", 2.0)
            self._contacts = 0
            self._way = []
            self._mode(cycle[self._stint % len(cycle)])
        if self._pledge:
            escape_plan.side = self._side = self._hand
            too_often = self._blocked_turns - 2
            if too_often >= 0 and too_often % 2 == 0:
                escape_plan.side = -self._side
        if left is Phase.TURN_AWAY:
            return  # blocked turn: the plan of the base class alternates sides
        escape_plan.back_off_m *= par("back", 1.0)
        self._map.add(place, (cos(bearing), sin(bearing)), observation.travelled_m)
        if self._pledge:
            return
        back_m = escape_plan.back_off_m
        a, r = place[0] - back_m * cos(bearing), place[1] - back_m * sin(bearing)
        self._planned_m = observation.travelled_m
        self._way, _ = plan(
            (a, r), self._map.nodes(), self._map.barriers(), 2.0, (cos(bearing), sin(bearing)), par("turn", 0.0) * self._body_m, self._last_hand, par("switch", 0.0) * self._body_m
        )
        self._plans += 1
        want = degrees(atan2(self._way[0][1] - r, self._way[0][0] - a)) if self._way else 0.0
        turn = wrap180(want - degrees(bearing))
        escape_plan.side = self._side = 1 if turn >= 0 else -1
        escape_plan.turn_deg = abs(turn)
        if abs(turn) > 5.0:
            self._last_hand = 1.0 if turn > 0.0 else -1.0
        escape_plan.stride_m = self._body_m * 0.75

    def _rise_deg(self, observation: Observation) -> float:
        """Return how far the nose rose during the stall: means of several readings, because one is noisy."""
        now_s = observation.t_s
        late_n = late = early_n = early = 0.0
        for t_s, pitch_deg in self._pitches:
            age_s = now_s - t_s
            if age_s <= 0.25:
                late += pitch_deg
                late_n += 1.0
            elif 0.8 <= age_s <= 1.9:
                early += pitch_deg
                early_n += 1.0
        if not late_n or not early_n:
            return 0.0
        return late / late_n - early / early_n

    def _is_slip(self, observation: Observation, place: Point) -> bool:
        again = hypot(place[0] - self._suspect[0], place[1] - self._suspect[1]) < par("again", 0.5) * self._body_m
        tried = observation.travelled_m - self._suspect_m < par("againm", 1.0)
        if tried:
            self._suspect_m = -1e9
            if again:
                self._walls += 1.0
                return False
            self._slips += 1.0
        if self._rise_deg(observation) >= 1.5 or not observation.anomalies:
            return False
        if (self._slips + 1.0) / (self._slips + self._walls + 2.0) < par("prior", 0.1):
            return False
        self._suspect, self._suspect_m = place, observation.travelled_m
        return True
