"""Detects that the rover is stuck (a *stall*): wheels driven without motion, or without progress.

A body gains speed no faster than the ground's grip allows, ``gain_m_s2`` at the least, so what it moved is
compared with what it *could* have moved, not with what was commanded:

* **It stands**: over ``immobilised_s`` it moved by less than a share of what was possible from the speed that it had
  before. A body that starts on mud, was reversing a moment ago or continues with spinning wheels does not stand; a
  body that met a wall while moving does, as soon as the window is over.
* **It gets nowhere**: over ``nowhere_s`` it moved by less than that share of what was possible since it was commanded
  to drive this way. It slides along a trunk.

Both are judged by sums over a window, not by single samples, so that one noise count cannot hide a stall and one zero
cannot fake one. There is no result while the rover turns on the spot, just after the command has changed direction, or
while the body still moves in the other direction. **Low quality means unknown, never still**: what was not seen counts
neither as standing nor as driven. The windows are then longer, until enough was seen.
"""

from __future__ import annotations

from collections import deque
from math import radians
from typing import Final

from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.settings import Vehicle
from wayfarer.safety.tick_interval import ROUNDING_S, Moved

# The possible distance must be well above what a sensor shows while the body stands: 4 to 5 standard deviations of a
# PMW3901's counts over 0.3 s, at three times its noise.
SEEN_FROM_M: Final = 0.01
# If a sensor is unsure now and then, the short window grows until it has so many readings that were seen, but not
# beyond this. Chosen by us: three zeros in a row of sure readings are no chance, and 3 s is how long a motor may be
# held (fault catalogue, faults 29 and 58).
LEAST_SEEN: Final = 3
LONGEST_S: Final = 3.0
# A body that turns faster than this in the short window does not stand: its speed ahead has become speed sideways. A
# trunk turns a body by at most 67 degrees a second (measured in MuJoCo, friction 0.3).
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
        self._window: deque[Moved] = deque()  # all of it was commanded the same way
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
            oldest = self._window.popleft()
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
        for moved in reversed(self._window):
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
