"""The handler of Memory-Pledge: the phases of all algorithms, with a planned heading in the place of the goal's."""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians, sin
from random import Random
from typing import Final

from wayfarer.angles import wrap180
from wayfarer.escape import policies
from wayfarer.escape.api import ContactMap, EscapeSettings, Observation, Phase, Vehicle
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.manoeuvres import Follow
from wayfarer.escape.memory.fallback import Fallback
from wayfarer.escape.memory.obstacle_map import ObstacleMap, Point
from wayfarer.escape.memory.reckoning import Reckoning
from wayfarer.escape.memory.route import find_way
from wayfarer.escape.memory.slip import SlipClassifier
from wayfarer.escape.phases import PLANNED, PLEDGE

# A waypoint is reached within this, in widths of the body.
REACHED: Final = 0.4
# The way is planned again after so much path, because the rover has left its line.
PLAN_EVERY_M: Final = 1.0
# What was driven over is looked at in pieces as long as this, in widths: shorter ones cannot cross a line clearly.
SWEEP: Final = 2.0
# A goal heading that has turned by less is the same goal, and the map stays: other software may compute it each tick.
SAME_GOAL_DEG: Final = 5.0
# After a turn that something stopped, the rover drives this far as it stands, in widths.
SHORT_STRIDE: Final = 0.75

# Shares of the rover file's measures: Pledge as the fallback turns by 40 degrees in place of 30, and probes after half
# the straight on a wider arc. These were best for Forest-Pledge with second tries. A crowd has no second tries, and the
# measures of the file.
PLEDGE_TURN: Final = 1.33
PLEDGE_STRAIGHT: Final = 0.5
PLEDGE_RADIUS: Final = 1.17

_SPEC: Final = AlgorithmSpec(PLEDGE, policies.clockwise, policies.fixed_angle, keeps_side=True)


