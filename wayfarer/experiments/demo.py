"""The trials of ``wayfarer demo``: one after the other, as the page asks, at a pace that the page may change.

Each is a trial as ``wayfarer sim`` runs it, with the same result and the same log to the byte: in virtual time, in a
thread that waits for the clock between two virtual times. The page is served on the main thread's loop, where time is
real, and stays between the trials. What it asks of the rover is done in the trial's thread, at the virtual time then.
"""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable, Coroutine
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from wayfarer.config.rover_file import load_rover
from wayfarer.control.run_log import Tee
from wayfarer.control.supervisor import Supervisor
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import Commands, Details, Refused
from wayfarer.daemon.stderr_writer import StderrWriter
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import TrialResult, run_watched
from wayfarer.experiments.trial_log import field_log
from wayfarer.fieldlog.folders import new_run_folder
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.run_state import RunState
from wayfarer.fieldlog.schema import Record
from wayfarer.hal import Rover
from wayfarer.simhal.clock.paced_loop import Pace, PacedLoop
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.views.live.demo_controls import DemoState
from wayfarer.views.text.console import Console

if TYPE_CHECKING:
    from wayfarer.views.live.server import LivePage

ROVER = "sim"
ENDING = (signal.SIGINT, signal.SIGTERM)
LOOK_S = 0.1  # between two looks at whether anybody has the page open
LEFT_S = 12.0  # nobody has had it open for so long: longer than a page takes to come back, PAUSES_S of connection.js
REPLACED = ("requested", "replaced by another one")
ANSWER_S = 2.0  # for a trial to do what was asked, before it has ended meanwhile


