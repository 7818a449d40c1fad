"""What is missing in the middle of a change, memory or a log: what stops the wheels has its effect all the same."""

from __future__ import annotations

from typing import Any

import pytest

from tests.control.bench import TICK_S, Bench, Wanting
from tests.control.test_controller_manual import driven
from tests.kit.workshop import EventLog
from wayfarer.control import controller
from wayfarer.control.modes import Mode
from wayfarer.escape.api import Decision, Observation
from wayfarer.hal import STOP
from wayfarer.safety.manual import LEASE_S


class Short(Wanting):
    """A handler that may find no memory."""

    is_short = False

    def decide(self, observation: Observation) -> Decision:
        if self.is_short:
            raise MemoryError
        return super().decide(observation)

    def reset(self) -> None:
        if self.is_short:
            raise MemoryError
        super().reset()


class ShortLog(EventLog):
    def event(self, name: str, t_s: float, **details: object) -> None:
        raise RuntimeError("can't start new thread")


async def test_rover_that_finds_no_memory_as_its_mission_begins_does_not_drive_without_limits() -> None:
    handler = Short()
    bench = Bench(handler)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    handler.is_short = True
    with pytest.raises(MemoryError):
        await bench.tick()
    assert set(bench.motors.commands) == {STOP}
    assert bench.motors.halts == 1


async def test_person_who_has_gone_while_memory_is_missing_leaves_a_mission_that_is_held(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_memory(*_: object) -> Any:
        raise MemoryError

    bench = (await driven(await Bench().armed())).bench
    await bench.tick(round((LEASE_S - 0.1) / TICK_S))
    assert bench.controller.mode is Mode.MANUAL
    with monkeypatch.context() as patch:
        patch.setattr(controller, "Entered", no_memory)
        await bench.tick(4)
    await bench.tick(20)
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(60)
    assert (bench.controller.mode, bench.controller.held, bench.wheels) == (Mode.ARMED, True, STOP)


async def test_tick_without_memory_counts_as_one_whose_wheels_stood() -> None:
    """They were halted. What was applied before it was counted once more, as driven."""
    handler = Short()
    bench = Bench(handler)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(5)
    handler.is_short = True
    await bench.tick()
    handler.is_short = False
    assert bench.wheels != STOP, "it has driven"
    await bench.tick(5)
    assert [tick.commanded for tick in bench.log.ticks[-5:]] == [STOP] * 5


async def test_rover_is_disarmed_though_its_log_fails() -> None:
    """No log may raise. One that cannot start a thread does, and the wheels went on after ``wayfarer disarm``."""
    bench = Bench(log=ShortLog())
    await bench.tick()
    with pytest.raises(RuntimeError):
        bench.controller.arm(bench.t_s, 0.0)
    with pytest.raises(RuntimeError):
        bench.controller.disarm(bench.t_s, "asked to")
    await bench.tick(2)
    assert (bench.controller.mode, bench.wheels) == (Mode.DISARMED, STOP)


async def test_single_ticks_without_memory_that_are_far_apart_end_no_mission() -> None:
    """Two within a minute ended the run, and the rover stood in the forest."""
    handler = Short()
    bench = Bench(handler)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(5)
    for _ in range(3):
        handler.is_short = True
        await bench.tick()
        handler.is_short = False
        await bench.tick(10)
        bench.controller.motors_opened(bench.t_s)
        await bench.tick(200)
        assert bench.wheels != STOP


async def test_tick_without_memory_ends_no_mission_though_its_log_finds_none_either() -> None:
    class LostLog(EventLog):
        def event(self, name: str, t_s: float, **details: object) -> None:
            if name == "motors_failed":
                raise MemoryError

    handler = Short()
    bench = Bench(handler, log=LostLog())
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(5)
    handler.is_short = True
    await bench.tick()
    assert bench.motors.halts == 1
    handler.is_short = False
    await bench.tick()
    assert (bench.controller.mode, bench.wheels) == (Mode.ARMED, STOP)
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(200)
    assert bench.wheels != STOP
