"""The runs of ``wayfarer demo``: one after the other, as the page asks, on a clock that the page may change.

Every run is a daemon with its own event loop, as on a rover. The page is served beside them, in a thread where
time is real, and stays between the runs. Pause and speed change the time scale of the run's loop and nothing else, so
that safety code sees what it always does: a time that goes on from tick to tick.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine, Iterator
from concurrent.futures import Future
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from wayfarer.daemon.daemon import Viewer
from wayfarer.daemon.socket.protocol import Commands, Details, Refused
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.schema import Record
from wayfarer.simhal.clock.scaled_loop import ScaledLoop, TimeScale
from wayfarer.views.live.demo_controls import DemoState

if TYPE_CHECKING:
    from wayfarer.views.live.server import LivePage

LOOK_S = 0.1  # between two looks at whether anybody has the page open
LEFT_S = 12.0  # nobody has had it open for so long: longer than a page takes to come back, PAUSES_S of connection.js
ANSWER_S = 2.0  # for a run to do what was asked, before it has ended meanwhile
GOAL_HEADING_DEG = 0.0  # generated forests are left to the north


class _Run(NamedTuple):
    """A run that is on, as other threads reach it."""

    commands: Commands
    loop: ScaledLoop

    def do(self, verb: str, **keys: Any) -> Future[Details]:
        return asyncio.run_coroutine_threadsafe(getattr(self.commands, verb)(**keys), self.loop)


class Demo:
    """Runs that follow each other; implements ``daemon.daemon.Viewer`` and ``views.live.demo_controls.DemoControls``.

    ``time_scale`` is that of every run's loop. ``watched`` is set for the run that is on when a viewer has opened
    the page.

    Args:
        seed: of the first forest; the next one has the next seed.
        speed: how many times faster than the clock.
    """

    def __init__(self, seed: int, speed: float) -> None:
        self.time_scale = TimeScale(speed)
        self.watched = asyncio.Event()
        self._seed = seed
        self._presses: SimpleQueue[bool] = SimpleQueue()  # of Another forest, and False of Restart
        self._seen = False
        self._log = ""
        self._run: _Run | None = None

    @contextmanager
    def serve_page(self, page: LivePage) -> Iterator[None]:
        """Serve the page of all runs while entered, in another thread; the last news are sent at the end."""
        self._page, self._page_loop, stack = page, asyncio.new_event_loop(), AsyncExitStack()
        thread = Thread(target=self._page_loop.run_forever, name="live page", daemon=True)
        thread.start()
        try:
            self._in_page_thread(stack.enter_async_context(page.serving(cast(Commands, ForwardedCommands(self)))))
            yield
        finally:
            self._in_page_thread(stack.aclose())
            self._page_loop.call_soon_threadsafe(self._page_loop.stop)
            thread.join()
            self._page_loop.close()

    def _in_page_thread(self, coroutine: Coroutine[Any, Any, object]) -> None:
        asyncio.run_coroutine_threadsafe(coroutine, self._page_loop).result()

    def seeds(self) -> Iterator[int]:
        """Give the seed of each run, once it is asked for, until no viewer has the page open."""
        press: bool | None = False
        while press is not None:
            self._seed += press
            while self.goes_on:
                self._seed += self._presses.get()
            self.time_scale.paused = False
            self.watched = asyncio.Event()
            yield self._seed
            press = self._next_press()

    @property
    def goes_on(self) -> bool:
        """Whether another run has been asked for."""
        return not self._presses.empty()

    def _next_press(self) -> bool | None:
        """Wait until another run is asked for; return None where nobody is left to ask."""
        unwatched_s = 0.0
        while True:
            with suppress(Empty):
                return self._presses.get(timeout=LOOK_S)
            unwatched_s = 0.0 if self._page.is_watched else unwatched_s + LOOK_S
            if unwatched_s >= LEFT_S:
                return None

    # -- a viewer of the run, in its thread --------------------------------------------------------------------------

    def show(self, record: Record) -> None:
        """Hand a record to the page; see ``Viewer``."""
        if record["record"] == "run" and record["part"] == 1:
            self._log = record["log"]
            self._page_loop.call_soon_threadsafe(self._page.begin_run, record)
        elif record["record"] != "outcome" or not self.goes_on:  # else the next run begins at once
            self._page_loop.call_soon_threadsafe(self._page.show, record)

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        """Forward what the page asks of this run while entered; see ``Viewer``."""
        self._run = _Run(commands, cast(ScaledLoop, asyncio.get_running_loop()))
        if self._seen:
            self.watched.set()
        if self.goes_on:
            await commands.stop()
        try:
            yield
        finally:
            self._run = None

    # -- what the page asks for, in the page's thread ----------------------------------------------------------------

    def now(self) -> DemoState:
        """Return how the demo is."""
        return DemoState(self._seed, self.time_scale.speed, self.time_scale.paused, self._log)

    def seen(self) -> None:
        """Have the run begin: a viewer has opened the page."""
        if not self._seen:
            self._seen = True
            if (run := self._run) is not None:
                run.loop.call_soon_threadsafe(self.watched.set)

    def pause(self, paused: bool) -> None:
        """Let the run's time stand still, or continue."""
        self.time_scale.paused = paused
        if (run := self._run) is not None:
            with suppress(RuntimeError):  # it has just ended
                run.loop.look_at_time_scale()

    def run_at(self, speed: float) -> None:
        """Let the run's time go ``speed`` times as fast as the clock."""
        self.time_scale.speed = speed
        self.pause(False)

    def begin_again(self, next_forest: bool) -> None:
        """End the run that is on, and have another one begin."""
        self._presses.put(next_forest)
        if (run := self._run) is not None:
            self.pause(False)
            run.do("stop")

    async def ask(self, verb: str, **keys: Any) -> Details:
        """Do what ``Commands`` can, in the thread of the run that is on.

        Raises:
            Refused: there is no run, or it has just ended; or the run refuses it.
        """
        if (run := self._run) is None:
            raise Refused("no run is active: press Restart or Another forest")
        if verb in {"stop", "hold", "resume"}:
            self.pause(False)  # what they do takes time
        try:
            async with asyncio.timeout(ANSWER_S):
                return await asyncio.wrap_future(run.do(verb, **keys))
        except TimeoutError:
            raise Refused("the run has just ended") from None