class DemoTrial(NamedTuple):
    """A trial that was shown: its campaign's seed, its result, the state at the end of its log, and its folder."""

    seed: int
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
    """Trials that follow each other; implements ``views.live.demo_controls.DemoControls``.

    Args:
        algorithm: its name.
        seed: of the first forest, as of a campaign; the next one has the next seed.
        trial: which trial of these campaigns.
        speed: how many times faster than the clock.
        logs: the folder of all logs.
        ended: is told of each trial that has ended and is not replaced by another one.
    """

    def __init__(
        self, algorithm: str, seed: int, trial: int, speed: float, logs: Path, ended: Callable[[DemoTrial], None]
    ) -> None:
        self._algorithm = algorithm
        self._seed = seed
        self._trial = trial
        self._logs = logs
        self._tell_end = ended
        self._rover = load_rover(ROVER)
        self._pace = Pace(speed, paused=True)  # until somebody sees the page
        self._seen = False
        self._presses: asyncio.Queue[bool] = asyncio.Queue()  # of Another forest, and False of Restart
        self._signal = ""
        self._log = ""
        self._running: _Running | None = None
        self._lines = StderrWriter()

    async def run(self, page: LivePage) -> None:
        """Serve the page, and run trials until a signal comes or, after a trial, nobody has the page open.

        Raises:
            MissingPart: the rover cannot give what the algorithm needs.
            BadInput: a log cannot be written.
        """
        self._page, self._loop = page, asyncio.get_running_loop()
        for number in ENDING:
            self._loop.add_signal_handler(number, self._end_by, number.name)
        try:
            async with page.serving(cast(Commands, ForwardedCommands(self))):
                press: bool | None = False
                while press is not None:
                    self._seed += press
                    while self._is_replaced:
                        self._seed += self._presses.get_nowait()
                    shown = await asyncio.to_thread(self._run_trial, self._seed)
                    self._running = None
                    if not self._is_replaced:
                        self._tell_end(shown)
                    press = await self._next_press()
        finally:
            self._end_by("an error")  # a trial that is still on would keep the program from ending
            self._lines.close()

    @property
    def _is_replaced(self) -> bool:
        """Whether another trial has been asked for."""
        return not self._presses.empty()

    async def _next_press(self) -> bool | None:
        """Wait until another trial is asked for; return None where nobody is left to ask."""
        unwatched_s = 0.0
        while unwatched_s < LEFT_S and not self._signal:
            with suppress(TimeoutError):
                async with asyncio.timeout(LOOK_S):
                    return await self._presses.get()
            unwatched_s = 0.0 if self._page.is_watched else unwatched_s + LOOK_S
        return None

    def _end_by(self, name: str) -> None:
        """End the trial that is on, and then the demo."""
        self._signal = name
        self.pause(False)
        if (running := self._running) is not None:
            running.finish("signal", f"ended by {name}")

    # -- the trial, in its thread ------------------------------------------------------------------------------------

    def _run_trial(self, seed: int) -> DemoTrial:
        campaign = Campaign((self._algorithm,), self._trial + 1, self._rover, seed)
        spec = campaign.spec(Task(self._algorithm, self._trial), campaign.make_forest(self._trial))
        fold, folder = RunFold(reckons=False), new_run_folder(self._logs)
        self._log = os.fsencode(folder.absolute()).decode(errors="replace")  # JSON has no bytes that are no text
        shown_to = (fold.take, Console("", self._lines.write).show, self._show)

        def make_log(world: SimulatedWorld, rover: Rover) -> Tee:
            self._field_log, truth = field_log(spec, folder, world, rover, shown_to)
            self._motors = rover.motors
            return Tee(self._field_log, truth)

        loop_factory = partial(PacedLoop, self._pace)  # type: ignore[abstract]
        result = run_watched(spec, make_log, begin=self._begin, loop_factory=loop_factory)
        return DemoTrial(seed, result, fold.state, folder)

    def _begin(self, supervisor: Supervisor) -> None:
        """Let the page reach the trial; one that is not wanted any more ends at its first tick."""
        commands = RoverCommands(supervisor, self._motors, _inspect_nothing, self._field_log, {"log": self._log}, ())
        self._running = _Running(cast(PacedLoop, asyncio.get_running_loop()), supervisor, commands)
        if self._signal:
            supervisor.finish("signal", f"ended by {self._signal}")
        elif self._is_replaced:
            supervisor.finish(*REPLACED)

    def _show(self, record: Record) -> None:
        """Hand a record to the page."""
        if record["record"] == "run":
            self._loop.call_soon_threadsafe(self._page.begin_run, record)
        elif record["record"] != "outcome" or not self._is_replaced:  # else the next trial begins at once
            self._loop.call_soon_threadsafe(self._page.show, record)

    # -- what the page asks for, on its loop -------------------------------------------------------------------------

    def now(self) -> DemoState:
        """Return how the demo is."""
        return DemoState(self._seed, self._pace.speed, self._pace.paused, self._log)

    def seen(self) -> None:
        """Have the first trial begin: a viewer has opened the page."""
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

    def begin_again(self, next_forest: bool) -> None:
        """End the trial that is on, and have another one begin."""
        self._presses.put_nowait(next_forest)
        self.pause(False)
        if (running := self._running) is not None:
            running.finish(*REPLACED)

    async def ask(self, verb: str, **keys: Any) -> Details:
        """Do what ``Commands`` can, in the thread of the trial that is on.

        Raises:
            Refused: there is no trial, or it has just ended; or the rover refuses it.
        """
        if (running := self._running) is None:
            raise Refused("no run is active: press Restart or Another forest")
        if verb in {"stop", "hold", "resume"}:
            self.pause(False)  # what they do takes time
        work: Coroutine[Any, Any, Details] = getattr(running.commands, verb)(**keys)
        answer = asyncio.wrap_future(asyncio.run_coroutine_threadsafe(work, running.loop))
        await asyncio.wait([answer], timeout=ANSWER_S)
        if answer.cancel():  # no answer has come
            work.close()  # it has never begun
        if answer.cancelled():  # also by the end of the trial's loop
            raise Refused("the run has just ended")
        return answer.result()


class ForwardedCommands:
    """Every method of ``Commands``, done by the trial that is on."""

    def __init__(self, demo: Demo) -> None:
        self._demo = demo

    def __getattr__(self, verb: str) -> Any:
        return partial(self._demo.ask, verb)


def _inspect_nothing() -> Any:
    """Stand in for the checks before arming: a trial arms its rover itself, and its page arms none."""
    raise Refused("a trial arms its rover itself")
