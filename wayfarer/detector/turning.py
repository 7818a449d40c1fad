"""What turns on the spot and steering show: a rover that cannot turn, that turns the wrong way, that something holds.

* **It cannot turn.** A tree, or a branch under the belly, holds a body for a while. Ground with more grip than the
  motors can overcome holds it everywhere. The rover cannot distinguish them, and in both cases more tries do not help.
* **It turns the other way.** On flat ground nothing turns a body far against its own wheels. One that does has its
  motors exchanged, or both wired the wrong way, or a compass that turns the wrong way: then each turn makes its heading
  worse. On a slope of mud a body swings downhill, whatever its wheels do.
* **Its heading does not answer steering**, which shows without sight that something holds a body that is driven ahead.
  A body that is free follows its wheels. One that pushes at a trunk is turned by it, or held, and the steering towards
  the heading that is wanted grows and shows no effect. Ground with much grip takes up some of the steering as well, and
  a compass may lag. How much of it remains without an answer on free ground is learnt while the sensor sees motion.
"""

from __future__ import annotations

from typing import Final

from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.settings import Vehicle
from wayfarer.escape.turn_control import BODY_LAG_S, faded, lagged
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import ROUNDING_S, TickInterval

# What counts as full duty, as a share of the duty that the gate allows: an undervoltage leaves 0.7 of it, and a
# Sabertooth rounds to 127 steps.
FULL_SHARE: Final = 0.65
# In a turn on the spot, driving ahead is at most this share of turning.
AHEAD_SHARE: Final = 0.2
# A body that turned by this much can turn: three times what counts as no turn at all.
TURNS_DEG: Final = 9.0
# A compass that lags shows earlier turns for so long: 0.5 s (``simhal.world.physics.FIELD``), and a body coasts.
SHOWS_LATE_S: Final = 0.7
# Turned so far the other way in one turn on the spot, the wheels do the opposite. The motors' field bends a heading by
# less (``FIELD``: 8 degrees for each side). Chosen by us.
OPPOSES_DEG: Final = 45.0
# So many failed tries in a row are reported; after so many the rover makes no progress, as after that number of
# anomalies in the fault catalogue (fault 57).
TRIES: Final = 3
TRIES_MAX: Final = 12


class TurnabilityMonitor:
    """Counts the tries in a row in which full duty on the spot did not turn the rover, and watches the way it turns.

    Args:
        settings: how long a try is.
        duty_max: the highest duty that the gate allows, above 0 to 1.
    """

    def __init__(self, settings: DetectorSettings, duty_max: float) -> None:
        self._full = FULL_SHARE * duty_max
        self._try_s = settings.cannot_turn_s - ROUNDING_S
        self.reset()

    def reset(self) -> None:
        """Forget all tries."""
        self._found: tuple[Condition, ...] = ()
        self._tries = 0
        self._way = 0.0
        self._from_deg = self._tried_s = 0.0
        self._reversed = False
        self._turning_s = self._shown_from_deg = 0.0

    def update(self, interval: TickInterval, gained_deg: float, *, free: bool) -> tuple[Condition, ...]:
        """Judge a tick.

        Args:
            interval: the wheel commands before it.
            gained_deg: the heading gained since the start of the run, clockwise positive.
            free: whether the ground is flat, and the heading neither in doubt nor reckoned from the commands.
        """
        left, right = interval.left, interval.right
        if self._reversed:
            return (Condition.DRIVE_REVERSED,)
        if not -AHEAD_SHARE <= (left + right) / (left - right or 1.0) <= AHEAD_SHARE:
            self._way = 0.0
            return self._found
        duty = (left - right) / 2.0
        if duty * self._way <= 0.0:
            self._way, self._from_deg, self._tried_s, self._turning_s = duty, gained_deg, 0.0, 0.0
        sign = 1.0 if duty > 0.0 else -1.0
        self._turning_s += interval.driven_s
        if not free or self._turning_s < SHOWS_LATE_S:
            self._shown_from_deg = gained_deg
        self._reversed = sign * (gained_deg - self._shown_from_deg) <= -OPPOSES_DEG
        turned_deg = sign * (gained_deg - self._from_deg)
        if turned_deg >= TURNS_DEG:
            self._found, self._tries = (), 0
            self._from_deg, self._tried_s = gained_deg, 0.0
        elif abs(duty) >= self._full:
            before_s, self._tried_s = self._tried_s, self._tried_s + interval.driven_s
            if before_s < self._try_s <= self._tried_s:
                self._tries += 1
                if self._tries >= TRIES_MAX:
                    self._found, self._tries = (), 0
                    return (Condition.CANNOT_TURN, Condition.ENTRAPPED)
                if self._tries >= TRIES:
                    self._found = (Condition.CANNOT_TURN,)
        return self._found


# -- steering ----------------------------------------------------------------------------------------------------------

# The numbers were chosen by us, by measurement in MuJoCo. What was steered, and how far the body
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
STEERS_AHEAD: Final = 0.5


class SteeringMonitor:
    """Compares steering with the turn of the body; ``unanswered`` is whether something must hold it.

    Sums are in seconds of full turn duty on ideal ground, clockwise positive.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._ideal_deg_s = vehicle.full_turn_deg_s
        self._free_duty = 0.0  # without an answer on free ground
        self.begin()

    def begin(self) -> None:
        """Forget what was steered: another manoeuvre begins."""
        self._lagged_duty = self._steered_s = self._turned_s = 0.0
        self.unanswered = False

    def update(self, interval: TickInterval, turned_deg: float, *, moves: bool) -> None:
        """Take in a tick: how far the body turned in it, clockwise positive, and whether it is seen to move."""
        left, right, dt_s = interval.left, interval.right, interval.dt_s
        if interval.forward_m <= 0.0 or left + right < STEERS_AHEAD * abs(left - right):
            self.begin()
            return
        self._lagged_duty = lagged(self._lagged_duty, (left - right) / 2.0, dt_s, BODY_LAG_S)
        keep = MEMORY_S / (MEMORY_S + dt_s)
        self._steered_s = (self._steered_s + self._lagged_duty * interval.driven_s) * keep
        self._turned_s = (self._turned_s + turned_deg / self._ideal_deg_s) * keep
        steered_s, turned_s = self._steered_s, self._turned_s
        if steered_s < 0.0:
            steered_s, turned_s = -steered_s, -turned_s
        duty = (steered_s - max(turned_s, 0.0)) / MEMORY_S if turned_s < ANSWER_SHARE * steered_s else 0.0
        if moves:
            self._free_duty = max(duty, faded(self._free_duty, dt_s, FORGET_S))
        self.unanswered = duty > LEAST_DUTY and duty > FREE_TIMES * self._free_duty
