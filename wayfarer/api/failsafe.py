"""Fail-safe under another stack's planner: decides when an escape handler drives, and when it returns control.

Pure, as all decision logic here. The other stack calls ``FailSafe.update`` once a control tick, with its own heading
and its own finding whether the rover is stuck. It gets None while its planner may drive, else the decision for the
wheels.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Final

from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import STOP
from wayfarer.safety.settings import SafetySettings
from wayfarer.setting_ranges import Metres, Seconds

# A longer time between two calls counts as this, because what the wheels did in it is unknown.
GAP_MAX_S: Final = SafetySettings().tick_late_s
NO_HEADING: Final = Decision(STOP, Phase.HALT, "no_heading")

_STUCK: Final = (Anomaly.IMMOBILISED,)


class FailSafe:
    """Takes the wheels from a planner that is stuck or blind, and gives them back once the rover is free.

    The rover is free when the handler's last episode is over and it has then followed the goal for a *free run*, a
    distance without an anomaly. If the handler took over only because the planner was blind, and met nothing, it gives
    the wheels back as soon as the planner sees again. A planner that is stuck again within ``relapse_s`` has steered
    back to the same place: the next free run is twice as long.

    Args:
        handler: an escape handler, made by a row of the catalogue that needs no contact sensor. It restarts at each
            takeover, because it does not know what the planner did with the wheels.
        vehicle: the body; ``max_speed_m_s`` converts duties into commanded distance.
        free_run_m: the first free run, metres commanded.
        free_run_max_m: the longest one.
        relapse_s: seconds after the wheels were given back; a planner that gets stuck later has met something new.

    >>> vehicle = Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2)
    >>> failsafe = FailSafe(make_handler("forest-pledge", vehicle=vehicle), vehicle)
    >>> print(failsafe.update(0.0, heading_deg=10.0, goal_heading_deg=0.0, stuck=False))
    None
    >>> failsafe.update(0.05, heading_deg=10.0, goal_heading_deg=0.0, stuck=True).phase.value
    'back_off'
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
        """Whether the handler drives now."""
        return self._decision is not None

    def update(
        self, t_s: float, heading_deg: float, goal_heading_deg: float, *, stuck: bool, blind: bool = False
    ) -> Decision | None:
        """Return None while the planner may drive, else the decision for this tick; never raises.

        Args:
            t_s: time of this tick, seconds on a clock that never goes back; at the same time the answer is the same.
            heading_deg: degrees clockwise, any number of turns. While it is not finite, the handler stops the wheels.
            goal_heading_deg: the heading of the way out, from the same north.
            stuck: whether the rover is commanded to drive now and does not move, or tilts, or touches something. It
                must be False as soon as that is over, because the handler takes it as a new anomaly.
            blind: whether the planner has no data to plan with.
        """
        dt_s = t_s - self._last_t_s
        if not dt_s > 0.0:
            return self._decision
        self._last_t_s = t_s
        if self._decision is None:
            if not (stuck or blind):
                return None
            if stuck:
                relapsed = t_s - self._given_back_t_s < self._relapse_s
                self._run_m = min(self._run_m * 2, self._longest_run_m) if relapsed else self._first_run_m
            self._followed_from_m = -inf  # nothing to be free from yet
            self._handler.reset()
        elif self._decision is not NO_HEADING:  # waiting for a heading counts neither as time nor as distance
            (left, right), dt_s = self._decision.wheels, min(dt_s, GAP_MAX_S)
            self._time_s += dt_s
            self._travelled_m += abs(left + right) * self._half_speed_m_s * dt_s
        decision = NO_HEADING
        if isfinite(heading_deg + goal_heading_deg):
            anomalies = _STUCK if stuck else ()
            decision = self._handler.decide(
                Observation(
                    self._time_s,
                    heading_deg % 360.0,
                    0.0,
                    0.0,
                    anomalies,
                    None,
                    goal_heading_deg % 360.0,
                    self._travelled_m,
                )
            )
            if decision.phase is not Phase.FOLLOW:
                self._followed_from_m = self._travelled_m
        self._decision = decision
        is_free = decision.phase is Phase.FOLLOW and self._travelled_m - self._followed_from_m >= self._run_m
        if is_free and not (stuck or blind):
            self._decision, self._given_back_t_s = None, t_s
        return self._decision
