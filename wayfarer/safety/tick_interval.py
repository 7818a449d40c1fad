"""The interval between two control ticks, its length and the wheel commands in it, and what must last for ticks. Pure.

It is calculated once a tick. Detector, entrapment and mission all use it, so that none of them counts time in which the
wheels were not driven.
"""

from __future__ import annotations

from typing import Final

from wayfarer.hal import STOP, WheelCommand

# A duration has passed once so little is missing: sums of control periods fall a rounding error short of it.
ROUNDING_S: Final = 1e-6


class TickInterval:
    """From the previous control tick to this one; the first part of the record of a tick.

    ``t_s`` is the time of this tick, ``commanded`` the wheel command before it, and ``dt_s`` the time since the
    previous one, 0 at the first. ``driven_s`` is the part of ``dt_s`` in which the wheels obeyed: before a late tick
    the motor board's deadman has stopped them. ``forward_m`` is how far the wheels were commanded to go in
    ``driven_s``, in metres, negative in reverse.
    """

    # No dataclass: the compiled core would run its ``__init__`` in the interpreter.
    def __init__(
        self,
        t_s: float,
        commanded: WheelCommand = STOP,
        dt_s: float = 0.0,
        driven_s: float = 0.0,
        forward_m: float = 0.0,
    ) -> None:
        self.t_s = t_s
        self.commanded = commanded
        self.dt_s = dt_s
        self.driven_s = driven_s
        self.forward_m = forward_m


class IntervalTimer:
    """Measures the intervals of one run.

    Args:
        late_s: a tick that comes later than this after the previous one is late, in seconds. The deadmen of the boards
            (0.25 s and more) are longer: a late interval counts as driven for this time and no more.
        max_speed_m_s: ground speed of both sides at full duty.
    """

    def __init__(self, late_s: float, max_speed_m_s: float) -> None:
        self._late_s = late_s
        self._half_speed_m_s = max_speed_m_s / 2
        self._last_t_s: float | None = None

    def measure(self, tick: TickInterval) -> None:
        """Fill in the length of the interval that ends at this tick, and the distance commanded in it."""
        last_t_s, self._last_t_s = self._last_t_s, tick.t_s
        if last_t_s is None:
            return
        dt_s = tick.dt_s = tick.t_s - last_t_s
        driven_s = tick.driven_s = dt_s if dt_s < self._late_s else self._late_s
        left, right = tick.commanded
        tick.forward_m = (left + right) * self._half_speed_m_s * driven_s


class Debounce:
    """Holds back a condition until it has lasted for ``for_s``."""

    __slots__ = ("_for_s", "_since_s")

    def __init__(self, for_s: float) -> None:
        self._for_s = for_s - ROUNDING_S
        self._since_s: float | None = None

    def update(self, t_s: float, present: bool) -> bool:
        """Return whether it has been present, without a gap, for long enough."""
        if not present:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = t_s
        return t_s - self._since_s >= self._for_s
