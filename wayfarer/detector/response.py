"""Compares what the body does with what the wheels are commanded to do: driving, turns on the spot, steering.

**Driving.** A rover is stuck (a *stall*) if its wheels are driven without motion, or without progress. A body gains
speed no faster than the ground's grip allows, ``gain_m_s2`` at the least, so what it moved is compared with what it
*could* have moved, not with what was commanded:

* **It stands**: over ``immobilised_s`` it moved by less than a share of what was possible from the speed that it had
  before. A body that starts on mud, was reversing a moment ago or continues with spinning wheels does not stand; a
  body that met a wall while moving does, as soon as the window is over.
* **It gets nowhere**: over ``nowhere_s`` it moved by less than that share of what was possible since it was commanded
  to drive this way. It slides along a trunk.

Both are judged by sums over a window, not by single samples, so that one noise count cannot hide a stall and one zero
cannot fake one. There is no result while the rover turns on the spot, just after the command has changed direction, or
while the body still moves in the other direction. **Low quality means unknown, never still**: what was not seen counts
neither as standing nor as driven. The windows are then longer, until enough was seen.

**Turns and steering** show a rover that cannot turn, that turns the wrong way, that something holds:

* **It cannot turn.** A tree, or a branch under the belly, holds a body for a while. Ground with more grip than the
  motors can overcome holds it everywhere. The rover cannot distinguish them, and in both cases more tries do not help.
* **It turns the other way.** On flat ground nothing turns a body far against its own wheels. One that does has its
  motors exchanged, or both wired the wrong way, or a compass that turns the wrong way: then each turn makes its heading
  worse. On a slope of mud a body swings downhill with any command.
* **Its heading does not answer steering**, which shows without sight that something holds a body that is driven ahead.
  A body that is free follows its wheels. One that pushes at a trunk is turned by it, or held, and the steering towards
  the heading that is wanted grows and shows no effect. Ground with much grip takes up some of the steering as well, and
  a compass may lag. How much of it remains without an answer on free ground is learnt while the sensor sees motion.
"""

from __future__ import annotations

from math import radians
from typing import Final

from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.settings import Vehicle
from wayfarer.escape.turn_control import BODY_LAG_S, faded, lagged
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import ROUNDING_S, Moved, TickInterval

# The possible distance must be well above what a sensor shows while the body stands: 4 to 5 standard deviations of a
# PMW3901's counts over 0.3 s, at three times its noise.
SEEN_FROM_M: Final = 0.01
# If a sensor is unsure now and then, the short window grows until it has so many readings that were seen, but not
# beyond this. Chosen by us: three zeros in a row of sure readings are not chance, and 3 s is how long a motor may be
# held (fault catalogue, faults 29 and 58).
LEAST_SEEN: Final = 3
LONGEST_S: Final = 3.0
# A body that turns faster than this in the short window does not stand: its speed ahead has become speed sideways. A
# trunk turns a body by at most 67 degrees per second (measured in MuJoCo, friction 0.3).
TURNS_FROM_DEG_S: Final = 70.0


