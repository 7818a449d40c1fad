"""The trial of ``wayfarer demo``, at a pace that its page may change.

It is a trial as ``wayfarer sim`` runs it, with the same result and the same log to the byte: in virtual time, in a
thread that waits for the clock between two virtual times. The page is served on the main thread's loop, where time is
real, and stays after the trial. What it asks of the rover is done in the trial's thread, at the virtual time then.
"""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable, Coroutine
from functools import partial
from pathlib import Path
from threading import Semaphore
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from wayfarer.config.rover_file import load_rover
from wayfarer.control.run_log import Tee
from wayfarer.control.supervisor import Supervisor
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import Commands, Details, RequestRefused
from wayfarer.daemon.stderr_writer import StderrWriter
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import TrialResult, run_watched
from wayfarer.experiments.trial_log import field_log
from wayfarer.fieldlog.folders import new_run_folder
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.record import AnyRecord
from wayfarer.fieldlog.run_fold import RunFold, RunState
from wayfarer.hal import DriveMotors, Rover
from wayfarer.logview.narrator import Console
from wayfarer.remote.live import DemoState
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import Pace, PacedLoop
from wayfarer.simhal.world.simulated_world import SimulatedWorld

if TYPE_CHECKING:
    from wayfarer.remote.live.server import LivePage

ROVER = "sim"
ENDING = (signal.SIGINT, signal.SIGTERM)
LOOK_S = 0.1  # between two looks at whether anybody has the page open
LEFT_S = 12.0  # nobody has had it open for so long: longer than a page takes to come back, PAUSES_S of connection.js
# Records that the trial may be ahead of its page, eight seconds of a rover: chosen by us. A trial is faster than its
# page, and waits for it then.
AHEAD = 200
ANSWER_S = 2.0  # for a trial to do what was asked, before it has ended meanwhile


class DemoTrial(NamedTuple):
    """A trial that was shown: its result, the state at the end of its log, and its folder."""

    result: TrialResult
    state: RunState
    folder: Path


class _Running(NamedTuple):
    """A trial that is on, as the page's loop reaches it."""

    loop: PacedLoop
    supervisor: Supervisor
    commands: Commands

    def finish(self, reason: str, text: str) -> None:
        self.loop.call_soon_threadsafe(self.supervisor.finish, reason, text)


