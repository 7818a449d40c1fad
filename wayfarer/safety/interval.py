"""The interval between two control ticks: its length, and the wheel commands in it. Pure.

It is worked out once a tick. Detector, progress and mission all take it from here, so that none of them counts time in
which nobody drove the wheels.
"""

from __future__ import annotations

from typing import NamedTuple

from wayfarer.hal import WheelCommand


class Interval(NamedTuple):
    """From the previous control tick to this one.

    ``t_s`` is the time of this tick and ``dt_s`` the time since the previous one, 0 at the first. ``driven_s`` is for
    how much of ``dt_s`` the wheels obeyed ``applied``: before a late tick the motor board's deadman has stopped them.
    ``forward_m`` is how far the wheels were told to go in ``driven_s``, in metres, negative in reverse.
    """

    t_s: float
    dt_s: float
    driven_s: float
    applied: WheelCommand
    forward_m: float


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

    def next(self, t_s: float, applied: WheelCommand) -> Interval:
        """Return the interval that ends at the tick at ``t_s``, in which the wheels were told ``applied``."""
        last_t_s = t_s if self._last_t_s is None else self._last_t_s
        self._last_t_s = t_s
        dt_s = t_s - last_t_s
        driven_s = dt_s if dt_s < self._late_s else self._late_s
        left, right = applied
        return Interval(t_s, dt_s, driven_s, applied, (left + right) * self._half_speed_m_s * driven_s)