class ForwardedCommands:
    """Every method of ``Commands``, done by the run that is on."""

    def __init__(self, demo: Demo) -> None:
        self._demo = demo

    def __getattr__(self, verb: str) -> Any:
        return partial(self._demo.ask, verb)


class AutoArm:
    """A viewer around another one: it arms the run once ``watched`` is set and the rover knows its heading.

    A real rover is never armed by this. It stands beside the simulator, where no field code can find it, and arms only
    a run whose own first record says that it is simulated.
    """

    def __init__(self, viewer: Viewer, watched: asyncio.Event) -> None:
        self._viewer = viewer
        self._watched = watched
        self._knows_heading = asyncio.Event()
        self._simulated = False

    def show(self, record: Record) -> None:
        """Take a record; see ``Viewer``."""
        self._viewer.show(record)
        kind = record["record"]
        if kind == "run":
            self._simulated = record.get("simulated") is True
        elif kind == "tick" and record.get("heading_deg") is not None:
            self._knows_heading.set()

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        """Serve while entered; see ``Viewer``."""
        async with self._viewer.serving(commands):
            arming = asyncio.create_task(self._arm(commands), name="auto-arm")
            try:
                yield
            finally:
                arming.cancel()

    async def _arm(self, commands: Commands) -> None:
        await self._watched.wait()
        await self._knows_heading.wait()
        if self._simulated:
            with suppress(WayfarerError):  # the run's own log says why it was refused
                await commands.arm(GOAL_HEADING_DEG)