class StallMonitor:
    """Finds commanded driving that does not move the body; ``found`` says whether it did not for a whole window."""

    def __init__(self, settings: DetectorSettings, vehicle: Vehicle) -> None:
        self._stands_s = settings.immobilised_s - ROUNDING_S
        self._nowhere_s = max(settings.nowhere_s - ROUNDING_S, self._stands_s)
        self._share = settings.immobilised_below
        self._from_m_s = settings.immobilised_from_m_s
        self._gain_m_s2 = settings.gain_m_s2
        self._m_per_deg = radians(vehicle.track_m / 2)
        self._window: list[Moved] = []  # all of it was commanded the same way
        self._way = 1.0  # 1 ahead, -1 back
        self.clear()

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._last_m_s = self._before_last_m_s = 0.0
        self._begin()

    def add(self, moved: Moved) -> None:
        """Judge with what a motion reading shows, and fill in what was possible."""
        last_m_s, driven_s, commanded_m = self._last_m_s, moved.driven_s, moved.commanded_m
        before_m_s = (last_m_s + self._before_last_m_s) / 2  # the mean of two has less noise
        if moved.known and driven_s > 0.0:
            self._before_last_m_s, self._last_m_s = last_m_s, moved.counted_m / driven_s
        if abs(commanded_m) < self._from_m_s * driven_s or driven_s <= 0.0:
            self._begin()
            return
        if commanded_m * self._way < 0.0:
            self._way = -self._way
            self._begin()
            if last_m_s * commanded_m < 0.0 and abs(last_m_s) > abs(before_m_s):
                before_m_s = last_m_s  # still moving in the other direction, and faster than before
        moved.before_m_s = self._way * before_m_s
        if not self._window:
            self._possible_m_s = moved.before_m_s
        moved.gained_m_s = self._gain_m_s2 * moved.straight(self._m_per_deg) * driven_s
        possible_m, self._possible_m_s = _possible(self._possible_m_s, moved)
        moved.possible_m = possible_m if moved.known else 0.0
        self._window.append(moved)
        self._span_s += driven_s
        self._seen += moved.known
        self._counted_m += moved.counted_m
        self._possible_m += moved.possible_m
        while self._span_s - self._window[0].driven_s >= self._nowhere_s:
            oldest = self._window.pop(0)
            self._span_s -= oldest.driven_s
            self._seen -= oldest.known
            self._counted_m -= oldest.counted_m
            self._possible_m -= oldest.possible_m
        enough = self._span_s >= self._nowhere_s and self._seen >= LEAST_SEEN
        nowhere = enough and self._too_little(self._way * self._counted_m, self._possible_m)
        self.found = nowhere or self._stands()

    def _begin(self) -> None:
        """Begin both windows again; the latest speeds are kept."""
        self._window.clear()
        self._seen = 0
        self._span_s = self._counted_m = self._possible_m = self._possible_m_s = 0.0
        self.found = False

    def _stands(self) -> bool:
        """Return whether the body does not move: over the newest intervals that fill the short window."""
        count, seen, span_s, commanded_m, seen_m = 0, 0, 0.0, 0.0, 0.0
        for place in range(len(self._window) - 1, -1, -1):
            moved = self._window[place]
            count += 1
            span_s += moved.driven_s
            if moved.known:
                seen += 1
                commanded_m += moved.commanded_m
                seen_m += moved.counted_m
            if span_s >= self._stands_s and (seen >= LEAST_SEEN or seen == count):
                break
        else:
            return False
        if self._way * seen_m >= self._way * self._share * commanded_m or span_s > LONGEST_S:
            return False  # nearly every tick ends here: what was possible is at most what was commanded
        speed_m_s = self._window[-count].before_m_s
        moved_m = possible_m = slid_m = turned_deg = 0.0
        for place in range(-count, 0):
            moved = self._window[place]
            step_m, speed_m_s = _possible(speed_m_s, moved)
            possible_m += step_m
            turned_deg += moved.turned_deg
            if abs(moved.right_m) >= self._from_m_s * moved.read_s:  # else it is noise
                slid_m += moved.right_m
            # An interval that was not seen counts neither for nor against standing.
            moved_m += self._way * moved.counted_m if moved.known else self._share * step_m
        if abs(turned_deg) > TURNS_FROM_DEG_S * span_s:
            return False
        return self._too_little(max(moved_m, abs(slid_m)), possible_m)  # a body that slides sideways does not stand

    def _too_little(self, moved_m: float, possible_m: float) -> bool:
        return possible_m > SEEN_FROM_M and moved_m < self._share * possible_m


def _possible(speed_m_s: float, moved: Moved) -> tuple[float, float]:
    """Return how far a body of this speed can move in an interval, and its speed then; both at most as commanded."""
    driven_s, commanded_m = moved.driven_s, abs(moved.commanded_m)
    reach_m, reach_m_s = (speed_m_s + moved.gained_m_s / 2) * driven_s, speed_m_s + moved.gained_m_s
    return min(reach_m, commanded_m), min(reach_m_s, commanded_m / driven_s)


# -- turns on the spot -------------------------------------------------------------------------------------------------

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
# Below this share of the turn that was steered, it is not an answer.
ANSWER_SHARE: Final = 0.25
# Turn duty without an answer that shows contact: at least the first; this many times what was seen on free ground.
LEAST_DUTY: Final = 0.15
FREE_TIMES: Final = 1.25
# What was seen on free ground is forgotten with this time constant: another ground.
FORGET_S: Final = 60.0
# A turn on the spot is not steering: driving ahead is at least this share of turning.
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
