"""An asyncio loop, with sockets, whose time runs faster than the clock or stands still, for the demo.

``loop.time()`` goes on ``TimeScale.speed`` times as fast as the clock, from timer to timer. Where the computer is busy
or slow, time falls behind instead of jumping, so that no timer comes late: the rover never finds that its control tick
was late because somebody's browser was starting. A little lost time is made up for by waiting less; the rest is
forgotten. So a simulated world may be asked for any speed, and runs as fast as it can.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from selectors import SelectorKey, SelectSelector
from time import monotonic  # noqa: TID251 - the clock that this loop's time is made of
from typing import TypeVarTuple, Unpack

Ts = TypeVarTuple("Ts")

# How far time may go past the next timer in one turn of the loop, seconds of the loop: without any, tasks that never
# wait would stop it for good.
LATE_S = 0.001
CATCH_UP_S = 0.05  # of the clock; more than that was no hiccup
LOOK_S = 1e-8  # more than rounding errors, and less than anything that is timed here


@dataclass(slots=True)
class TimeScale:
    """How fast the time of a loop goes; any thread may change it.

    ``speed`` is above 0. While ``paused``, time stands still: callbacks from other threads and signals run, timers do
    not. A loop that waits looks at it again when it is woken: ``ScaledLoop.look_at_time_scale``.
    """

    speed: float
    paused: bool = False


class ScaledSelector(SelectSelector):
    """Waits for files ``speed`` times shorter than it is asked to; ``now_s`` is the loop's time by then.

    select(2) waits to the microsecond; epoll would round up to a millisecond, which is long at fifty times the speed.
    """

    def __init__(self, time_scale: TimeScale) -> None:
        super().__init__()
        self._time_scale = time_scale
        self._lost_s = 0.0  # of the clock
        self.now_s = self._clock_s = monotonic()

    def select(self, timeout: float | None = None) -> list[tuple[SelectorKey, int]]:
        """Wait, at most ``timeout`` seconds of the loop, and let time continue."""
        return self._stand_still(timeout) if self._time_scale.paused else self._go_on(timeout, self._time_scale.speed)

    def _go_on(self, timeout: float | None, speed: float) -> list[tuple[SelectorKey, int]]:
        before_s = monotonic()
        lost_s = min(self._lost_s + before_s - self._clock_s, CATCH_UP_S)
        ready = super().select(None if timeout is None else max(0.0, timeout / speed - lost_s))
        self._clock_s = monotonic()
        due_s = (lost_s + self._clock_s - before_s) * speed
        passed_s = due_s if timeout is None else min(due_s, timeout + LATE_S)
        self._lost_s = (due_s - passed_s) / speed
        self.now_s += passed_s
        return ready

    def _stand_still(self, timeout: float | None) -> list[tuple[SelectorKey, int]]:
        """Wait for files only, or not at all where callbacks are ready."""
        ready = super().select(0.0 if timeout is not None and timeout <= 0.0 else None)
        self._clock_s, self._lost_s = monotonic(), 0.0
        return ready


class ScaledLoop(asyncio.SelectorEventLoop):
    """An event loop whose time runs as fast as its time scale says, or as fast as the computer can."""

    def __init__(self, time_scale: TimeScale) -> None:
        self._time_scale = time_scale
        self._scaled_selector = ScaledSelector(time_scale)
        self._looks = count()
        super().__init__(self._scaled_selector)

    def time(self) -> float:
        """Return the loop's time in seconds; it begins where the clock is, and is later at each look.

        Timers for the same time would come in any order: heapq keeps none among equals.
        """
        return self._scaled_selector.now_s + next(self._looks) * LOOK_S

    def look_at_time_scale(self) -> None:
        """Wake the loop after a change of its time scale, from any thread."""
        self.call_soon_threadsafe(lambda: None)

    def add_signal_handler(self, sig: int, callback: Callable[[Unpack[Ts]], object], *args: Unpack[Ts]) -> None:
        """Have a signal end a pause, and call ``callback``: what a signal asks for, such as an end, takes time."""
        super().add_signal_handler(sig, self._wake_up, callback, *args)

    def _wake_up(self, callback: Callable[[Unpack[Ts]], object], *args: Unpack[Ts]) -> None:
        self._time_scale.paused = False
        callback(*args)