class MemoryHandler(PhasedHandler):
    """Decides one tick at a time; implements ``EscapeHandler`` and ``Remembers``."""

    def __init__(self, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        width_m = self._width_m = vehicle.width_m
        self._map = ObstacleMap(width_m, settings.memory_reach_m, settings.memory_link_m, settings.memory_forget_m)
        self._reckoning = Reckoning(settings.cruise_m_s)
        self._slips = SlipClassifier(width_m)
        self._fallback = Fallback(width_m, settings.memory_contacts)
        self.changes = 0
        super().__init__(_SPEC, settings, vehicle, rng)

    def reset(self) -> None:
        """Forget everything; see ``EscapeHandler``."""
        super().reset()
        self._goal_deg: float | None = None
        self._reckoning.reset()
        self._forget()

    def _forget(self) -> None:
        """Forget the map: its places are along a goal heading that is no longer."""
        self._map.trunks = []
        self._slips.reset()
        self._fallback.reset()
        self._transitions = PLANNED
        self._way: list[Point] = []
        self._path_m = self._planned_m = 0.0
        self._swept: Point | None = None
        self.changes += 1

    def contact_map(self) -> ContactMap:
        """Return what is remembered and planned; see ``Remembers``."""
        trunks = []
        for trunk in self._map.trunks:
            points = self._map.line(trunk)
            belief = self._map.belief(trunk, self._path_m)
            for i in range(len(points) - 1):
                trunks.append((*points[i], *points[i + 1], belief))
        mode = "pledge" if self._fallback.pledge else "plan"
        return ContactMap(*self._place(), tuple(trunks), tuple(self._way), mode)

    def _aim(self, observation: Observation) -> Observation:
        """Return the observation with the heading of the way in the place of the goal heading."""
        goal_deg = self._goal_deg
        if goal_deg is None or abs(wrap180(observation.goal_heading_deg - goal_deg)) > SAME_GOAL_DEG:
            if goal_deg is not None:
                self._forget()
            goal_deg = self._goal_deg = observation.goal_heading_deg
        self._path_m = observation.travelled_m
        self._reckoning.follow(observation._replace(goal_heading_deg=goal_deg), self._manoeuvre.phase)
        self._slips.follow(observation)
        self._fallback.advance(self._reckoning.ahead_m)
        self._sweep()
        if self._fallback.pledge:
            return observation
        if self._manoeuvre.phase is Phase.FOLLOW and self._way:
            self._keep_way(observation)
        if not self._way:
            return observation
        return observation._replace(goal_heading_deg=(goal_deg + self._bearing_deg(self._place())) % 360.0)

    def _keep_way(self, observation: Observation) -> None:
        """Plan again at a waypoint, and now and then on the way to it."""
        (to_a, to_r), (a, r) = self._way[0], self._place()
        if hypot(to_a - a, to_r - r) < REACHED * self._width_m or self._path_m - self._planned_m > PLAN_EVERY_M:
            changes = self.changes
            self._find_way((a, r))
            if self.changes != changes:
                assert isinstance(self._manoeuvre, Follow)
                self._manoeuvre.allow_turn(observation)  # else a turn at a waypoint could count as one that is held

    def _find_way(self, start: Point) -> None:
        self._planned_m = self._path_m
        way = find_way(start, self._map.waypoints(), self._map.barriers(self._path_m))
        if way != self._way:
            self._way = way
            self.changes += 1

    def _bearing_deg(self, start: Point) -> float:
        """Return the direction of the way at a place, degrees clockwise of the goal heading."""
        if not self._way:
            return 0.0
        a, r = self._way[0]
        return degrees(atan2(r - start[1], a - start[0]))

    def _sweep(self) -> None:
        """Free what was driven over."""
        place = self._place()
        if self._swept is None:
            self._swept = place
        elif hypot(place[0] - self._swept[0], place[1] - self._swept[1]) >= SWEEP * self._width_m:
            if self._map.drive(self._swept, place):
                self.changes += 1
            self._swept = place

    def _plan(self, observation: Observation, *, new_episode: bool) -> None:
        """Choose what to do about an anomaly: a second try, or a contact to remember and a way around it."""
        super()._plan(observation, new_episode=new_episode)
        if self._manoeuvre.phase is Phase.TURN_AWAY:
            return  # something holds the body: turn to alternate sides, as the other algorithms do
        assert self._goal_deg is not None  # it is known since the first tick
        self._reckoning.take_back_stall()
        escape_plan, place = self._escape_plan, self._place()
        bearing_deg = observation.heading_deg - self._goal_deg
        if not self._fallback.crowd and self._slips.is_slip(observation, place):
            self._follow_pledge()
            escape_plan.back_off_m *= self._settings.memory_retry_back_off
            escape_plan.turn_deg = 0.0
            return
        course = cos(radians(bearing_deg)), sin(radians(bearing_deg))
        self._map.add(place, course, self._path_m)
        self._swept = None
        self.changes += 1
        self._choose_driver()
        if self._fallback.pledge:
            self._follow_pledge()
            return
        back_m = escape_plan.back_off_m
        start = place[0] - back_m * course[0], place[1] - back_m * course[1]
        self._find_way(start)
        turn_deg = wrap180(self._bearing_deg(start) - bearing_deg)
        escape_plan.side = self._side = policies.CLOCKWISE if turn_deg >= 0.0 else policies.COUNTER_CLOCKWISE
        escape_plan.turn_deg = abs(turn_deg)
        escape_plan.stride_m = SHORT_STRIDE * self._width_m

    def _follow_pledge(self) -> None:
        """Set how Pledge drives: in a crowd by the rules and measures of Forest-Pledge, else by its own."""
        escape_plan = self._escape_plan
        escape_plan.resets = self._fallback.crowd
        if not escape_plan.resets:
            escape_plan.turn_deg *= PLEDGE_TURN
            escape_plan.straight_m *= PLEDGE_STRAIGHT
            escape_plan.radius_m *= PLEDGE_RADIUS

    def _choose_driver(self) -> None:
        """Let plan or Pledge drive on from this contact; Pledge begins with a fresh counter."""
        before = self._fallback.pledge
        self._fallback.meet(self._path_m)
        if self._fallback.pledge is not before:
            self._transitions = PLEDGE if self._fallback.pledge else PLANNED
            self._escape_plan.counter_deg = 0.0
            self._way = []

    def _place(self) -> Point:
        return self._reckoning.ahead_m, self._reckoning.right_m
