"""The environment: observations, actions and rewards of one blind rover in one forest."""

from __future__ import annotations

import asyncio
import os
import weakref
from collections.abc import Callable, Mapping
from contextlib import suppress
from contextvars import ContextVar
from math import cos, degrees, radians, sin
from operator import index
from queue import SimpleQueue
from threading import Thread
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.spaces import Box
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wayfarer.control.supervisor import first_cause
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.escape.catalogue import Algorithm
from wayfarer.experiments.campaign import Task
from wayfarer.experiments.checks import make_campaign
from wayfarer.experiments.outcome import Outcome, TrialCounters
from wayfarer.experiments.trial import outcome_of
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.simulated_world import SimulatedWorld

# -- two threads that take turns -------------------------------------------------------------------------------------
# Bridge that hands each decision of a trial to a Gymnasium agent in another thread.
#
# An environment is called from outside, a trial runs by itself: supervisor, sensor tasks and controller on a separate
# loop. So that both stay what they are, the trial has a thread, and the two take turns: while the agent thinks, virtual
# time is paused; while the trial runs, the agent waits. The two never run at the same time, so an episode is as
# deterministic as a trial, and each decision is taken where an algorithm would take it: between the detector and the
# safety gate.


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
        self._process = os.getpid()
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

    def check_process(self) -> None:
        """Refuse to go on in a process that was forked from the one of the episode: there the trial has no thread.

        Raises:
            ResetNeeded: this is one.
        """
        if os.getpid() != self._process:
            raise ResetNeeded(
                f"the episode is process {self._process}'s, and this is {os.getpid()}, which was forked from it: "
                "call reset() here, or make the environment here"
            )

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


WHITE, WOOD, LEAF, WAY = (245, 245, 238), (188, 160, 120), (120, 150, 92), (255, 138, 36)
GROUND = (32, 36, 28)
PICTURE_PX = 480
FINER = 3  # drawn so many times larger, for smooth lines
DOT_PX, NOSE_PX = 3.2, 9.0


class ForestMap:
    """A picture of a forest from above (north is up) with the way so far, drawn with pillow."""

    def __init__(self, forest: Forest) -> None:
        self._scale = FINER * PICTURE_PX / WORLD_SIZE_M
        self._image = self._draw_forest(forest)
        self._here: tuple[float, float] | None = None

    def go(self, x_m: float, y_m: float) -> None:
        """Lengthen the way to a place, metres east and north."""
        here = self._place(x_m, y_m)
        if self._here is not None:
            ImageDraw.Draw(self._image).line((self._here, here), WAY, 2 * FINER)
        self._here = here

    def draw(self, heading_deg: float) -> Image.Image:
        """Return the map with the rover as a dot and a line ahead."""
        picture = self._image.copy()
        if self._here is not None:
            draw, dot, (x, y) = ImageDraw.Draw(picture), DOT_PX * FINER, self._here
            ahead, nose = radians(heading_deg), NOSE_PX * FINER
            draw.line((x, y, x + nose * sin(ahead), y - nose * cos(ahead)), WHITE, 2 * FINER)
            draw.ellipse((x - dot, y - dot, x + dot, y + dot), WHITE, "black", 2)
        return picture.resize((PICTURE_PX, PICTURE_PX), Image.Resampling.BOX)

    def _draw_forest(self, forest: Forest) -> Image.Image:
        size = FINER * PICTURE_PX
        image = Image.new("RGB", (size, size))
        draw = ImageDraw.Draw(image)
        draw.rounded_rectangle((0, 0, size - 1, size - 1), 6 * FINER, GROUND)
        for trunk, diameter_m in forest.thick_trunks:
            ends = (self._place(trunk.x0_m, trunk.y0_m), self._place(trunk.x1_m, trunk.y1_m))
            draw.line(ends, WOOD, max(round(diameter_m * self._scale), FINER))
        for x_m, y_m in forest.trees_m:
            (x, y), radius = self._place(x_m, y_m), 1.4 * FINER
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), LEAF)
        _, goal = self._place(0.0, forest.goal_y_m)
        draw.line((2 * FINER, goal, size - 2 * FINER, goal), WHITE, FINER)
        return image

    def _place(self, x_m: float, y_m: float) -> tuple[float, float]:
        return x_m * self._scale, (WORLD_SIZE_M - y_m) * self._scale


