"""Doubts a motion sensor that reports zeros: an optical one that is blind looks like one on a body that stands.

Below a knee of brightness or texture the PMW3901 family reports exact zeros, often with a quality above every useful
minimum (PX4 issues 28632 and 28648). Its readings alone cannot tell that from a body that a trunk holds. What the
wheels do can: a body that is held ahead and behind cannot turn on the spot. One that did turn, and was driven ahead
and back before, has moved, and its sensor has seen nothing of it.
"""

from __future__ import annotations

from typing import Final

from wayfarer.hal import MotionReading
from wayfarer.safety.tick_interval import TickInterval

# Driven so far each way, a free body moves by more than a sensor could overlook: twice what counts as seen in a stall.
DRIVEN_M: Final = 0.1
# Turned so far on the spot: as much as shows that a body can turn (``detector.turnable``).
TURNED_DEG: Final = 9.0


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
        if self._ahead_m >= DRIVEN_M <= self._back_m:
            self._turned_deg += abs(turned_deg)
            self.doubts = self._turned_deg >= TURNED_DEG
