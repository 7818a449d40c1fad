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
from typing import Final

from wayfarer.detector.settings import DetectorSettings
from wayfarer.safety.tick_interval import ROUNDING_S

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


class DrivingInterval:
    """An interval of driving; distances and speeds are positive in the direction that is commanded.

    ``moved_m`` is None if nothing was sure; ``slid_m`` is to the right; ``gained_m_s`` is the speed that grip can
    add in this time; ``possible_m`` is the distance possible in it, calculated from the start of driving this way;
    ``before_m_s`` is the speed of the body before it.
    """

    def __init__(
        self,
        driven_s: float,
        commanded_m: float,
        moved_m: float | None,
        slid_m: float,
        turned_deg: float,
        gained_m_s: float,
        possible_m: float,
        before_m_s: float,
    ) -> None:
        self.driven_s = driven_s
        self.commanded_m = commanded_m
        self.moved_m = moved_m
        self.slid_m = slid_m
        self.turned_deg = turned_deg
        self.gained_m_s = gained_m_s
        self.possible_m = possible_m
        self.before_m_s = before_m_s


class StallMonitor:
    """Finds commanded driving that does not move the body; ``found`` says whether it did not for a whole window."""

    def __init__(self, settings: DetectorSettings) -> None:
        self._stands_s = settings.immobilised_s - ROUNDING_S
        self._nowhere_s = max(settings.nowhere_s - ROUNDING_S, self._stands_s)
        self._share = settings.immobilised_below
        self._from_m_s = settings.immobilised_from_m_s
        self._gain_m_s2 = settings.gain_m_s2
        self._intervals: deque[DrivingInterval] = deque()
        self._ahead = True
        self.clear()

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._last_m_s = self._before_last_m_s = 0.0
        self._begin()

    def add(
        self,
        driven_s: float,
        commanded_m: float,
        moved_m: float | None,
        *,
        turned_deg: float = 0.0,
        straight: float = 1.0,
        slid_m: float = 0.0,
    ) -> None:
        """Add an interval of driving.

        Args:
            driven_s: how long the wheels obeyed.
            commanded_m: how far they were commanded to go, negative in reverse.
            moved_m: how far the body moved ahead, negative in reverse; None if that was not seen.
            turned_deg: how far the body turned.
            straight: the share of the wheels' push that is ahead or back, 0 to 1; the rest of the ground's grip is used
                for turning.
            slid_m: how far the body slid to the right, 0 if that is not clearly seen.
        """
        before_m_s = (self._last_m_s + self._before_last_m_s) / 2  # the mean of two has less noise
        last_m_s = self._last_m_s
        if moved_m is not None and driven_s > 0.0:
            self._before_last_m_s, self._last_m_s = self._last_m_s, moved_m / driven_s
        if abs(commanded_m) < self._from_m_s * driven_s or driven_s <= 0.0:
            self._begin()
            return
        if (commanded_m > 0.0) is not self._ahead:
            self._ahead = not self._ahead
            self._begin()
            if last_m_s * commanded_m < 0.0 and abs(last_m_s) > abs(before_m_s):
                before_m_s = last_m_s  # still moving in the other direction, and faster than before
        if not self._ahead:
            commanded_m, before_m_s, moved_m = -commanded_m, -before_m_s, None if moved_m is None else -moved_m
        if not self._intervals:
            self._possible_m_s = before_m_s
        gained_m_s = self._gain_m_s2 * straight * driven_s
        possible_m, self._possible_m_s = _possible(self._possible_m_s, driven_s, commanded_m, gained_m_s)
        self._intervals.append(
            DrivingInterval(driven_s, commanded_m, moved_m, slid_m, turned_deg, gained_m_s, possible_m, before_m_s)
        )
        self._span_s += driven_s
        if moved_m is not None:
            self._seen += 1
            self._moved_m += moved_m
            self._possible_m += possible_m
        while self._span_s - self._intervals[0].driven_s >= self._nowhere_s:
            self._drop_oldest()
        enough = self._span_s >= self._nowhere_s and self._seen >= LEAST_SEEN
        nowhere = enough and self._too_little(self._moved_m, self._possible_m)
        self.found = nowhere or self._stands()

    def _begin(self) -> None:
        """Begin both windows again; the latest speeds are kept."""
        self._intervals.clear()
        self._seen = 0
        self._span_s = self._moved_m = self._possible_m = self._possible_m_s = 0.0
        self.found = False

    def _drop_oldest(self) -> None:
        """Take the oldest interval out of the long window."""
        oldest = self._intervals.popleft()
        self._span_s -= oldest.driven_s
        if oldest.moved_m is not None:
            self._seen -= 1
            self._moved_m -= oldest.moved_m
            self._possible_m -= oldest.possible_m

    def _stands(self) -> bool:
        """Return whether the body does not move: over the newest intervals that fill the short window."""
        count, seen, span_s, commanded_m, seen_m = 0, 0, 0.0, 0.0, 0.0
        for interval in reversed(self._intervals):
            count += 1
            span_s += interval.driven_s
            if interval.moved_m is not None:
                seen += 1
                commanded_m += interval.commanded_m
                seen_m += interval.moved_m
            if span_s >= self._stands_s and (seen >= LEAST_SEEN or seen == count):
                break
        else:
            return False
        if seen_m >= self._share * commanded_m or span_s > LONGEST_S:
            return False  # nearly every tick ends here: what was possible is at most what was commanded
        speed_m_s = self._intervals[-count].before_m_s
        moved_m = possible_m = slid_m = turned_deg = 0.0
        for place in range(-count, 0):
            interval = self._intervals[place]
            step_m, speed_m_s = _possible(speed_m_s, interval.driven_s, interval.commanded_m, interval.gained_m_s)
            possible_m += step_m
            turned_deg += interval.turned_deg
            slid_m += interval.slid_m
            # An interval that was not seen counts neither for nor against standing.
            moved_m += self._share * step_m if interval.moved_m is None else interval.moved_m
        if abs(turned_deg) > TURNS_FROM_DEG_S * span_s:
            return False
        return self._too_little(max(moved_m, abs(slid_m)), possible_m)  # a body that slides sideways does not stand

    def _too_little(self, moved_m: float, possible_m: float) -> bool:
        return possible_m > SEEN_FROM_M and moved_m < self._share * possible_m


def _possible(speed_m_s: float, driven_s: float, commanded_m: float, gained_m_s: float) -> tuple[float, float]:
    """Return how far a body of this speed can move in an interval, and its speed then; both at most as commanded."""
    reach_m, reach_m_s = (speed_m_s + gained_m_s / 2) * driven_s, speed_m_s + gained_m_s
    commanded_m_s = commanded_m / driven_s
    return (
        reach_m if reach_m < commanded_m else commanded_m,
        reach_m_s if reach_m_s < commanded_m_s else commanded_m_s,
    )