Array = NDArray[np.float32]

TRIALS = 1_000_000  # each in another layout
HELD_BACK = 1000  # never drawn: the trials that ``wayfarer sim`` measures algorithms on are not for training
FREE_MAX_M = 10.0  # what is further back is long ago: the longest stride of the Lévy walk

# Rewards. A metre towards the goal line counts 1, and a second costs what makes standing still never pay: a trial of
# Forest-Pledge, 37.5 m in about 107 s, earns 37.5 - 10.7 + 10. Chosen by us.
TIME_COST_PER_S = 0.1
BONUS = {"escaped": 10.0, "tipped": -10.0, "fault": -10.0, "entrapped": -10.0}

SIZE = 4 + len(Anomaly) + 1


class ForestEnv(gymnasium.Env[Array, Array]):
    """A rover that is to cross a 50 m forest to its north edge with what it feels.

    Each episode is a trial of ``wayfarer sim``: the same supervisor, detector, safety gate, sensor tasks and outcome
    monitor, in virtual time, with the agent in the handler's place (``wayfarer.gym.env``). One step is one control
    tick, 0.05 s on the rover ``sim``. While the safety gate holds the wheels nobody is asked: a step lasts until the
    hold is over.

    Observation, 11 numbers in [-1, 1]: sine and cosine of heading minus goal heading (positive clockwise); pitch (nose
    up) and roll (right side down), as shares of 180 degrees; the anomalies that the detector sees, each 0 or 1, in the
    order of ``Anomaly``; the distance commanded since the last of them, as a share of 10 m. No position: the rover has
    none. ``info["observation"]`` is the same as an algorithm of the catalogue gets it.

    Action: duty of the left and right wheels, -1 (full reverse) to 1. The safety gate limits what it is given, and a
    duty that is not a number is a fault, as on a rover.

    Reward, from ground truth: metres gained towards the goal line, minus 0.1 per second; 10 more for ``escaped``, 10
    less for ``tipped``, ``fault`` and a rover that gave up (``entrapped``); nothing more for ``left_bounds``.

    Terminated with those outcomes; truncated when the budget of path, or of four seconds per metre of it, is used up.
    ``info["ending"]`` then says how: an ``Ending``.

    Args:
        rover: a rover file, by name or path.
        render_mode: ``rgb_array``: ``render`` returns a map with the way so far (needs pillow); None: no pictures.
        settings: those of ``run_campaign``, such as ``slip_mean_m=2.0``, or ``physics="mujoco"`` (extra
            ``physics``) with ``set={"sim.friction": (0.3, 0.8)}``, which is drawn for each trial.

    Raises:
        BadInput: no such ``render_mode``, or a setting that cannot be used, as of ``run_campaign``.
        MissingPackage: as of ``run_campaign``.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 (gymnasium's own declaration)

    def __init__(
        self,
        rover: str = "sim",
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise BadInput(f"render_mode {render_mode!r} is not known: use 'rgb_array', or None")
        self.render_mode = render_mode
        self._map: ForestMap | None = None
        self.observation_space = Box(-1.0, 1.0, (SIZE,), np.float32)
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        # The agent alone drives: a rover without progress ends the episode, and does not climb wayfarer's ladder.
        keys = {**settings.pop("set", {}), "progress.give_up": True}
        asked = {"rover": rover, **settings, "algorithms": AGENT_NAME, "trials": TRIALS, "set": keys}
        self._campaign = make_campaign(asked)
        self._bridge: AgentBridge | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin a trial: number ``options["trial"]``, or else one that is drawn; ``info["trial"]`` says which.

        It is that trial of ``wayfarer sim`` with ``--seed 0``: the same forest, the same rover, the same noise.

        Raises:
            BadInput: no such trial.
            WayfarerError: the rover could not be armed, or lacks a part that its file asks for.
        """
        super().reset(seed=seed)
        self.close()
        drawn = int(self.np_random.integers(HELD_BACK, TRIALS))
        trial = (options or {}).get("trial", drawn)
        with suppress(TypeError):
            trial = index(trial)  # any whole number, such as NumPy's
        if not (isinstance(trial, int) and 0 <= trial < TRIALS):
            raise BadInput(f"options: trial {trial!r} is not a whole number from 0 to {TRIALS - 1}")
        forest = self._campaign.make_forest(trial)
        self._bridge = bridge = AgentBridge(self._campaign.spec(Task(AGENT_NAME, trial), forest))
        self._leave = weakref.finalize(self, bridge.leave)
        seen = bridge.wait()
        if isinstance(seen, Ending):
            raise WayfarerError(f"trial {trial} was over before the rover could drive: {seen.outcome}")
        self._last = seen
        self._anomaly_at_m = seen.travelled_m
        self._y_m, self._t_s = bridge.world.y_m, bridge.world.t_s
        if self.render_mode is not None:
            self._map = ForestMap(forest)
            self._look(bridge.world)
        return self._vector(seen), {"trial": trial, "observation": seen}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Do one control tick.

        Raises:
            InvalidAction: not two numbers.
            ResetNeeded: the episode is over, has not begun, or is that of the process that this one was forked from.
        """
        bridge = self._bridge
        if bridge is None:
            raise ResetNeeded("the episode is over, or has not begun: call reset() first")
        bridge.check_process()
        try:
            left, right = np.asarray(action, np.float64)
            wheels = WheelCommand(left, right)
        except (TypeError, ValueError):
            raise InvalidAction(f"action {action!r} is not two duties, left and right, each from -1 to 1") from None
        bridge.answer(wheels)
        turn = bridge.wait()
        gained_m, took_s = bridge.world.y_m - self._y_m, bridge.world.t_s - self._t_s
        self._y_m, self._t_s = bridge.world.y_m, bridge.world.t_s
        reward = gained_m - TIME_COST_PER_S * took_s
        self._look(bridge.world)
        if isinstance(turn, Observation):
            self._last = turn
            return self._vector(turn), reward, False, False, {"observation": turn}
        self.close()
        reward += BONUS.get(turn.outcome, 0.0) if turn.in_time else 0.0
        info = {"observation": self._last, "ending": turn}
        return self._vector(self._last), reward, turn.in_time, not turn.in_time, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the forest, the way so far and the rover: 480 x 480 x 3; None without ``render_mode``.

        Raises:
            ResetNeeded: no episode has begun.
        """
        if self.render_mode is None:
            return None
        if self._map is None:
            raise ResetNeeded("no episode has begun: call reset() first")
        return np.asarray(self._map.draw(self._heading_deg))

    def close(self) -> None:
        """End the trial, if one is on."""
        if self._bridge is not None:
            self._bridge = None
            self._leave()

    def _look(self, world: SimulatedWorld) -> None:
        """Note where the rover is, for the next picture."""
        if self._map is not None:
            self._map.go(world.x_m, world.y_m)
            self._heading_deg = degrees(world.heading_rad)

    def _vector(self, seen: Observation) -> Array:
        """Return an observation in numbers."""
        if seen.anomalies:
            self._anomaly_at_m = seen.travelled_m
        off_rad = radians(seen.heading_deg - seen.goal_heading_deg)
        free = min((seen.travelled_m - self._anomaly_at_m) / FREE_MAX_M, 1.0)
        flags = (anomaly in seen.anomalies for anomaly in Anomaly)
        tilt = (seen.pitch_deg / 180.0, seen.roll_deg / 180.0)
        return np.array((sin(off_rad), cos(off_rad), *tilt, *flags, free), np.float32)
