"""Runs scenarios in virtual time: one with its faults, and again without them for comparison; or many on all cores."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.control.run_log import RunLog, Tee
from wayfarer.control.supervisor import first_cause
from wayfarer.daemon.arming_inspection import RunningInspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.errors import NotArmed, WayfarerError
from wayfarer.experiments.commands import cores
from wayfarer.experiments.executors import DoneT, TaskT, stream
from wayfarer.experiments.progress_bar import shown_count
from wayfarer.experiments.run_campaign import stop_on_signals
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.fault_scenarios.safety_rules import SafetyRules
from wayfarer.fault_scenarios.scenario import Command, Expectation, ResponseLevel, Scenario, rover_of
from wayfarer.hal import Rover
from wayfarer.safety.mission_limits import RunEnd
from wayfarer.simhal.clock.run_virtually import run_virtually
from wayfarer.simhal.faults.injector import NoteFault
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.simulated_world import SimulatedWorld

BUDGET_M = 1000.0


class RunResult(NamedTuple):
    """What came of a run: what was seen, how it ended (an error's text where one ended it), what rules it broke.

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
        0, scenario.algorithm, forest, scenario.seed, config, scenario.slip_mean_m, BUDGET_M, scenario.depth,
        scenario.faults,
    )  # fmt: skip
    recorder, rules = RunRecorder(), SafetyRules()
    notes: list[NoteFault] = [recorder.note, rules.note]

    def make_log(world: SimulatedWorld, rover: Rover) -> RunLog:
        if log_dir is None:
            return Tee(recorder, rules)
        from wayfarer.experiments.trial_log import field_log  # only where there is a log

        log, ground_truth_log = field_log(spec, log_dir, world, rover)
        notes.append(ground_truth_log.note)
        return Tee(recorder, rules, log, ground_truth_log)

    def note_all(t_s: float, fault: Fault, *, begins: bool) -> None:
        for note in notes:
            note(t_s, fault, begins=begins)

    setup = TrialSetup(spec, make_log)
    recorder.follow(setup)
    rules.follow(setup)
    if setup.injector is not None:
        setup.injector.start(setup.world, setup.supervisor.controller.power, note_all)
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
                await rover.arm(command.heading_deg)
            else:
                await getattr(rover, command.do)()
        except (Refused, NotArmed) as error:
            log.event("arming_refused" if command.do == "arm" else "refused", loop.time(), failed=[str(error)])


def _inspect(setup: TrialSetup) -> RunningInspection:
    nowhere = Path()
    return RunningInspection(setup.config, setup.rover, HostEnvironment(nowhere, nowhere, (), 0.0), setup.supervisor)


def run_batch(run: Callable[[TaskT], DoneT], tasks: Sequence[TaskT], jobs: int | None, what: str) -> Iterator[DoneT]:
    """Yield what ``run`` returns for each task, in the order of completion; progress is shown on stderr.

    Args:
        run: is sent to the worker processes.
        tasks: what to run.
        jobs: the number of processes, None for one a core.
        what: what the tasks are called, in plural.

    Raises:
        Stopped: a signal asked for it.
        WayfarerError: a worker died.
    """
    done = 0
    try:
        with (
            stop_on_signals() as stop,
            closing(stream(run, tasks, jobs or cores(), stop)) as running,
            shown_count(Console(stderr=True), 0, len(tasks), what) as advance,
        ):
            for result in running:
                yield result
                done += 1
                advance()
    except BrokenExecutor as error:
        text = f"a worker process died after {done} {what}, most likely for lack of memory: try fewer --jobs"
        raise WayfarerError(text) from error
