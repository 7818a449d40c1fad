"""Runs a scenario in virtual time, with its faults or without, and records it tick by tick: read, concluded, done."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import NamedTuple

from wayfarer.commissioning.checks import HostEnvironment, Inspection
from wayfarer.control.run_log import RunLog, Tee
from wayfarer.control.supervisor import first_cause
from wayfarer.control.tick import TickRecord
from wayfarer.daemon.arming_check import running_inspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import DriverError, NotArmed
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.hal import MotorHealth, PositionFix, Rover, Snapshot, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.mission import RunEnd
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import run_virtually
from wayfarer.simhal.faults.injector import NoteFault
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.testing.safety_rules import SafetyRules, after_each_step
from wayfarer.testing.scenario import Command, Expectation, ResponseLevel, Scenario, rover_of

BUDGET_M = 1000.0


class RecordedTick(NamedTuple):
    """One control tick."""

    t_s: float
    snapshot: Snapshot
    level: Level
    cause: Condition | None
    conditions: tuple[Condition, ...]
    why: str
    applied: WheelCommand
    commanded: tuple[float, float]


class RecordedEvent(NamedTuple):
    """One event of the log."""

    t_s: float
    name: str
    details: dict[str, object]


class RunRecorder(RunLog):
    """Keeps what a run reports. ``follow`` gives it the trial to watch."""

    def __init__(self) -> None:
        self.ticks: list[RecordedTick] = []
        self.events: list[RecordedEvent] = []
        self.boards: list[tuple[float, tuple[MotorHealth, WheelCommand | None]]] = []
        self.fixes: list[PositionFix | None] = []
        self.faults: list[tuple[float, Fault, bool]] = []
        self.stood_still_s: list[tuple[float, bool]] = []
        self.ended: str | None = None
        self.ended_s = inf

    def follow(self, setup: TrialSetup) -> None:
        """Watch a trial's world and its controller."""
        self._controller, self._world = setup.supervisor.controller, setup.world
        after_each_step(setup.world, self._look)

    def _look(self) -> None:
        if self.ended is None:  # wheels that are stopped after the end of a run say nothing of the fault
            self.stood_still_s.append((self._world.t_s, self._world.commanded == (0.0, 0.0)))

    def tick(self, record: TickRecord) -> None:
        """Take a control tick."""
        self.ticks.append(
            RecordedTick(
                record.t_s,
                record.snapshot,
                record.level,
                record.cause,
                self._controller.conditions,
                record.decision.why,
                record.applied,
                self._world.commanded,
            )
        )

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take an event; the stop at the end of a run is looked at as well."""
        self.events.append(RecordedEvent(t_s, name, details))
        if name == "wheels_stopped":
            self.stood_still_s.append((_now_s(), self._world.commanded == (0.0, 0.0)))

    def position(self, fix: PositionFix | None) -> None:
        """Take a fix."""
        self.fixes.append(fix)

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Take what the board said."""
        self.boards.append((t_s, (health, duties)))

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002 - the interface's
        """Take why the run ended."""
        self.ended, self.ended_s = reason, _now_s()

    def note(self, t_s: float, fault: Fault, *, begins: bool) -> None:
        """Take the beginning of a fault, or its end."""
        self.faults.append((t_s, fault, begins))


class RunResult(NamedTuple):
    """What came of a run: what was seen, how it ended (an error's text if one ended it), what rules it broke.

    ``excused`` is how often a rule could not be kept by anything on board; see ``SafetyRules``.
    """

    recorder: RunRecorder
    end: RunEnd | None
    error: str | None
    broken: tuple[str, ...]
    excused: int


def run_scenario(scenario: Scenario, log_dir: Path | None = None) -> RunResult:
    """Run a scenario with its faults; with ``log_dir`` the rover's full field log is written there.

    Raises:
        BadInput: a fault cannot happen to the rover, or the log cannot be written.
    """
    return run_virtually(lambda: _run(scenario, log_dir))


def run_without_faults(scenario: Scenario) -> RunResult:
    """Run a scenario without its faults: the same world, the same chance."""
    return run_scenario(without_faults(scenario))


