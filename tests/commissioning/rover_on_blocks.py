"""A simulated rover on blocks, its real drivers under the real checks, and a person who says what they see of it.

Virtual time: a check of half a minute takes a fraction of a second.
"""

from __future__ import annotations

import asyncio
import re
import tempfile
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import TypeVar

from tests.simhal.clearing import CLEARING
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import Finding, HostEnvironment, check
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.hal import Rover
from wayfarer.simhal.build_rover import Depth, build
from wayfarer.simhal.faults.injector import Injector
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.hil_server import RecordedWorld
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.simulated_world import SimulatedWorld

ROVER = "forestrover"
T_WALL = 1_795_000_000.0  # November 2026
TURNS_M_S = 0.02
PUSHED_M = 0.5
STEPS = 20
STEP_S = 0.1
ANSWER_S = 1.0

T = TypeVar("T")


class OnBlocks(RecordedWorld):
    """A world whose rover stands on blocks: its wheels turn, and move no body."""

    def _move(self, forward_m: float, turn_rad: float) -> bool:
        return True


class Onlooker:
    """A person beside the rover, who does as told and answers by what the wheels did last; implements ``Person``."""

    def __init__(self, world: RecordedWorld) -> None:
        self._world = world
        self._most = {"left": 0.0, "right": 0.0}
        self._still = True
        self._turned_s = 0.0
        step = world.after_step

        def look(moved: SimulatedWorld) -> None:
            self._look()
            step(moved)

        world.after_step = look

    def _look(self) -> None:
        speeds = dict(zip(self._most, self._world.wheels_m_s, strict=True))
        still = max(map(abs, speeds.values())) < TURNS_M_S
        if self._still and not still:
            self._most, self._turned_s = dict.fromkeys(self._most, 0.0), 0.0
        if not still:
            self._turned_s += Physics().step_s
        for side, speed in speeds.items():
            if abs(speed) > abs(self._most[side]):
                self._most[side] = speed
        self._still = still

    async def ask(self, question: str) -> bool:
        """Answer, a moment after the wheels have come to rest."""
        await asyncio.sleep(ANSWER_S)
        if "push it" in question:
            await self._push()
            return True
        if asked := re.search(r"Did they turn for about ([\d.]+) s, and not for ([\d.]+) s", question):
            well_s, longest_s = map(float, asked.groups())
            return abs(self._turned_s - well_s) < abs(self._turned_s - longest_s)
        if asked := re.search(r"Did the (left|right) wheels turn", question):
            return self._as_asked(asked[1], question)
        return True

    def _as_asked(self, side: str, question: str) -> bool:
        speed, other = self._most[side], self._most["right" if side == "left" else "left"]
        if "instead" in question:
            return abs(speed) > TURNS_M_S
        wanted = -speed if "back?" in question else speed
        return wanted > TURNS_M_S and ("only they" not in question or abs(other) < TURNS_M_S)

    async def _push(self) -> None:
        for _ in range(STEPS):
            await asyncio.sleep(STEP_S)
            self._world.forward_m += PUSHED_M / STEPS

    async def say(self, text: str) -> None:
        """Hear it."""

    async def number(self, question: str, default: float) -> float:
        """Give the number that is offered."""
        return default

    async def note(self, question: str) -> str:
        """Note nothing."""
        return ""

    async def wait(self, text: str) -> None:
        """Do nothing more."""


class Workbench:
    """What stands on the blocks, made on the running loop.

    Args:
        faults: of the world, from the beginning to the end.
        config: the rover file; ``mounted`` is how the parts really are, where that is different.
        folder: for the rover's own files.
    """

    def __init__(self, faults: Sequence[Fault], config: RoverConfig, mounted: RoverConfig, folder: Path) -> None:
        streams, loop = RandomStreams(0), asyncio.get_running_loop()
        self.config = config
        self.world = OnBlocks(CLEARING, config.vehicle, Physics(), streams)
        self.person = Onlooker(self.world)
        injector = Injector(faults, mounted, 0)
        build(Depth.BUS, self.world, streams, mounted, loop.time, injector.buses)
        self.rover: Rover = assemble(config, injector.buses)
        self.host = HostEnvironment(folder / "logs", folder / "calibration.json", (), T_WALL, folder)
        injector.start(self.world, lambda *_: None, lambda *_, **__: None)
        self._pass_time()

    def _pass_time(self) -> None:
        """Let the world go on while nobody reads a sensor."""
        loop = asyncio.get_running_loop()
        self.world.tick_chips()
        self.world.advance_to(loop.time())
        loop.call_later(STEP_S / 2, self._pass_time)

    async def check(self) -> dict[str, Finding]:
        """Return what `wayfarer check` finds, with the person beside it."""
        return {found.name: found for found in await check(self.config, self.rover, self.host, self.person.ask)}


def at_workbench(
    do: Callable[[Workbench], Awaitable[T]], faults: Sequence[Fault] = (), mounted: RoverConfig | None = None
) -> T:
    """Do something with a rover on blocks, in virtual time, and return what came of it."""
    config = load_rover(ROVER)

    async def main(folder: str) -> T:
        return await do(Workbench(faults, config, mounted or config, Path(folder)))

    with tempfile.TemporaryDirectory(prefix="wf-") as folder:
        return run_virtually(main(folder))
