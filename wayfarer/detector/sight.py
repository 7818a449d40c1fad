"""Doubts a motion sensor whose readings cannot be true: a doubted reading counts as unknown.

* **Zeros on a body that moves.** Below a knee of brightness or texture the PMW3901 family reports exact zeros, often
  with a quality above every useful minimum (PX4 issues 28632 and 28648). Its readings alone cannot tell that from a
  body that a trunk holds. What the wheels do can: a body that is held ahead and behind cannot turn on the spot. One
  that did turn, and was driven ahead and back before, has moved, and its sensor has seen nothing of it.
* **Readings that repeat to the last digit.** A sensor that sees ground that moves has noise on every reading.
* **Readings that start and stop.** A body that is driven one way does not stand in every second reading. Fewer zeros
  than that are frames that the sensor lost (585 of 1,331 in PX4 issue 28632), and the sum over a window is right.
"""

from __future__ import annotations

from math import inf
from typing import Final

from wayfarer.hal import MotionReading
from wayfarer.safety.tick_interval import TickInterval

# Driven so far each way, a free body moves by more than a sensor could overlook: twice what counts as seen in a stall.
DRIVEN_M: Final = 0.1
# Turned so far on the spot: as much as shows that a body can turn (``detector.turnable``).
TURNED_DEG: Final = 9.0
# So many equal readings in a row are no chance: at 5 mm a reading, a PMW3901's noise of 2 counts and more repeats one
# reading in five.
REPEATS: Final = 8
COUNTS_FROM_M: Final = 0.005
# A reading counts as standing below the one share of what was commanded, and as moving above the other. A body that
# met something and came free again stopped once, or twice; one that stops each second, for longer than a stall needs to
# be found, did not. Half of the latest readings must be zeros. From no source.
STANDS_SHARE: Final = 0.1
MOVES_SHARE: Final = 0.3
STOPS_EACH_S: Final = 1.0
STOPS_FOR_S: Final = 2.3
LATEST: Final = 12


class ZeroDoubt:
    """Says whether exact zeros are no longer believed; the first other reading ends the doubt."""

    def __init__(self) -> None:
        self._ahead_m = self._back_m = self._turned_deg = 0.0
        self.doubts = False

    def update(self, interval: TickInterval, turned_deg: float, reading: MotionReading | None) -> None:
        """Take in a tick: the commands before it, how far the body turned meanwhile, and a reading, if there is one."""
        if reading is not None and (reading.forward_m != 0.0 or reading.right_m != 0.0):
            self._ahead_m = self._back_m = self._turned_deg = 0.0
            self.doubts = False
            return
        left, right = interval.commanded
        if left * right < 0.0:
            self._turn(turned_deg)
        elif interval.forward_m > 0.0:
            self._ahead_m += interval.forward_m
        else:
            self._back_m -= interval.forward_m

    def _turn(self, turned_deg: float) -> None:
        """Add up turns that follow driving both ways; a turn that is taken back is still a turn."""
        if self._ahead_m >= DRIVEN_M and self._back_m >= DRIVEN_M:
            self._turned_deg += abs(turned_deg)
            self.doubts = self._turned_deg >= TURNED_DEG


class ReadingDoubt:
    """Says whether readings repeat, or start and stop, as no body does; other readings end the doubt."""

    def __init__(self) -> None:
        self._last_m = self._last_right_m = 0.0
        self._repeats = 0
        self._moved, self._ahead = False, True
        self._stood = 0  # a bit for each of the latest readings, the newest lowest: 1 stood
        self._stops_since_s = self._stopped_s = -inf

    def doubts(self, reading: MotionReading, commanded_m: float) -> bool:
        """Take in a reading, and the distance commanded for it, negative in reverse; return whether it is doubted."""
        t_s, forward_m, right_m, _, _ = reading
        if forward_m != self._last_m or right_m != self._last_right_m or abs(forward_m) < COUNTS_FROM_M:
            self._repeats = 0
        elif commanded_m:
            self._repeats += 1  # wheels that stand must not begin a doubt: motion is a runaway then
        self._last_m, self._last_right_m = forward_m, right_m
        if (commanded_m > 0.0) is not self._ahead:
            self._ahead, self._stopped_s = not self._ahead, -inf
        if abs(commanded_m) >= COUNTS_FROM_M:
            self._count(t_s, abs(forward_m / commanded_m))
        stutters = t_s - self._stopped_s <= STOPS_EACH_S and t_s - self._stops_since_s >= STOPS_FOR_S
        return self._repeats >= REPEATS or (stutters and 2 * self._stood.bit_count() >= LATEST)

    def _count(self, t_s: float, share: float) -> None:
        """Count a reading, as a share of what was commanded for it, as one of a body that stands, or moves."""
        stands = share < STANDS_SHARE
        self._stood = (self._stood << 1 | stands) & ((1 << LATEST) - 1)
        if share >= MOVES_SHARE:
            self._moved = True
        elif self._moved and stands:
            self._moved = False
            if t_s - self._stopped_s > STOPS_EACH_S:
                self._stops_since_s = t_s
            self._stopped_s = t_s