def without_faults(scenario: Scenario) -> Scenario:
    """Return the scenario that all have in common which differ only in faults and in what is expected of them."""
    nothing = Expectation(ResponseLevel.NONE, 0.0)
    return replace(scenario, name="", about="", row=None, asked="", because="", expect=nothing, faults=())


async def _run(scenario: Scenario, log_dir: Path | None) -> RunResult:
    config = rover_of(scenario)
    forest = CLEARING if scenario.clearing else generate_forest(scenario.seed, 0, scenario.seed)
    spec = TrialSpec(
        0, scenario.algorithm, forest, scenario.seed, config, BUDGET_M, scenario.depth, scenario.faults,
        physics=Physics(slip_mean_m=scenario.slip_mean_m),
    )  # fmt: skip
    recorder, rules = RunRecorder(), SafetyRules()
    notes: list[NoteFault] = [recorder.note, rules.note]

    def make_log(world: SimulatedWorld, rover: Rover) -> RunLog:
        if log_dir is None:
            return Tee(recorder, rules)
        from wayfarer.experiments.trial_log import field_log  # only if there is a log

        log, ground_truth_log = field_log(spec, log_dir, world, rover)
        notes.append(ground_truth_log.note)
        return Tee(recorder, rules, log, ground_truth_log)

    setup = TrialSetup(spec, make_log)
    recorder.follow(setup)
    rules.follow(setup)
    if setup.injector is not None:
        setup.injector.start(setup.world, setup.supervisor.inbox.put_power, notes)
    error, end, loop = None, None, asyncio.get_running_loop()
    stray: list[str] = []  # errors that nobody awaits: of the injection, or of a task that was forgotten
    loop.set_exception_handler(lambda _, context: stray.append(f"{context['message']}: {context.get('exception')!r}"))
    asking = asyncio.ensure_future(_ask(setup, scenario.commands, recorder))
    loop.call_later(scenario.for_s, setup.supervisor.finish, "requested", "the scenario is over")
    try:
        end = await setup.supervisor.run()
    except Exception as raised:
        cause = first_cause(raised)
        error = f"{type(cause).__name__}: {cause}"
    finally:
        asking.cancel()
        await asyncio.wait([asking])
        if not asking.cancelled() and (raised_asking := asking.exception()) is not None:
            stray.append(f"a command failed: {raised_asking!r}")
        if setup.injector is not None:
            await asyncio.sleep(rules.bound_s)  # the wheels are watched until they must stand
            setup.injector.end()
    return RunResult(recorder, end, error, (*rules.broken, *stray), rules.excused)


async def _ask(setup: TrialSetup, commands: tuple[Command, ...], log: RunLog) -> None:
    """Ask for what people ask for, each at its time, as the control socket does; a refusal is written down."""
    loop, supervisor = asyncio.get_running_loop(), setup.supervisor
    about = {"start_delay_s": setup.config.safety.start_delay_s}
    rover = RoverCommands(supervisor, setup.rover.motors, partial(_inspect, setup), log, about, checks=())
    for command in sorted(commands, key=lambda each: each.at_s):
        await asyncio.sleep(max(0.0, command.at_s - loop.time()))
        try:
            if command.do == "arm":
                await rover.arm(Asked(loop.time()), command.heading_deg)
            elif command.do == "resume":
                await rover.resume(Asked(loop.time()))
            else:
                await getattr(rover, command.do)()
        except (RequestRefused, NotArmed) as error:
            log.logger.warning(
                "arming_refused" if command.do == "arm" else "refused", t_s=loop.time(), text=f"Refused: {error}",
                failed=[str(error)],
            )  # fmt: skip


def _inspect(setup: TrialSetup, motors_failed: DriverError | None) -> Inspection:
    nowhere = HostEnvironment(Path(), Path(), (), 0.0)
    return running_inspection(setup.config, setup.rover, nowhere, setup.supervisor, motors_failed)


def _now_s() -> float:
    return asyncio.get_running_loop().time()
