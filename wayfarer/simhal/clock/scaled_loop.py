"""An asyncio loop, with sockets, whose time runs faster than the clock, for the demo.

``loop.time()`` goes on ``speed`` times as fast as the clock, from timer to timer. Where the computer is busy or slow,
time falls behind instead of jumping, so that no timer comes late: the rover never finds that its control tick was late
because somebody's browser was starting. A little lost time is made up for by waiting less; the rest is forgotten. So a
simulated world may be asked for any speed, and runs as fast as it can.
"""

from __future__ import annotations

import asyncio
from itertools import count
from selectors import SelectorKey, SelectSelector
from time import monotonic  # noqa: TID251 - the clock that this loop's time is made of

# How far time may go past the next timer in one turn of the loop, seconds of the loop: without any, tasks that never
# wait would stop it for good.
LATE_S = 0.001
CATCH_UP_S = 0.05  # of the clock; more than that was no hiccup
LOOK_S = 1e-8  # more than rounding errors, and less than anything that is timed here


class FastSelector(SelectSelector):
    """Waits for files ``speed`` times shorter than it is asked to; ``now_s`` is the loop's time by then.

    select(2) waits to the microsecond; epoll would round up to a millisecond, which is long at fifty times the speed.
    """

    def __init__(self, speed: float) -> None:
        super().__init__()
        self._speed = speed
        self._lost_s = 0.0  # of the clock
        self.now_s = self._clock_s = monotonic()

    def select(self, timeout: float | None = None) -> list[tuple[SelectorKey, int]]:
        """Wait, at most ``timeout`` seconds of the loop, and let time go on."""
        before_s = monotonic()
        lost_s = min(self._lost_s + before_s - self._clock_s, CATCH_UP_S)
        ready = super().select(None if timeout is None else max(0.0, timeout / self._speed - lost_s))
        self._clock_s = monotonic()
        due_s = (lost_s + self._clock_s - before_s) * self._speed
        passed_s = due_s if timeout is None else min(due_s, timeout + LATE_S)
        self._lost_s = (due_s - passed_s) / self._speed
        self.now_s += passed_s
        return ready


class FastLoop(asyncio.SelectorEventLoop):
    """An event loop whose time runs ``speed`` times as fast as the clock, or as fast as the computer can.

    Args:
        speed: above 0.
    """

    def __init__(self, speed: float) -> None:
        self._fast = FastSelector(speed)
        self._looks = count()
        super().__init__(self._fast)

    def time(self) -> float:
        """Return the loop's time in seconds; it begins where the clock is, and is later at each look.

        Timers for the same time would come in any order: heapq keeps none among equals.
        """
        return self._fast.now_s + next(self._looks) * LOOK_S
