"""A third party's compass, as it would be installed beside wayfarer: a made-up part, its driver, its simulated chip."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from struct import Struct
from typing import ClassVar

from wayfarer.drivers.buses import Buses
from wayfarer.errors import WrongPart
from wayfarer.hal import CompassReading
from wayfarer.simhal.sensor_models import HeadingSensorModel
from wayfarer.testing import ChipWiring, RegisterChip, SimulatedChip

WHO_AM_I, ATTITUDE, IDENTITY = 0x0F, 0x10, 0x9C
BLOCK = Struct(">Hhh")  # heading, pitch, roll in tenths of a degree
STARTS_S = 0.2


@dataclass(frozen=True)
class XC9Settings:
    bus: str = "/dev/i2c-1"
    address: int = 0x1E


class XC9:
    part: ClassVar[str] = "compass"
    name = "XC9"
    Settings = XC9Settings

    def __init__(self, settings: XC9Settings, buses: Buses) -> None:
        self._bus, self._address = buses.i2c(settings.bus), settings.address

    async def open(self) -> None:
        (identity,) = await self._bus.write_then_read(self._address, bytes((WHO_AM_I,)), 1)
        if identity != IDENTITY:
            raise WrongPart(self.name, "an XC9", f"identity {identity:02X}")
        await self.read()
        await asyncio.sleep(STARTS_S)

    async def read(self) -> CompassReading:
        block = await self._bus.write_then_read(self._address, bytes((ATTITUDE,)), BLOCK.size)
        heading, pitch, roll = BLOCK.unpack(block)
        return CompassReading(asyncio.get_running_loop().time(), heading / 10.0, pitch / 10.0, roll / 10.0, 3)

    async def close(self) -> None:
        pass


class LooseXC9(XC9):
    """As in a file beside the rover file: it names its chip itself."""

    simulated_chip: ClassVar[str] = "tests.simhal.third_party_compass:XC9_CHIP"


REGISTERS = {WHO_AM_I: IDENTITY, **dict.fromkeys(range(ATTITUDE, ATTITUDE + BLOCK.size), 0)}


def attach(settings: XC9Settings, wiring: ChipWiring) -> None:
    sense = HeadingSensorModel(wiring.world, wiring.streams)

    def measure(wanted: range) -> None:
        if ATTITUDE in wanted:
            chip.put(ATTITUDE, BLOCK.pack(*sense.sample(wiring.sense_clock())))

    chip = RegisterChip("XC9", REGISTERS, read_only=REGISTERS, before_read=measure)
    wiring.buses.i2c(settings.bus).attach(settings.address, chip)


XC9_CHIP = SimulatedChip(attach, lambda _: {"opens_s": STARTS_S})