class Demo:
    """One trial and its page; implements ``remote.live.DemoControls``.

    Args:
        algorithm: its name.
        seed: of the forest, as of a campaign.
        trial: which trial of that campaign.
        speed: how many times faster than the clock.
        logs: the folder of all logs.
        ended: is called with the trial when it has ended.
    """

    def __init__(
        self, algorithm: str, seed: int, trial: int, speed: float, logs: Path, ended: Callable[[DemoTrial], None]
    ) -> None:
        self._algorithm = algorithm
        self._seed = seed
        self._trial = trial
        self._logs = logs
        self._tell_end = ended
        self._pace = Pace(speed, paused=True)  # until somebody sees the page
        self._seen = False
        self._signal = ""
        self._log = ""
        self._running: _Running | None = None
        self._lines = StderrWriter()

    async def run(self, page: LivePage) -> None:
        """Run the trial and serve the page, until a signal comes or, after the trial, nobody has the page open.

        Raises:
            MissingPart: the rover cannot give what the algorithm needs.
            BadInput: a log cannot be written.
        """
        loop = asyncio.get_running_loop()
        for number in ENDING:
            loop.add_signal_handler(number, self._end_by, number.name)
        room, begun = Semaphore(AHEAD), asyncio.Event()

        def shown_on_page(record: AnyRecord) -> None:
            begun.set()
            try:
                page.show(record)
            finally:
                room.release()

        def show(record: AnyRecord) -> None:
            """Hand a record to the page; called in the trial's thread."""
            room.acquire()
            loop.call_soon_threadsafe(shown_on_page, record)

        trial = asyncio.create_task(asyncio.to_thread(self.run_trial, show))
        begins = asyncio.create_task(begun.wait())
        try:
            # The page has no forest before the trial's first record.
            await asyncio.wait((trial, begins), return_when=asyncio.FIRST_COMPLETED)
            async with page.serving(cast(Commands, ForwardedCommands(self))):
                ended = await trial
                self._running = None
                self._tell_end(ended)
                unwatched_s = 0.0
                while unwatched_s < LEFT_S and not self._signal:
                    await asyncio.sleep(LOOK_S)
                    unwatched_s = 0.0 if page.is_watched else unwatched_s + LOOK_S
        finally:
            begins.cancel()
            self._end_by("an error")  # a trial that is still on would keep the program from ending
            self._lines.close()

    def _end_by(self, name: str) -> None:
        """End the trial that is on, and then the demo."""
        self._signal = name
        self.pause(False)
        if (running := self._running) is not None:
            running.finish("signal", f"ended by {name}")

    def run_trial(self, show: Callable[[AnyRecord], None]) -> DemoTrial:
        """Run the trial to its end, in a separate thread; ``show`` is called there with each record of its log.

        Raises:
            MissingPart, BadInput: as ``run``.
        """
        campaign = Campaign((self._algorithm,), self._trial + 1, load_rover(ROVER), self._seed)
        spec = campaign.spec(Task(self._algorithm, self._trial), campaign.make_forest(self._trial))
        fold, folder = RunFold(), new_run_folder(self._logs)
        self._log = os.fsencode(folder.absolute()).decode(errors="replace")  # JSON has no bytes that are not text
        shown_to = (fold.add, Console("", self._lines.write).show, show)
        made: list[tuple[FieldLog, DriveMotors]] = []

        def make_log(world: SimulatedWorld, rover: Rover) -> Tee:
            log, truth = field_log(spec, folder, world, rover, shown_to)
            made.append((log, rover.motors))
            return Tee(log, truth)

        def begin(supervisor: Supervisor) -> None:
            """Let the page reach the trial."""
            ((log, motors),) = made
            commands = RoverCommands(supervisor, motors, _inspect_nothing, log, {"log": self._log}, ())
            self._running = _Running(cast(PacedLoop, asyncio.get_running_loop()), supervisor, commands)
            if self._signal:
                supervisor.finish("signal", f"ended by {self._signal}")

        loop_factory = partial(PacedLoop, self._pace)  # type: ignore[abstract]
        result = run_watched(spec, make_log, begin=begin, loop_factory=loop_factory)
        return DemoTrial(result, fold.state, folder)

    # -- what the page asks for, on its loop -------------------------------------------------------------------------

    def now(self) -> DemoState:
        """Return how the demo is."""
        return DemoState(self._seed, self._pace.speed, self._pace.paused, self._log)

    def seen(self) -> None:
        """Have the trial begin: a viewer has opened the page."""
        if not self._seen:
            self._seen = True
            self.pause(False)

    def pause(self, paused: bool) -> None:
        """Let the trial's time stand still, or continue; an end that a signal asks for takes time."""
        self._pace.paused = paused and not self._signal
        if (running := self._running) is not None:
            running.loop.wake()

    def run_at(self, speed: float) -> None:
        """Let the trial's time go ``speed`` times as fast as the clock, and end a pause."""
        self._pace.speed = speed
        self.pause(False)

    async def ask(self, verb: str, **keys: Any) -> Details:
        """Do what ``Commands`` can, in the thread of the trial that is on.

        Raises:
            RequestRefused: there is no trial, or it has just ended; or the rover refuses it.
        """
        if (running := self._running) is None:
            raise RequestRefused("the run has ended: wayfarer demo in a terminal begins another one")
        if verb in {"stop", "hold", "resume"}:
            self.pause(False)  # what they do takes time
        if "asked" in keys:  # a paused trial's clock stands, and the page knows another one
            keys["asked"] = Asked(running.loop.time())
        work: Coroutine[Any, Any, Details] = getattr(running.commands, verb)(**keys)
        answer = asyncio.wrap_future(asyncio.run_coroutine_threadsafe(work, running.loop))
        await asyncio.wait([answer], timeout=ANSWER_S)
        if answer.cancel():  # no answer has come
            work.close()  # it has never begun
        if answer.cancelled():  # also by the end of the trial's loop
            raise RequestRefused("the run has just ended")
        return answer.result()


class ForwardedCommands:
    """Every method of ``Commands``, done by the trial that is on."""

    def __init__(self, demo: Demo) -> None:
        self._demo = demo

    def __getattr__(self, verb: str) -> Any:
        return partial(self._demo.ask, verb)


def _inspect_nothing(_: object) -> Any:
    """Stand in for the checks before arming: a trial arms its rover itself, and its page arms none."""
    raise RequestRefused("a trial arms its rover itself")
