"""A whole simulated rover under its daemon's commands, in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from functools import wraps
from random import Random
from typing import Any

import msgspec

from tests.kit.rover import Rig
from tests.kit.workshop import EventLog
from tests.virtual import asked, virtual
from wayfarer.commissioning.checks import ARMING, Inspection
from wayfarer.control.supervisor import Supervisor
from wayfarer.daemon.arming_check import running_inspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.errors import DriverError
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.mission import RunEnd

ABOUT = {"version": "1", "rover": "sim", "algorithm": "pledge", "log": "logs/00001", "start_delay_s": 2.0,
         "simulated": True, "dry_run": False, "last_mission": None}  # fmt: skip
DELAY_S = 2.0


class Run:
    """A rover and its commands; while it is entered (``async with``), its daemon runs, at first for ``after_s``."""

    running: asyncio.Task[RunEnd]

    def __init__(self, rig: Rig, algorithm: str = "pledge", *, after_s: float = 1.0) -> None:
        self.rig = rig
        self.after_s = after_s
        self.log = EventLog()
        safety = rig.config.model_dump()["safety"] | {"start_delay_s": DELAY_S}
        config = type(rig.config).model_validate(rig.config.model_dump() | {"safety": safety})
        chosen = CATALOGUE[algorithm]
        handler = chosen.make(config.escape, config.vehicle, Random(0))
        self.supervisor = Supervisor(rig.rover, config, chosen, handler, self.log, ladder_seed=1)
        self.config = config
        self.calibration = rig.kept  # as the daemon reads it, at its start
        self.commands = RoverCommands(self.supervisor, rig.motors, self.inspect, self.log, ABOUT, ARMING)

    def inspect(self, motors_failed: DriverError | None = None) -> Inspection:
        rig = self.rig
        return running_inspection(self.config, rig.rover, rig.host, self.supervisor, motors_failed, self.calibration)

    async def __aenter__(self) -> Run:
        self.running = asyncio.create_task(self.supervisor.run())
        await asyncio.sleep(self.after_s)
        return self

    async def __aexit__(self, *_: object) -> None:
        self.supervisor.finish("over", "the test is over")
        await self.running
        assert self.wheels == STOP

    @property
    def wheels(self) -> WheelCommand:
        return WheelCommand(*self.rig.world.commanded)

    @property
    def mode(self) -> str:
        return self.supervisor.mode.value

    async def status(self) -> dict[str, Any]:
        """What a client would get."""
        told: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(await self.commands.status()))
        return told

    async def arm(self, heading_deg: float | None = 0.0) -> None:
        """Arm a moment later, and drive for a second."""
        await asyncio.sleep(0.001)
        await self.commands.arm(asked(), heading_deg)
        await asyncio.sleep(DELAY_S + 1.0)
        assert self.mode == "armed"
        assert self.wheels != STOP


def played(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Run a test in virtual time, on a rover (the fixture ``run``) whose daemon has run for a second."""

    @wraps(test)
    async def play(run: Run, **others: Any) -> None:
        async with run:
            await test(run=run, **others)

    return virtual(play)
