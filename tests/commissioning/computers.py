"""Four computers with simulated chips: ForestRover, MiniRover, a rover of neither, and an empty one."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

from tests.simhal.clearing import STEADY
from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.commissioning.first_rover import Inventory, look
from wayfarer.config.rover_file import RoverConfig, load_rover, parse_rover
from wayfarer.simhal.buses import FakeBuses, FakeI2C, FakeSPI
from wayfarer.simhal.chip_wiring import ChipWiring
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.world import World

BODY = """
name = "neither"
anomaly_source = "contact"
[vehicle]
length_m = 0.9
width_m = 0.6
track_m = 0.75
max_speed_m_s = 0.8
"""
NEITHER = f"""{BODY}
[parts.compass]
driver = "cmps14"
bus = "/dev/i2c-3"
address = 0x62
[parts.motors]
driver = "sabertooth"
port = "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"
"""
HEADER = ("/dev/i2c-1", "/dev/spidev0.0", "/dev/spidev0.1", "/dev/gpiochip0")


class WatchedI2C(FakeI2C):
    """Notes what is written, by address."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.written: set[tuple[int, bytes]] = set()

    async def write(self, address: int, data: bytes) -> None:
        self.written.add((address, data))
        await super().write(address, data)

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        self.written.add((address, data))
        return await super().write_read(address, data, count)

    write_then_read = write_read


class WatchedSPI(FakeSPI):
    """Notes what is sent."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.sent: set[bytes] = set()

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        self.sent |= set(pieces)
        return await super().transfer(*pieces)


class WatchedBuses(FakeBuses):
    I2C, SPI = WatchedI2C, WatchedSPI


class Machine:
    """A computer below a folder: its device files, and the chips of a rover on its buses."""

    def __init__(
        self,
        root: Path,
        runner: asyncio.Runner,
        rover: RoverConfig | None = None,
        devices: Sequence[str] = (),
        cameras: Sequence[str] = (),
    ) -> None:
        self.runner = runner
        self.host = HostEnvironment(root / "logs", root / "calibration.json", (), 1.8e9, root)
        self.buses = WatchedBuses()
        self._cameras = cameras
        for device in devices:
            self.file(device)
        if rover is not None:
            streams = RandomStreams(0)
            clock = runner.get_loop().time
            world = World(CLEARING, rover.vehicle, STEADY, streams, starts_s=clock())
            wiring = ChipWiring(world, streams, clock, self.buses)
            for part, table in rover.parts.items():
                wiring.attach(part, table)

    def file(self, path: str) -> Path:
        """Make an empty file, which stands for a device."""
        made = self.host.path(path)
        made.parent.mkdir(parents=True, exist_ok=True)
        made.touch()
        return made

    def look(self) -> Inventory:
        return self.runner.run(look(self.host, self.buses, lambda: self._cameras))


def forestrover(root: Path, runner: asyncio.Runner) -> Machine:
    return Machine(root, runner, load_rover("forestrover"), [*HEADER, "/dev/ttyAMA0"])


def minirover(root: Path, runner: asyncio.Runner) -> Machine:
    machine = Machine(root, runner, load_rover("minirover"), [*HEADER, "/dev/ttyS0"], ["imx219"])
    machine.host.path("/dev/serial0").symlink_to("ttyS0")
    return machine


def neither(root: Path, runner: asyncio.Runner) -> Machine:
    rover = parse_rover("neither.toml", NEITHER)
    machine = Machine(root, runner, rover, [*HEADER, "/dev/i2c-3", "/dev/ttyUSB0", "/dev/ttyAMA10"])
    machine.host.path("/dev/serial0").symlink_to("ttyAMA10")
    by_id = machine.host.path("/dev/serial/by-id/usb-FTDI_FT232R-if00-port0")
    by_id.parent.mkdir(parents=True)
    by_id.symlink_to("../../ttyUSB0")
    return machine


def empty(root: Path, runner: asyncio.Runner) -> Machine:
    return Machine(root, runner)
