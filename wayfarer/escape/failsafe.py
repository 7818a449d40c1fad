"""Fail-safe under another stack's planner: decides when an escape handler drives, and when it returns control.

Pure, as all decision logic here: the other stack calls ``FailSafe.update`` once a control tick with its own compass and
its own word on whether the rover is stuck, and gets None while its planner may drive, else what the wheels must do.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Final

from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase, Vehicle
from wayfarer.hal import STOP
from wayfarer.units import Metres, Seconds

# What the wheels did in a longer time between two calls nobody knows; as ``SafetySettings.tick_late_s``.
GAP_MAX_S: Final = 0.2
NO_HEADING: Final = Decision(STOP, Phase.HALT, "no_heading")

_STUCK: Final = (Anomaly.IMMOBILISED,)


class FailSafe:
    """Takes the wheels from a planner that is stuck or blind, and gives them back once the rover is free.

    Free means: the handler's last episode is over, and it has followed the goal freely for a *free run* since. One that
    took over for blindness alone, and met nothing, gives back as soon as the planner sees again. A planner that is
    stuck again within ``relapse_s`` has steered back to where it was freed from: its next free run is twice as long.

    Args:
        handler: the algorithm at work, made by a row of the catalogue that needs no contact sensor. It restarts at
            each takeover: what the planner did with the wheels is not its to count.
        vehicle: the body; ``max_speed_m_s`` turns duties into commanded distance.
        free_run_m: the first free run, metres commanded ahead.
        free_run_max_m: the longest one.
        relapse_s: so long after having the wheels back, in seconds, a planner that gets stuck met something new.
    """

    def __init__(
        self, handler: EscapeHandler, vehicle: Vehicle, *,
        free_run_m: Metres = 1.0, free_run_max_m: Metres = 16.0, relapse_s: Seconds = 10.0,
    ) -> None:  # fmt: skip
        self._handler = handler
        self._half_speed_m_s = vehicle.max_speed_m_s / 2
        self._first_run_m, self._longest_run_m, self._relapse_s = free_run_m, free_run_max_m, relapse_s
        self._run_m = free_run_m
        self._decision: Decision | None = None
        self._last_t_s = self._given_back_t_s = -inf
        self._time_s = self._travelled_m = 0.0
        self._followed_from_m = 0.0

    @property
    def drives(self) -> bool:
        """Whether the wheels are the handler's."""
        return self._decision is not None

    def update(
        self, t_s: float, heading_deg: float, goal_heading_deg: float, *, stuck: bool, blind: bool = False
    ) -> Decision | None:
        """Return None while the planner may drive, else the decision for this tick; never raises.

        Args:
            t_s: time of this tick, seconds on a clock that never goes back; at the same time the answer is the same.
            heading_deg: degrees clockwise, any number of turns. While it is not finite the handler's wheels stand.
            goal_heading_deg: where the way out lies, from the same north.
            stuck: whether the rover is commanded to drive now and does not move, or tilts, or touches something. It
                must be False again as soon as that is over: the handler takes it for news.
            blind: whether the planner has nothing to plan with.
        """
        dt_s = t_s - self._last_t_s
        if not dt_s > 0.0:
            return self._decision
        self._last_t_s = t_s
        if self._decision is None and (stuck or blind):
            self._take_over(t_s, stuck=stuck)
        if self._decision is not None:
            self._advance(min(dt_s, GAP_MAX_S), self._decision)
            self._decision = self._decide(heading_deg, goal_heading_deg, stuck=stuck)
            if not (stuck or blind) and self._is_free(self._decision):
                self._decision, self._given_back_t_s = None, t_s
        return self._decision

    def _take_over(self, t_s: float, *, stuck: bool) -> None:
        if stuck:
            relapsed = t_s - self._given_back_t_s < self._relapse_s
            self._run_m = min(self._run_m * 2, self._longest_run_m) if relapsed else self._first_run_m
        self._followed_from_m = -inf  # nothing to be free from yet
        self._handler.reset()
        self._decision = NO_HEADING

    def _advance(self, dt_s: float, last: Decision) -> None:
        """Count the handler's own time and the distance that it commanded; standing blind of the heading is neither."""
        if last is not NO_HEADING:
            left, right = last.wheels
            self._time_s += dt_s
            self._travelled_m += abs(left + right) * self._half_speed_m_s * dt_s

    def _decide(self, heading_deg: float, goal_heading_deg: float, *, stuck: bool) -> Decision:
        if not isfinite(heading_deg + goal_heading_deg):
            return NO_HEADING
        decision = self._handler.decide(
            Observation(
                t_s=self._time_s,
                heading_deg=heading_deg % 360.0,
                pitch_deg=0.0,
                roll_deg=0.0,
                anomalies=_STUCK if stuck else (),
                contact=None,
                goal_heading_deg=goal_heading_deg % 360.0,
                travelled_m=self._travelled_m,
            )
        )
        if decision.phase is not Phase.FOLLOW:
            self._followed_from_m = self._travelled_m
        return decision

    def _is_free(self, decision: Decision) -> bool:
        return decision.phase is Phase.FOLLOW and self._travelled_m - self._followed_from_m >= self._run_m
