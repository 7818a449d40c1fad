"""A simulated rover with parts that can be broken, on blocks or on the ground, and a person with a script."""

from __future__ import annotations

import asyncio
from asyncio import get_running_loop
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.kit.boards import now_s
from tests.simhal.clearing import STEADY, VEHICLE
from tests.virtual import run_virtually
from wayfarer.commissioning.calibrate import Operator, Step, calibrate
from wayfarer.commissioning.checks import Check, Finding, HostEnvironment, Inspection
from wayfarer.commissioning.checks.deadman import deadman_trips
from wayfarer.config.calibration_file import Calibration, load, save
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.drivers.cmps14 import CMPS14, CMPS14Settings
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import (
    CompassReading,
    ContactReading,
    DriveMotors,
    MotionReading,
    MotorHealth,
    Rover,
    Side,
    WheelCommand,
)
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.cmps14 import CMPS14Chip
from wayfarer.simhal.chips.motor_boards import SabertoothChip, ThunderBorgChip
from wayfarer.simhal.parts import SimBumper, SimCompass, SimFlow, SimMotors
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import HeadingSensorModel
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.world import World

T_WALL = 1_795_000_000.0  # 18 November 2026


class WatchedWorld(World):
    """Remembers how hard its wheels were ever told to turn."""

    most = 0.0

    def __init__(self) -> None:
        super().__init__(CLEARING, VEHICLE, STEADY, RandomStreams(0))

    def command(self, left: float, right: float) -> None:
        self.most = max(self.most, abs(left), abs(right))
        super().command(left, right)


class Breakable:
    """A part that does not answer while it is ``dead``; ``error`` is what it raises then."""

    name: str
    dead = False
    error: BaseException | None = None

    async def open(self) -> None:
        self.refuse_if_dead()
        await super().open()  # type: ignore[misc]  # the simulated part's, which this is mixed into

    def refuse_if_dead(self) -> None:
        if self.dead:
            raise self.failure

    @property
    def failure(self) -> BaseException:
        return self.error or NotResponding(f"{self.name}: no answer")


class Board(Breakable, SimMotors):
    """A motor board with a deadman that works or not, can be asked or not, and may fall silent at its n-th command."""

    name = "board at 0x15 on /dev/i2c-1"
    deadman_s: float | None = 0.25
    trips = True
    tells = True
    health_now = MotorHealth(12.0, ())
    fails_at = 10**9
    stop_takes_s = 0.0
    halts = 0

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._heard_s = 0.0
        self.commands: list[WheelCommand] = []

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self.commands.append(command)
        if len(self.commands) >= self.fails_at:
            raise self.failure
        self._heard_s = self._time()
        return await super().drive(command)

    async def stop(self) -> None:
        await asyncio.sleep(self.stop_takes_s)
        await super().stop()

    def halt(self) -> None:
        self.halts += 1
        super().halt()

    async def read_back(self) -> WheelCommand | None:  # type: ignore[override]
        now_s = asyncio.get_running_loop().time()
        if self.trips and self.deadman_s is not None and now_s > self._heard_s + self.deadman_s:
            self._world.command(0.0, 0.0)
        return WheelCommand(*self._world.commanded) if self.tells else None

    async def health(self) -> MotorHealth:
        return self.health_now


class Needle(Breakable, SimCompass):
    """A compass that reads what the test says, if it says something."""

    name = "CMPS14 at 0x60 on /dev/i2c-1"
    level: int | None = 3
    tilt_deg = 0.0
    bias_deg: Callable[[], float] = staticmethod(lambda: 0.0)

    async def read(self) -> CompassReading:
        self.refuse_if_dead()
        reading = await super().read()
        heading_deg = (reading.heading_deg + self.bias_deg()) % 360.0
        return reading._replace(heading_deg=heading_deg, roll_deg=self.tilt_deg, calibration=self.level)


class Flow(Breakable, SimFlow):
    """A motion sensor mounted, and seeing, as the test says; on blocks the ground does not move."""

    name = "PMW3901 on /dev/spidev0.1"
    quality = 0.8
    ahead, aside = 1.0, 0.0
    on_blocks = False

    async def read(self) -> MotionReading:
        self.refuse_if_dead()
        reading = await super().read()
        forward_m = 0.0 if self.on_blocks else reading.forward_m
        return reading._replace(forward_m=self.ahead * forward_m, right_m=self.aside * forward_m, quality=self.quality)


class Bumper(SimBumper):
    """A bumper that may be pressed."""

    sides: tuple[Side, ...] = ()

    async def read(self) -> ContactReading:
        return (await super().read())._replace(sides=self.sides)


