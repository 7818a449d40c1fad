"""The simulated rover of ``wayfarer run --sim``: its world begins with the daemon, and the run ends outside."""

from __future__ import annotations

import asyncio
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.virtual import asked, run_virtually
from wayfarer.config.rover_file import load_rover
from wayfarer.control.run_log import Tee
from wayfarer.control.supervisor import Supervisor
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import FaultInjected
from wayfarer.fieldlog.sink import Sink
from wayfarer.run_sim import simulated_rover_setup
from wayfarer.safety.mission import RunEnd
from wayfarer.simhal.faults.kinds import parse_fault
from wayfarer.simhal.world.physics import Depth, Physics
from wayfarer.simhal.world.world import World

UPTIME_S = 86_400.0  # a desk computer's clock does not begin at 0


@cache
def run_on_a_desk(depth: Depth = Depth.DEVICE, seed: int = 1, for_s: float = 1e5) -> tuple[RunEnd, float]:
    """Run the daemon's supervisor until the simulated rover ends it; return how it ended and after how long."""

    async def main() -> tuple[RunEnd, float]:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(UPTIME_S)
        config = load_rover("sim")
        supervisors: list[Supervisor] = []
        rover_setup = simulated_rover_setup(
            config, depth, seed, lambda reason, text: supervisors[0].finish(reason, text)
        )
        algorithm = CATALOGUE["forest-pledge"]
        handler = algorithm.make(config.escape, config.vehicle, Random(seed))
        supervisors.append(Supervisor(rover_setup.rover, config, algorithm, handler, Tee(), ladder_seed=1))
        await supervisors[0].arm(asked(), 0.0)
        loop.call_later(for_s, supervisors[0].finish, "requested", "enough")
        return await supervisors[0].run(), loop.time() - UPTIME_S

    return run_virtually(main())


@pytest.mark.parametrize("depth", Depth)
def test_rover_that_is_out_ends_the_run_and_says_how_far_it_went(depth: Depth) -> None:
    end, took_s = run_on_a_desk(depth)
    assert end.reason == "escaped"
    assert end.text.startswith("the simulated rover has escaped after ")
    path_m = float(end.text.split()[-2])
    assert 37.5 <= path_m < took_s * 1.4


def test_world_begins_when_the_rover_is_made_and_not_when_the_computer_was_switched_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    worlds: list[World] = []

    def remembered(*parts: Any, **settings: Any) -> World:
        worlds.append(World(*parts, **settings))
        assert worlds[0].t_s == UPTIME_S
        return worlds[0]

    monkeypatch.setattr("wayfarer.run_sim.World", remembered)
    end, took_s = run_on_a_desk(for_s=5.0)
    assert end == RunEnd("requested", "enough")
    assert took_s == pytest.approx(5.0, abs=0.1)
    assert worlds[0].steps == pytest.approx(5.0 / Physics().step_s, abs=2)


def test_both_depths_give_the_same_drive() -> None:
    assert run_on_a_desk(Depth.DEVICE)[0] == run_on_a_desk(Depth.BUS)[0]


def test_fault_strikes_so_many_seconds_after_the_first_arming(tmp_path: Path) -> None:
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s)

    async def main() -> None:
        loop = asyncio.get_running_loop()
        config, faults = load_rover("sim"), [parse_fault("silent:compass@3+2")]
        rover_setup = simulated_rover_setup(config, Depth.DEVICE, 1, lambda *_: None, faults)
        assert rover_setup.ground_truth_log is not None
        algorithm = CATALOGUE["forest-pledge"]
        handler = algorithm.make(config.escape, config.vehicle, Random(1))
        logs = Tee(log, rover_setup.ground_truth_log(log))
        supervisor = Supervisor(rover_setup.rover, config, algorithm, handler, logs, goes_on=True, ladder_seed=1)
        running = loop.create_task(supervisor.run())
        await asyncio.sleep(10.0)  # disarmed
        for _ in range(2):
            await supervisor.arm(asked(), 0.0)
            await asyncio.sleep(8.0)
            supervisor.disarm("for a while")
        supervisor.finish("requested", "enough")
        await running

    run_virtually(main())
    faults: list[tuple[object, bool]] = [
        (each.t_s, each.begins) for each in RunReader(tmp_path) if isinstance(each, FaultInjected)
    ]
    assert faults == [(pytest.approx(13.0, abs=0.05), True), (pytest.approx(15.0, abs=0.05), False)]


def test_seed_is_another_forest() -> None:
    assert run_on_a_desk(Depth.DEVICE) != run_on_a_desk(Depth.DEVICE, seed=2)
