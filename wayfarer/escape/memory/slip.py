"""Tells an obstacle from wheels that only slip.

Only a stall may be a slip: a touch and a tilt are none. Two signs are used. A rover that pushes onto a trunk raises its
nose; this proves an obstacle. A level nose proves nothing: trees, and trunks in other physics, leave it level. Then a
*second try* decides: the rover backs off a little and drives on as before. If it is stopped again at the same place,
something is there. A second try costs time and path, so it is left out where all of them so far have met something.

A rover whose motion sensor sees nothing is told of a stall every few metres (``MotionMonitor.stride_over``), also on
free ground. A second try drives on there, until the nose rises; at what leaves the nose level, the blind detour of the
ladder gets it away. To take each such stall for an obstacle was worse: 2 of 5 trials escaped, 5 of 5 by second tries.
Without the tilt as well there is no second try: what pushes and sees nothing climbs until it tips (4 of 10 trials).
"""

from __future__ import annotations

from collections import deque
from math import hypot, inf
from typing import Final

from wayfarer.escape.api import Anomaly, Observation
from wayfarer.escape.memory.obstacle_map import Point

# The nose has risen if its mean over the latest RISEN_S is so much above its mean before the stall; a single reading of
# pitch is too noisy. Measured in physics-light with ForestRover, MiniRover and the abstract rover: this finds 90 to
# 93 % of trunks, and takes 0 to 3 % of slips for one. In MuJoCo, where wheels do not climb, it finds 2 of 800
# (ForestRover, friction 0.4); there the second tries decide.
NOSE_UP_DEG: Final = 1.5
RISEN_S: Final = 0.25
BEFORE_S: Final = (0.8, 1.9)
# Stopped again so near to the first place, in widths of the body, is stopped by the same thing. The first stop was a
# slip once the rover has covered so much path since then. The commanded path does not count: wheels may spin at a trunk
# for as long. A stop in between says nothing: the rover may have slid along a trunk.
SAME_PLACE: Final = 0.5
PASSED_M: Final = 1.0
# Where nothing measures distance, a rover that pushes seems to drive: stopped again within so much commanded path is
# the same place. At 1 m/s this is the bound of faults 29 and 58 for a held motor, 3 s.
UNMEASURED_M: Final = 3.0
# A motion sensor that sees nothing counts what is commanded, up to rounding; one that sees a stall counts centimetres
# less.
ROUNDING_M: Final = 0.001
# Second tries are left out if the share of slips among those so far (Laplace's rule of succession) is below this: after
# eight that all met something. The next slip that is driven over does not count then.
LEAST_SHARE: Final = 0.1

_STALL: Final = (Anomaly.IMMOBILISED,)


class SlipClassifier:
    """Decides at each anomaly; ``slips`` and ``obstacles`` count how the second tries ended."""

    def __init__(self, width_m: float) -> None:
        self._same_place_m = SAME_PLACE * width_m
        self.reset()

    def reset(self) -> None:
        """Forget all: a new mission begins."""
        self.slips = self.obstacles = 0
        self._tried: Point | None = None
        self._tried_m = -inf
        # Time, pitch, and how much further the wheels were commanded than the body went.
        self._past: deque[tuple[float, float, float]] = deque()

    def follow(self, observation: Observation) -> None:
        """Take in a tick."""
        past, now_s = self._past, observation.t_s
        past.append((now_s, observation.pitch_deg, observation.travelled_m - observation.covered_m))
        while now_s - past[0][0] > BEFORE_S[1]:
            past.popleft()
        passed_m = UNMEASURED_M if observation.measured_m is None else PASSED_M
        if self._tried is not None and observation.covered_m - self._tried_m > passed_m:
            self._tried = None
            self.slips += 1

    def is_slip(self, observation: Observation, place: Point) -> bool:
        """Return whether the wheels may only have slipped at this place, so that a second try is worth it."""
        tried, self._tried = self._tried, None
        if tried is not None and (
            hypot(place[0] - tried[0], place[1] - tried[1]) < self._same_place_m or observation.measured_m is None
        ):
            self.obstacles += 1
            return False
        if observation.anomalies != _STALL or self.risen_deg(observation.t_s) >= NOSE_UP_DEG:
            return False  # without an anomaly, something held the body while it turned
        if observation.measured_m is not None and self._blind(observation.t_s):
            return False
        if (self.slips + 1) / (self.slips + self.obstacles + 2) < LEAST_SHARE:
            return False
        self._tried, self._tried_m = place, observation.covered_m
        return True

    def _blind(self, now_s: float) -> bool:
        """Return whether neither motion sensor nor tilt tells of the stall; a pitch that is measured always varies."""
        recent = [(pitch_deg, lost_m) for t_s, pitch_deg, lost_m in self._past if now_s - t_s <= RISEN_S]
        if len(recent) < 3:
            return False  # too few to tell
        first_deg, first_m = recent[0]
        return all(pitch_deg == first_deg and lost_m - first_m < ROUNDING_M for pitch_deg, lost_m in recent)

    def risen_deg(self, now_s: float) -> float:
        """Return how far the nose has risen since before the stall."""
        late_deg = early_deg = 0.0
        late = early = 0
        for t_s, pitch_deg, _ in self._past:
            age_s = now_s - t_s
            if age_s <= RISEN_S:
                late_deg, late = late_deg + pitch_deg, late + 1
            elif BEFORE_S[0] <= age_s <= BEFORE_S[1]:
                early_deg, early = early_deg + pitch_deg, early + 1
        return late_deg / late - early_deg / early if late and early else 0.0
