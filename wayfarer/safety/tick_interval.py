"""The interval between two control ticks, that between two motion readings, and what must last for ticks. Pure.

Each is made once. Detector, progress and mission all use it, so that none of them counts time in which the wheels
were not driven, or believes a reading that another one does not.
"""

from __future__ import annotations

from math import hypot, inf
from typing import Final

from wayfarer.angles import clamp
from wayfarer.hal import STOP, WheelCommand

# A duration has passed once so little is missing: sums of control periods fall a rounding error short of it.
ROUNDING_S: Final = 1e-6
# A motion reading counts for at most this share of the distance commanded for it or for the one before (a body rolls
# on), so that single wild readings cannot hide a stall. A tenth is for noise.
MOST_SHARE: Final = 1.1


class TickInterval:
    """From the previous control tick to this one; the first part of the record of a tick.

    ``t_s`` is the time of this tick, ``commanded`` the wheel command before it (``left`` and ``right`` are its duties),
    and ``dt_s`` the time since the previous one, 0 at the first. ``driven_s`` is the part of ``dt_s`` in which the
    wheels obeyed: before a late tick the motor board's deadman has stopped them. ``forward_m`` is how far the wheels
    were commanded to go in ``driven_s``, in metres, negative in reverse.
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
        self.left, self.right = commanded.left, commanded.right
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
        self._last_t_s = -inf

    def measure(self, tick: TickInterval) -> None:
        """Fill in the length of the interval that ends at this tick, and the distance commanded in it."""
        last_t_s, self._last_t_s = self._last_t_s, tick.t_s
        if last_t_s == -inf:
            return
        dt_s = tick.dt_s = tick.t_s - last_t_s
        driven_s = tick.driven_s = dt_s if dt_s < self._late_s else self._late_s
        tick.forward_m = (tick.left + tick.right) * self._half_speed_m_s * driven_s


class Moved:
    """From one reading of the motion sensor to the next: what the wheels were commanded to do, and what was seen of it.

    There is one per reading. While the sensor is silent there is one per tick, of which nothing is known. Metres are
    positive ahead and to the right, degrees clockwise.

    * Commanded: ``commanded_m`` ahead, less what was commanded back; ``way_m`` both added; ``pushed_m`` the mean way of
      the sides, in any direction; ``led_m`` how much further the left side went than that of the body's middle.
    * ``driven_s``: how long the wheels obeyed, of the time between the two readings.
    * Seen: ``turned_deg`` by the heading; ``forward_m`` and ``right_m`` by the sensor if it is ``known``, else 0. A
      sensor that sees no direction is not ``signed``: ``forward_m`` then has the sign of the wheels. ``counted_m`` is
      ``forward_m``, up to ``most_m`` if anything was commanded; ``read_s`` is the time between the readings.
    * Possible, as ``StallMonitor`` fills it in, positive in the direction that is commanded: ``before_m_s`` the speed
      before, ``gained_m_s`` what the ground's grip adds to it, ``possible_m`` how far a body comes that has been free
      since the wheels were commanded this way, 0 if what was seen is not ``known``.
    """

    def __init__(self, before_m: float = 0.0) -> None:
        self.commanded_m = self.way_m = self.pushed_m = self.led_m = self.turned_deg = 0.0
        self.undriven_s = self.driven_s = self.read_s = 0.0
        self.known, self.signed = False, True
        self.forward_m = self.right_m = self.counted_m = 0.0
        self.before_m_s = self.gained_m_s = self.possible_m = 0.0
        self._before_m = before_m  # ``way_m`` of the one before
        self.most_m = MOST_SHARE * before_m  # the most that a reading counts for

    def drive(self, tick: TickInterval, turned_deg: float, max_speed_m_s: float) -> None:
        """Add a tick, and how far the body turned in it."""
        left, right = tick.left, tick.right
        half_m = max_speed_m_s / 2 * tick.driven_s
        self.commanded_m += tick.forward_m
        self.way_m += abs(tick.forward_m)
        self.most_m = MOST_SHARE * max(self.way_m, self._before_m)
        self.pushed_m += (abs(left) + abs(right)) * half_m
        self.led_m += (left - right) * half_m
        self.turned_deg += turned_deg
        self.undriven_s += tick.dt_s - tick.driven_s

    def see(self, forward_m: float, right_m: float, *, signed: bool) -> None:
        """Take what the sensor saw, which may be believed."""
        self.known, self.signed, self.right_m = True, signed, right_m
        if not signed and self.commanded_m < 0.0:
            forward_m = -forward_m
        self.forward_m = forward_m
        self.counted_m = clamp(forward_m, -self.most_m, self.most_m) if self.commanded_m else forward_m

    def straight(self, m_per_deg: float) -> float:
        """Return the share of the wheels' push that was ahead or back, 0 to 1; the rest of the grip was for turning.

        ``m_per_deg`` is how far a side goes for each degree of a turn on the spot.
        """
        turned_m = self.turned_deg * m_per_deg
        if abs(self.led_m - turned_m) > abs(self.commanded_m - self.forward_m):
            return 0.0  # one side's wheels slip ahead, the other's back: their friction cancels out
        return abs(self.commanded_m) / hypot(self.pushed_m, turned_m) if self.commanded_m else 1.0


class ReadingInterval:
    """Follows what is commanded from one reading of a sensor to the next; ``_next`` has begun at ``_begun_t_s``.

    After a silence that is later than the last reading.
    """

    def __init__(self, max_speed_m_s: float) -> None:
        self._max_speed_m_s = max_speed_m_s
        self._next = Moved()
        self._begun_t_s = 0.0

    def start(self, t_s: float) -> None:
        """Begin now."""
        self._begun_t_s = t_s

    def _close(self, t_s: float) -> Moved:
        """End an interval, and begin the next."""
        moved = self._next
        self._next = Moved(moved.way_m)
        lasted_s, self._begun_t_s = t_s - self._begun_t_s, t_s
        # A reading may be older than the gap that the tick saw: then nothing is known to have been driven.
        moved.driven_s = lasted_s - moved.undriven_s if moved.undriven_s < lasted_s else 0.0
        return moved


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
