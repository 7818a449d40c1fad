"""Finds out without sight that something holds a body which is driven ahead: its heading does not answer steering.

A body that is free follows its wheels. One that pushes at a trunk is turned by it, or held, and the steering towards
the heading that is wanted grows and shows no effect. Ground with much grip takes up some of the steering as well, and a
compass may lag. How much of it remains without an answer on free ground is learnt while the sensor sees motion.
"""

from __future__ import annotations

from math import degrees
from typing import Final

from wayfarer.escape.api import Vehicle
from wayfarer.escape.turn_control import LAG_S
from wayfarer.safety.tick_interval import TickInterval

# The numbers are from no source; they were chosen by measurement in MuJoCo. What was steered, and how far the body
# turned, are leaky sums over this time.
MEMORY_S: Final = 0.8
# Below this share of the turn that was steered, it is no answer.
ANSWER_SHARE: Final = 0.25
# Turn duty without an answer that shows contact: at least the first; this many times what was seen on free ground.
LEAST_DUTY: Final = 0.15
FREE_TIMES: Final = 1.25
# What was seen on free ground is forgotten with this time constant: another ground.
FORGET_S: Final = 60.0
# A turn on the spot is no steering: driving ahead is at least this share of turning.
AHEAD_SHARE: Final = 0.5


class SteeringMonitor:
    """Compares steering with the turn of the body; ``unanswered`` is whether something must hold it.

    Sums are in seconds of full turn duty on ideal ground, clockwise positive.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._ideal_deg_s = degrees(2.0 * vehicle.max_speed_m_s / vehicle.track_m)  # at turn duty 1 on ideal ground
        self._free_duty = 0.0  # without an answer on free ground
        self.begin()

    def begin(self) -> None:
        """Forget what was steered: another manoeuvre begins."""
        self._lagged_duty = self._steered_s = self._turned_s = 0.0
        self.unanswered = False

    def update(self, interval: TickInterval, turned_deg: float, *, moves: bool) -> None:
        """Take in a tick: how far the body turned in it, clockwise positive, and whether it is seen to move."""
        (left, right), dt_s = interval.commanded, interval.dt_s
        if interval.forward_m <= 0.0 or left + right < AHEAD_SHARE * abs(left - right):
            self.begin()
            return
        self._lagged_duty += ((left - right) / 2.0 - self._lagged_duty) * dt_s / (dt_s + LAG_S)
        keep = MEMORY_S / (MEMORY_S + dt_s)
        self._steered_s = (self._steered_s + self._lagged_duty * interval.driven_s) * keep
        self._turned_s = (self._turned_s + turned_deg / self._ideal_deg_s) * keep
        steered_s, turned_s = self._steered_s, self._turned_s
        if steered_s < 0.0:
            steered_s, turned_s = -steered_s, -turned_s
        duty = (steered_s - max(turned_s, 0.0)) / MEMORY_S if turned_s < ANSWER_SHARE * steered_s else 0.0
        if moves:
            self._free_duty = max(duty, self._free_duty * FORGET_S / (FORGET_S + dt_s))
        self.unanswered = duty > LEAST_DUTY and duty > FREE_TIMES * self._free_duty
