"""Driving that moves nothing.

Immobilised means: over a window of commanded driving, the ground moved by less than a share of what was commanded.
Sums over a window, not single samples, so that one noise count cannot hide a stall and one zero cannot fake one.
Nothing is claimed while the rover turns on the spot, or while the command has just changed direction. A reading of low
quality counts as driven: **low quality means unknown, never still**.
"""

from __future__ import annotations

from collections import deque

from wayfarer.detector.settings import DetectorSettings


class Stall:
    """Finds commanded driving that does not move the ground; ``found`` says whether a whole window of it did not."""

    def __init__(self, settings: DetectorSettings) -> None:
        self._window_s = settings.immobilised_s - 1e-6  # sums of periods fall a rounding error short
        self._share = settings.immobilised_below
        self._from_m_s = settings.immobilised_from_m_s
        self._intervals: deque[tuple[float, float, float]] = deque()
        self.clear()

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._intervals.clear()
        self._span_s = self._commanded_m = self._moved_m = 0.0
        self._ahead = True
        self.found = False

    def add(self, driven_s: float, commanded_m: float, moved_m: float) -> None:
        """Add an interval: how long the wheels obeyed, and how far they were told to go and went (both signed)."""
        if abs(commanded_m) < self._from_m_s * driven_s:
            self.clear()
            return
        if (commanded_m > 0.0) is not self._ahead:
            self.clear()
            self._ahead = commanded_m > 0.0
        self._intervals.append((driven_s, commanded_m, moved_m))
        self._span_s += driven_s
        self._commanded_m += commanded_m
        self._moved_m += moved_m
        while self._span_s - self._intervals[0][0] >= self._window_s:
            driven_s, commanded_m, moved_m = self._intervals.popleft()
            self._span_s -= driven_s
            self._commanded_m -= commanded_m
            self._moved_m -= moved_m
        # Moving the other way (rolling back down a slope) is not moving either.
        share_m = self._share * self._commanded_m
        too_little = self._moved_m < share_m if self._ahead else self._moved_m > share_m
        self.found = too_little and self._span_s >= self._window_s
