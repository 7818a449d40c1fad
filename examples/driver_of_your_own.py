"""A driver of your own: a BlinkM, an RGB light on I2C, checked as wayfarer's own drivers are.

Its data sheet: 'Z' asks for the firmware's version, 'n' and three bytes set the colour. In a rover file it is
[parts.light] with driver = "driver_of_your_own:BlinkM". Run it: python examples/driver_of_your_own.py
"""

import asyncio
from dataclasses import dataclass
from types import SimpleNamespace

from wayfarer.drivers.buses import Buses
from wayfarer.hal import Colour
from wayfarer.testing import FakeBuses, check_status_light


class BlinkM:
    part, name = "light", "BlinkM"

    @dataclass(frozen=True)
    class Settings:
        address: int = 0x09

    def __init__(self, settings: Settings, buses: Buses) -> None:
        self._bus, self._address = buses.i2c("/dev/i2c-1"), settings.address

    async def open(self) -> None:
        await self._bus.write_then_read(self._address, b"Z", 2)  # speak to the part: a missing one is told here

    async def show(self, colour: Colour) -> None:
        await self._bus.write(self._address, b"n" + bytes(round(255 * part) for part in colour))

    async def close(self) -> None:
        pass  # nothing is held; a close never raises


if __name__ == "__main__":
    with_chip, settings = FakeBuses(), BlinkM.Settings()
    with_chip.i2c("/dev/i2c-1").attach(0x09, SimpleNamespace(write=print, read=bytes))  # prints what reaches it
    asyncio.run(check_status_light(lambda: BlinkM(settings, with_chip), lambda: BlinkM(settings, FakeBuses())))
