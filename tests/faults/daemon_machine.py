"""The daemon as a state machine: any interleaving of faults, commands and time, and the safety rules after each step.

``test_state_machine.py`` tries a few in each run of the tests. More of them, other ones each time::

    python -m tests.faults.daemon_machine --examples 1000
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from tests.faults.fault_strategies import (
    PLACES,
    REFUSALS,
    ROVERS,
    FaultTarget,
    algorithms_of,
    faults,
    possible_faults,
    quick_settings,
    ready_for,
)
from tests.kit.rover import T_WALL
from wayfarer.commissioning.checks import ARMING, CALIBRATED, HostEnvironment
from wayfarer.config.rover_file import laid_over, load_rover
from wayfarer.control.modes import Mode
from wayfarer.control.supervisor import first_cause
from wayfarer.daemon.arming_check import running_inspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import STARTING, RequestRefused
from wayfarer.errors import NotArmed
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.safety.conditions import LEVELS, MANUAL_LEVELS, Condition, Level
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.safety_rules import SafetyRules

SENSES = ("compass", "motion", "contact", "position")
SOON_S = 0.05  # an answer may take longer, and other commands come meanwhile
POWER_FLAGS = (None, 0, 0x1, 0x10001, 0x50005)
NOW_S = st.just(0.0)
# What a motor board may recover from, each if the rover has it.
HEALS = ("nack", "hang", "silent", "reset", "board_fault", "failsafe_off")
FOLDER = Path(mkdtemp(prefix="wayfarer-machine-"))


class Daemon:
    """A daemon's run in virtual time, one step after the other.

    Every part is made ready for faults by one that never begins.
    """

    def __init__(self, rover: str, depth: Depth, seed: int) -> None:
        self.depth = depth
        self._runner = asyncio.Runner(loop_factory=VirtualLoop)
        self.stray: list[str] = []
        loop = self._runner.get_loop()
        loop.set_exception_handler(lambda _, context: self.stray.append(repr(context)))
        self._asked: set[asyncio.Task[Any]] = set()
        self.lasting: dict[int, Fault] = {}
        self._number = 0
        config = load_rover(rover)
        config = laid_over(config, {**quick_settings(config), "manual": {"allowed": True}})
        self.lease = self._seq = 0
        self.places = possible_faults(config, depth)
        never = ready_for(self.places)
        algorithms = algorithms_of(config)
        algorithm = algorithms[seed % len(algorithms)]
        spec = TrialSpec(0, algorithm, generate_forest(seed, 0, seed), seed, config, depth=depth, faults=never)
        self._runner.run(self._begin(spec))

    async def _begin(self, spec: TrialSpec) -> None:
        self.rules = SafetyRules()
        self.setup = setup = TrialSetup(spec, lambda *_: self.rules)
        self.rules.follow(setup)
        assert setup.injector is not None
        self.injector = setup.injector
        self.injector.start(setup.world, setup.supervisor.inbox.put_power, [self.rules.note])
        self.controller = setup.supervisor.controller
        place = HostEnvironment(FOLDER / "logs", FOLDER / "calibration.json", (), T_WALL, FOLDER)
        inspect = partial(running_inspection, spec.rover, setup.rover, place, setup.supervisor)
        about = {"start_delay_s": spec.rover.safety.start_delay_s}
        checks = [check for check in ARMING if check not in CALIBRATED]
        self.commands = RoverCommands(setup.supervisor, setup.rover.motors, inspect, self.rules, about, checks)
        self.run = asyncio.ensure_future(setup.supervisor.run())

    @property
    def running(self) -> bool:
        return not self.run.done()

    def pass_time(self, for_s: float) -> None:
        """Let time pass, and hear how commands and run have ended."""
        self._runner.run(asyncio.sleep(for_s))
        for task in [task for task in self._asked if task.done()]:
            self._asked.discard(task)
            error = task.exception()
            assert error is None or isinstance(error, RequestRefused | NotArmed), repr(error)
        if not self.running and (error := self.run.exception()) is not None:
            assert type(first_cause(error)).__name__ in REFUSALS, repr(error)

    def ask(self, verb: str, *args: float | str) -> None:
        """Ask for something; the answer may come later."""
        self._ask(verb, *args)
        self.pass_time(SOON_S)

    def _ask(self, verb: str, *args: float | str) -> None:
        permission = [Asked(self._runner.get_loop().time())] if verb in STARTING else []
        self._in_loop(lambda: self._asked.add(asyncio.ensure_future(getattr(self.commands, verb)(*permission, *args))))

    def drives(self, forward: float, turn: float, samples: int, every_s: float, stale_s: float) -> None:
        """A person holds keys for a while, over a link that takes its time; first they let go."""
        self.ask("manual_begin", "keys")
        self.lease = self.controller.manual._lease
        for forward_, turn_ in [(0.0, 0.0), *[(forward, turn)] * samples]:
            self._seq += 1
            sent_s = self._runner.get_loop().time() - stale_s
            self._ask("manual_drive", self.lease, self._seq, forward_, turn_, sent_s)
            self.pass_time(every_s)

    def begin(self, fault: Fault) -> int:
        """Begin a fault and return its number; 0: it lasts already."""
        if (fault.kind, fault.target) in {(each.kind, each.target) for each in self.lasting.values()}:
            return 0
        self._number += 1
        self.lasting[self._number] = fault
        self._in_loop(lambda: self.injector.begin(self._number, fault))
        return self._number

    def end(self, number: int) -> None:
        """End a fault that lasts."""
        self._in_loop(lambda: self.injector.end_fault(number, self.lasting.pop(number)))

    def end_oldest(self) -> None:
        """End the fault that has lasted longest."""
        if self.lasting:
            self.end(next(iter(self.lasting)))

    def _in_loop(self, act: Callable[[], object]) -> None:
        async def acted() -> None:
            act()

        self._runner.run(acted())

    def status(self) -> dict[str, Any]:
        return dict(self._runner.run(self.commands.status()))

    def power(self, flags: int | None) -> None:
        self.setup.supervisor.inbox.put_power(self._runner.get_loop().time(), flags)

    def close(self) -> None:
        """End the run, watch the wheels until they must stand, and end every fault."""

        async def end() -> None:
            self.setup.supervisor.finish("requested", "over")
            await asyncio.wait([self.run])
            await asyncio.sleep(self.rules.bound_s)
            self.injector.end()
            await asyncio.sleep(self.rules.bound_s)

        self._runner.run(end())
        self.pass_time(SOON_S)
        for task in self._asked:
            task.cancel()
        self._runner.close()


def going_wrong(*targets: str) -> Any:
    """A rule: any kind of fault at one of these; a bug that ends the run comes more seldom."""

    @precondition(lambda self: self.daemon.running)
    @rule(
        fault=st.one_of([faults(place, NOW_S) for place in PLACES if place.target in targets]), sure=st.integers(0, 4)
    )
    def something_goes_wrong(self: DaemonMachine, fault: Fault, sure: int) -> None:
        if (fault.kind, fault.target) in self.daemon.places and (fault.kind != "task_crash" or sure == 0):
            self.daemon.begin(fault)

    return something_goes_wrong


class DaemonMachine(RuleBasedStateMachine):
    """Faults, commands and time in any order."""

    daemon: Daemon

    @initialize(rover=st.sampled_from(ROVERS), depth=st.sampled_from(Depth), seed=st.integers(0, 10_000))
    def switch_on(self, rover: str, depth: Depth, seed: int) -> None:
        self.daemon = Daemon(rover, depth, seed)
        self.daemon.pass_time(1.0)
        self.daemon.ask("arm", 0.0)
        self.daemon.pass_time(3.0)

    def teardown(self) -> None:
        """Whatever lasts ends; the wheels must stand."""
        if hasattr(self, "daemon"):
            self.daemon.close()
            self.assert_rules()
            assert self.daemon.setup.world.commanded == (0.0, 0.0)

    # -- what may happen -----------------------------------------------------------------------------------------------

    @rule(for_s=st.floats(0.05, 20.0))
    def time_passes(self, for_s: float) -> None:
        self.daemon.pass_time(for_s)

    @precondition(lambda self: self.daemon.running)
    @rule(verb=st.sampled_from(("arm", "arm", "disarm", "hold", "resume")))
    def somebody_asks(self, verb: str) -> None:
        """A command comes, whether it makes sense or not."""
        self.daemon.ask(verb)

    @precondition(lambda self: self.daemon.running)
    @rule(heading_deg=st.floats(0.0, 359.0))
    def somebody_mends_all_and_arms(self, heading_deg: float) -> None:
        """The rover is to drive whatever was, and has time for it."""
        while self.daemon.lasting:
            self.daemon.end_oldest()
        self.daemon.ask("disarm")
        self.daemon.pass_time(2.0)
        self.daemon.ask("arm", heading_deg)
        self.daemon.pass_time(3.0)

    @precondition(lambda self: self.daemon.running)
    @rule(heading_deg=st.floats(0.0, 359.0))
    def somebody_heads_elsewhere(self, heading_deg: float) -> None:
        self.daemon.ask("goal", heading_deg)

    @precondition(lambda self: self.daemon.running)
    @rule(
        forward=st.floats(-1.0, 1.0),
        turn=st.floats(-1.0, 1.0),
        samples=st.integers(0, 20),
        every_s=st.floats(0.02, 0.5),
        stale_s=st.sampled_from((0.0, 0.0, 0.1, 0.29, 0.31, -0.5)),
    )
    def somebody_drives_by_hand(
        self, forward: float, turn: float, samples: int, every_s: float, stale_s: float
    ) -> None:
        """The client is killed then, or the next rule comes while it still drives."""
        self.daemon.drives(forward, turn, samples, every_s, stale_s)

    @precondition(lambda self: self.daemon.running)
    @rule(lease=st.booleans())
    def somebody_ends_it(self, lease: bool) -> None:
        self.daemon.ask("manual_end", self.daemon.lease if lease else 1)

    @precondition(lambda self: self.daemon.running)
    @rule(sure=st.integers(0, 9))
    def somebody_stops_the_run(self, sure: int) -> None:
        if sure == 0:
            self.daemon.ask("stop")

    @precondition(lambda self: self.daemon.running)
    @rule(
        fault=st.one_of([faults(FaultTarget(kind, "motors"), NOW_S) for kind in HEALS]),
        for_s=st.floats(0.05, 3.0),
        then_s=st.floats(0.0, 8.0),
    )
    def the_motor_board_fails_for_a_while(self, fault: Fault, for_s: float, then_s: float) -> None:
        """It is opened again while the mission waits, unless something else comes first."""
        if (fault.kind, fault.target) in self.daemon.places and (number := self.daemon.begin(fault)):
            self.daemon.pass_time(for_s)
            self.daemon.end(number)
            self.daemon.pass_time(then_s)

    a_sense_goes_wrong = going_wrong(*SENSES, "process")
    the_motors_go_wrong = going_wrong("motors")
    the_world_goes_wrong = going_wrong("world")

    @rule()
    def something_mends(self) -> None:
        self.daemon.end_oldest()

    @rule(flags=st.sampled_from(POWER_FLAGS))
    def supply_changes(self, flags: int | None) -> None:
        self.daemon.power(flags)

    @precondition(lambda self: not self.daemon.running)
    @rule(seed=st.integers(0, 10_000))
    def switched_on_again(self, seed: int) -> None:
        """A new run begins, elsewhere, and nothing arms it."""
        config, depth = self.daemon.setup.config, self.daemon.depth
        self.daemon.close()
        self.assert_rules()
        self.daemon = Daemon(config.name, depth, seed)
        self.daemon.pass_time(1.0)
        assert not self.daemon.running or self.daemon.controller.mode is Mode.DISARMED

    # -- what must hold ------------------------------------------------------------------------------------------------

    @invariant()
    def assert_rules(self) -> None:
        """No safety rule is broken, and no error went unseen."""
        if hasattr(self, "daemon"):
            wrong = [*self.daemon.rules.broken, *self.daemon.stray]
            assert not wrong, wrong[0]

    @invariant()
    def assert_status_is_what_the_controller_does(self) -> None:
        if not hasattr(self, "daemon"):
            return
        controller, told = self.daemon.controller, self.daemon.status()
        assert told["mode"] == controller.mode.value, f"the status says {told['mode']}, and it is {controller.mode}"
        assert (told["why_disarmed"] is None) == (controller.mode is not Mode.DISARMED)
        assert told["held"] == controller.held
        assert ("mission_s" in told) == (controller.mission is not None)
        assert controller.mode is Mode.MANUAL or (controller.mission is not None) == (controller.mode is Mode.ARMED)
        if told.get("wheels", [0.0, 0.0]) != [0.0, 0.0]:
            assert told["level"] not in {"hold", "fault"}
            levels = MANUAL_LEVELS if told["phase"] == "manual" else LEVELS
            assert told["cause"] is None or levels[Condition(told["cause"])] < Level.HOLD
        if not self.daemon.running:
            assert self.daemon.run.exception() is not None or self.daemon.run.result().reason


def machine_settings(examples: int, steps: int, **others: Any) -> settings:
    """How many interleavings, how long each."""
    return settings(
        max_examples=examples, stateful_step_count=steps, deadline=None, suppress_health_check=list(HealthCheck),
        print_blob=True, **others,
    )  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.faults.daemon_machine", description=__doc__)
    parser.add_argument("--examples", type=int, default=1000)
    parser.add_argument("--steps", type=int, default=50, help="of each example")
    asked = parser.parse_args()
    run_state_machine_as_test(DaemonMachine, settings=machine_settings(asked.examples, asked.steps, derandomize=False))
