"""asyncio's own event loop with a clock that jumps: what ``VirtualLoop`` is compared with."""

from __future__ import annotations

import asyncio
import selectors
from selectors import SelectorKey


class JumpingSelector(selectors.DefaultSelector):
    """Never waits for a timer: it moves ``now_s`` on by as much as it was asked to wait."""

    now_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[SelectorKey, int]]:
        """Return what is ready; without a timer wait for a thread, as there is nothing to jump to."""
        if timeout is not None and timeout > 0.0:
            self.now_s += timeout
        return super().select(None if timeout is None else 0.0)


class JumpingStockLoop(asyncio.SelectorEventLoop):
    """The stock loop, in every respect but its clock."""

    def __init__(self) -> None:
        self._jumping = JumpingSelector()
        super().__init__(self._jumping)
        self._clock_resolution = 1e-12

    def time(self) -> float:
        """Return the virtual time in seconds."""
        return self._jumping.now_s

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ARG002, ASYNC109
        """Join the threads without a deadline: the clock would jump to it."""
        await super().shutdown_default_executor()
