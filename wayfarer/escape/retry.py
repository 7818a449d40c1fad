"""Retry-Pledge: Forest-Pledge that tries a second time if a stall may be a slip.

Theory of operation
-------------------
A stall may be a trunk, or wheels that only slip. Forest-Pledge turns away from both. A rover that pushes onto a trunk
raises its nose, so a nose that has risen is an obstacle. A level nose proves nothing: then the rover backs off a
little and drives on as before, the *second try*. If it is stopped again at once, something is there, and it turns away
as Forest-Pledge does. A touch and a tilt are obstacles at once.

There is no second try for a rover that lacks tilt or motion sensor, also if one of them has failed: what pushes and
does not see it climbs until it tips. There is none after a blocked turn either, and none any more once many in a row
have met something. So Retry-Pledge is Forest-Pledge wherever second tries do not help, and stops once more a contact at
most. All choices were made in physics-light: ``docs/explanation/better-escape.md``.
"""

from __future__ import annotations

from collections import deque
from math import inf
from random import Random
from typing import Final

from wayfarer.escape.api import Anomaly, Decision, Observation
from wayfarer.escape.handler import AlgorithmSpec, PhasedHandler
from wayfarer.escape.settings import EscapeSettings, Vehicle

# The nose has risen if its mean over the latest RISEN_S is so much above its mean before the stall; a single reading of
# pitch is too noisy. Measured in physics-light with ForestRover, MiniRover and the abstract rover: this finds 90 to
# 93 % of trunks, and takes 0 to 3 % of slips for one. In MuJoCo, where wheels do not climb, it finds 2 of 800
# (ForestRover, friction 0.4); there the second tries decide.
NOSE_UP_DEG: Final = 1.5
RISEN_S: Final = 0.25
BEFORE_S: Final = (0.8, 1.9)
# Share of the back-off before a second try: every metre backwards is driven twice, and the body needs no room to turn.
BACK_OFF_SHARE: Final = 0.35
# Stopped again within so many back-offs of path, by the motion sensor, is stopped by the same thing: a second try goes
# back and ahead again for 0.7 of one. On the even reference layouts 2 has the same SPL as 3.3 and 6 at slips every
# 10 m, and a higher one at 2 m (0.576, 0.570 and 0.540).
SAME_PLACE: Final = 2.0
# So many second tries in a row that all met something are the last ones. Chosen by us, for other ground than
# physics-light's, where it never happens: in MuJoCo 94 to 100 % of second tries met something, at 0.1 m and 1.2 s each.
MOST_IN_VAIN: Final = 8
# A motion sensor that sees a stall counts centimetres less than what is commanded; one that sees nothing counts the
# same, up to rounding.
ROUNDING_M: Final = 0.001

_STALL: Final = (Anomaly.IMMOBILISED,)


class RetryHandler(PhasedHandler):
    """Decides one tick at a time; implements ``EscapeHandler``."""

    def __init__(self, spec: AlgorithmSpec, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        # Time, pitch, and how much further the wheels were commanded than the body went.
        self._past: deque[tuple[float, float, float]] = deque()
        super().__init__(spec, settings, vehicle, rng)

    def reset(self) -> None:
        """Forget everything; see ``EscapeHandler``."""
        super().reset()
        self._past.clear()
        self._stopped_m = -inf
        self._tried = False
        self._in_vain = 0

    def decide(self, observation: Observation) -> Decision:
        """Return the decision for this tick; see ``EscapeHandler``."""
        past, now_s = self._past, observation.t_s
        past.append((now_s, observation.pitch_deg, observation.travelled_m - observation.covered_m))
        while now_s - past[0][0] > BEFORE_S[1]:
            past.popleft()
        return super().decide(observation)

    def _plan(self, observation: Observation, *, new_episode: bool) -> None:
        """Choose what to do about an anomaly: as Forest-Pledge does, or a second try."""
        super()._plan(observation, new_episode=new_episode)
        escape_plan, covered_m = self._escape_plan, observation.covered_m
        again = covered_m - self._stopped_m <= SAME_PLACE * self._settings.back_off_m
        self._stopped_m = covered_m
        if self._tried:
            self._in_vain = self._in_vain + 1 if again else 0
        spent = again or self._blocked_turns > 0 or self._in_vain >= MOST_IN_VAIN
        self._tried = not spent and self._may_be_slip(observation)
        if self._tried:
            escape_plan.back_off_m *= BACK_OFF_SHARE
            escape_plan.turn_deg = 0.0

    def _may_be_slip(self, observation: Observation) -> bool:
        """Return whether tilt and motion sensor show a stall that leaves the nose level."""
        if observation.anomalies != _STALL or observation.measured_m is None:
            return False
        _, first_deg, first_m = self._past[0]
        late_deg = early_deg = lost_m = 0.0
        late = early = 0
        varies = False  # as a pitch that is measured always does
        for t_s, pitch_deg, without_m in self._past:
            age_s = observation.t_s - t_s
            varies = varies or pitch_deg != first_deg
            lost_m = without_m - first_m
            if age_s <= RISEN_S:
                late_deg, late = late_deg + pitch_deg, late + 1
            elif age_s >= BEFORE_S[0]:
                early_deg, early = early_deg + pitch_deg, early + 1
        if not varies or lost_m < ROUNDING_M:
            return False
        return not early or late_deg / late - early_deg / early < NOSE_UP_DEG