class Rig:
    """A whole healthy rover in virtual time, and everything around it."""

    def __init__(self, folder: Path) -> None:
        self.world = WatchedWorld()
        streams = RandomStreams(0)
        self.motors, self.compass = Board(self.world), Needle(self.world, streams)
        self.motion, self.contact = Flow(self.world, streams), Bumper(self.world)
        self.rover = Rover(self.compass, self.motors, self.motion, self.contact)
        self.config: RoverConfig = load_rover("sim")
        self.host = HostEnvironment(folder / "logs", folder / "state" / "calibration.json", (), T_WALL, folder)
        for node in ("dev/i2c-1", "dev/spidev0.1"):
            (folder / node).parent.mkdir(exist_ok=True)
            (folder / node).touch()

    def inspection(self) -> Inspection:
        """The rover as ``wayfarer check`` sees it."""
        return Inspection(self.config, self.rover, self.host, self.kept)

    def look(self, check: Check) -> Finding:
        """Return what a check finds; the wheels are stopped afterwards, and every part is closed."""

        async def main() -> Finding:
            async with self.inspection() as inspection:
                return await check(inspection)

        found = run_virtually(main())
        assert self.world.commanded == (0.0, 0.0)
        return found

    def calibrate(self, someone: Operator, *steps: Step) -> Calibration:
        """Return what is known after these steps; the wheels are stopped afterwards, whatever happens."""
        try:
            return run_virtually(calibrate(self.config, self.rover, self.host, self.kept, someone, steps))
        finally:
            assert self.world.commanded == (0.0, 0.0)

    def cancel(self, doing: Coroutine[Any, Any, object], *after_s: float) -> None:
        """Begin something, cancel it after each of these times, and see that the wheels are stopped for good."""

        async def main() -> None:
            task = asyncio.ensure_future(doing)
            for wait_s in after_s:
                await asyncio.sleep(wait_s)
                assert not task.done()
                task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task

        run_virtually(main())
        assert self.world.commanded == (0.0, 0.0)

    def set(self, **settings: Any) -> None:
        """Change sections of the rover file: ``safety={"duty_max": 0.3}``."""
        changed = {key: replace(getattr(self.config, key), **values) for key, values in settings.items()}
        self.config = self.config.model_copy(update=changed)

    @property
    def kept(self) -> Calibration:
        """What is in the calibration file."""
        return load(self.host.calibration_file)

    def keep(self, **entries: Any) -> None:
        """Replace the calibration file."""
        save(self.host.calibration_file, Calibration(**entries))


class ChipRig(Rig):
    """The rover with the real driver of its compass and of one of two motor boards, over simulated chips."""

    def __init__(self, folder: Path, compass_chip: type[CMPS14Chip] = CMPS14Chip) -> None:
        super().__init__(folder)
        self.buses = FakeBuses()
        self.compass_chip = compass_chip(HeadingSensorModel(self.world, RandomStreams(0)), now_s)
        self.thunderborg = ThunderBorgChip(self.world, now_s)
        self.sabertooth = SabertoothChip(self.world, now_s)
        self.buses.i2c("/dev/i2c-1").attach(0x60, self.compass_chip)
        self.buses.i2c("/dev/i2c-1").attach(0x15, self.thunderborg)
        self.drive_by(ThunderBorg(ThunderBorgSettings(), self.buses))

    def drive_by(self, board: DriveMotors) -> None:
        """Use that board's driver."""
        self.rover = Rover(CMPS14(CMPS14Settings(), self.buses), board)

    def drive_by_sabertooth(self, settings: SabertoothSettings) -> None:
        """Use the Sabertooth."""
        self.buses.serial(settings.port).attach(self.sabertooth)
        self.drive_by(Sabertooth(settings, self.buses))


class Script:
    """A person who answers by the first key that is in the question, and does what the rig needs done meanwhile.

    ``does`` maps a part of a text to a coroutine function that is run while the software waits for the answer. Nobody
    is ever asked anything while the wheels turn.
    """

    def __init__(
        self, world: World, answers: dict[str, bool], does: dict[str, Callable[[], Awaitable[None]]] | None = None
    ) -> None:
        self._world, self._answers, self._does = world, answers, does or {}
        self.number_given = 2.0
        self.told: list[str] = []

    async def watch_the_deadman(self, inspection: Inspection) -> Finding:
        """A check: see whether the deadman trips."""
        await inspection.open("motors")
        return await deadman_trips(self.ask, inspection)

    async def say(self, text: str) -> None:
        self.told.append(text)

    async def ask(self, question: str) -> bool:
        await self.wait(question)
        return next((answer for key, answer in self._answers.items() if key in question), True)

    async def number(self, question: str, default: float) -> float:
        self.told.append(question)
        return self.number_given

    async def wait(self, text: str) -> None:
        assert self._world.commanded == (0.0, 0.0), f"the wheels turn while a person is asked: {text}"
        self.told.append(text)
        for key, deed in self._does.items():
            if key in text:
                await deed()


async def push_by_hand(world: World, distance_m: float) -> None:
    for _ in range(20):
        await asyncio.sleep(0.1)
        world.advance_to(get_running_loop().time())
        if distance_m > 0.0:
            world.forward_m += distance_m / 20
        else:
            world.reverse_m -= distance_m / 20
    await asyncio.sleep(0.1)
