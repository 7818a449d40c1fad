"""Bridge that hands each decision of a trial to a Gymnasium agent in another thread.

An environment is called from outside, a trial runs by itself: supervisor, sensor tasks and controller on a separate
loop. So that both stay what they are, the trial has a thread, and the two take turns: while the agent thinks, virtual
time is paused; while the trial runs, the agent waits. The two never run at the same time, so an episode is as
deterministic as a trial, and each decision is taken where an algorithm would take it: between the detector and the
safety gate.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from queue import SimpleQueue
from threading import Thread
from typing import NamedTuple

from wayfarer.control.supervisor import first_cause
from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.experiments.outcome import Outcome
from wayfarer.experiments.trial import TrialCounters, outcome_of
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.world.simulated_world import SimulatedWorld


class Ending(NamedTuple):
    """How an episode ended; ``outcome`` and ``path_m`` are those of a trial, ``in_time`` is False at a limit."""

    outcome: Outcome
    in_time: bool
    path_m: float
    time_s: float
    ticks: int


class AgentBridge:
    """One episode; implements ``EscapeHandler`` towards the trial.

    ``world`` is ground truth, for rewards, and may be looked at while the agent has its turn.
    """

    world: SimulatedWorld

    def __init__(self, spec: TrialSpec) -> None:
        self._spec = spec
        self._turns: SimpleQueue[Observation | Ending | BaseException] = SimpleQueue()
        self._answers: SimpleQueue[WheelCommand | None] = SimpleQueue()
        self._finish: Callable[[str, str], None]
        self._thread = Thread(target=self._run, name="wayfarer trial", daemon=True)
        self._thread.start()

    # -- the agent's side ----------------------------------------------------------------------------------------

    def wait(self) -> Observation | Ending:
        """Let the trial run until the agent is asked, or it ends.

        Raises:
            WayfarerError: the trial could not be run, such as ``MissingPart``.
        """
        turn = self._turns.get()
        if isinstance(turn, BaseException):
            self._turns.put(turn)  # there is nobody left to answer the next call
            raise first_cause(turn)
        return turn

    def answer(self, wheels: WheelCommand) -> None:
        """Say what the wheels are to do in the tick that waits for it."""
        self._answers.put(wheels)

    def leave(self) -> None:
        """End the trial at any point, by its own shutdown; may be repeated."""
        self._answers.put(None)
        self._thread.join()

    # -- the trial's side ----------------------------------------------------------------------------------------

    def decide(self, observation: Observation) -> Decision:
        """Hand the turn to the agent and return what it wants."""
        self._turns.put(observation)
        wheels = self._answers.get()
        if wheels is None:
            self._finish("left", "the agent left")
            wheels = STOP
        return Decision(wheels, Phase.FOLLOW, Phase.FOLLOW.value)

    def reset(self) -> None:
        """Forget nothing: what there is to know, the agent knows."""

    def memory(self) -> Mapping[str, float | str]:
        """Return what a log asks of every handler."""
        return {"counter_deg": 0.0, "episodes": 0}

    def _run(self) -> None:
        """Run the trial; the agent is notified of every end, because it waits."""
        _BRIDGE.set(self)
        try:
            with asyncio.Runner(loop_factory=VirtualLoop) as runner:
                self._turns.put(runner.run(self._trial()))
        except BaseException as error:
            self._turns.put(error)

    async def _trial(self) -> Ending:
        log = TrialCounters()
        setup = TrialSetup(self._spec, lambda _world, _rover: log)
        self.world = setup.world
        self._finish = log.finish = setup.supervisor.finish
        await setup.supervisor.arm(Asked(asyncio.get_running_loop().time()), self._spec.forest.heading_deg)
        end = await setup.supervisor.run()
        monitor = setup.outcome_monitor
        outcome = outcome_of(monitor, log, end)
        in_time = log.why_disarmed is not None or outcome != "entrapped"
        return Ending(outcome, in_time, monitor.path_m(setup.world), setup.world.t_s, log.ticks)


_BRIDGE: ContextVar[AgentBridge] = ContextVar("bridge")

AGENT = Algorithm("agent", "agent", "the agent that steps the environment", lambda *_: _BRIDGE.get(), origin=__name__)
AGENT_NAME = f"{__name__}:AGENT"
