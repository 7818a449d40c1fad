"""A tick over motors that never wait is done without a coroutine: it must do the same."""

from __future__ import annotations

import asyncio
from math import nan

import pytest

from tests.control.bench import TICK_S, Bench, Wanting
from tests.kit.motors import Motors
from tests.virtual import virtual
from wayfarer.control.rate import Clock
from wayfarer.errors import NotResponding, PowerLost
from wayfarer.escape.api import Decision, Observation
from wayfarer.hal import WheelCommand


class Answering(Motors):
    """Say that they applied ``answer``, if there is one."""

    answer: WheelCommand | None = None

    async def drive(self, command: WheelCommand) -> WheelCommand:
        return self.answer or await super().drive(command)


class Immediate(Answering):
    """The same without waiting."""

    async def drive(self, command: WheelCommand) -> WheelCommand:
        raise AssertionError("it need not have waited")

    def drive_without_waiting(self, now_s: float, command: WheelCommand) -> WheelCommand:
        if self.error is not None:
            raise self.error
        if self.answer is None:
            self.commands.append(command)
        self.heard()
        return self.answer or command

    def heard(self) -> None: ...


class BenchClock(Clock):
    def __init__(self, bench: Bench) -> None:
        self.bench = bench

    def time(self) -> float:
        return self.bench.t_s + self.bench.suspended_s


class BenchAtOnce(Bench):
    async def do_tick(self) -> None:
        assert self.loop.at_once(BenchClock(self)) is (self.end is None)


class Short(Wanting):
    """A handler that may find no memory, or whose process is suspended while it decides."""

    bench: Bench
    is_short = is_suspended = False

    def decide(self, observation: Observation) -> Decision:
        if self.is_short:
            raise MemoryError
        self.bench.suspended_s = 1.0 if self.is_suspended else 0.0
        return super().decide(observation)


async def played(kind: type[Bench], motors: Answering) -> list[object]:
    """Everything that can go wrong with a tick, and what followed from it."""
    handler, said = Short(), list[object]()
    bench = handler.bench = kind(handler, motors)
    bench.motors = motors
    await bench.armed()

    async def tick(ticks: int = 2) -> None:
        await bench.tick(ticks)
        last = bench.log.ticks[-1]
        said.append((last.t_s, last.applied, bench.health, motors.halts, list(motors.commands), str(bench.log.events)))

    async def again() -> None:
        bench.controller.motors_opened(bench.t_s)
        await tick(round(3.0 / TICK_S))

    await tick()
    for error in (NotResponding("gone"), PowerLost("no power")):
        motors.error = error
        await tick()
        motors.error = None
        await again()
    motors.answer = WheelCommand(nan, 0.5)
    await tick()
    motors.answer = None
    await again()
    handler.is_suspended = True
    await tick(1)
    handler.is_suspended, bench.suspended_s, handler.is_short = False, 0.0, True
    await tick(1)
    bench.controller.finish("requested", "enough")
    said.append(bench.end)
    return said


async def test_tick_at_once_does_the_same() -> None:
    said = await played(BenchAtOnce, Immediate())
    assert said == await played(Bench, Answering())
    assert len({str(what) for what in said}) == len(said), "each has an effect"


@pytest.mark.parametrize("when", ["in a tick", "between two ticks"])
@virtual
async def test_run_over_such_motors_ends_as_any(when: str) -> None:
    loop, motors = asyncio.get_running_loop(), Immediate()
    motors.drive = lambda command: asyncio.sleep(0.0, command)  # type: ignore[method-assign]  # of the first tick
    bench = Bench(wheels=motors)
    if when == "in a tick":
        motors.heard = lambda: bench.controller.finish("requested", "enough") if loop.time() >= 1.0 else None  # type: ignore[method-assign]
    else:
        loop.call_at(0.99, bench.controller.finish, "requested", "enough")
    end = await bench.loop.run(20.0)
    assert (end.reason, loop.time(), len(motors.commands)) == ("requested", 1.0, 20 if when == "in a tick" else 19)
