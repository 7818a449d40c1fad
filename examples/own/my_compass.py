"""A driver of your own; as it is, it is of a made-up compass on I2C. Put your part's data sheet in its place.

    pytest test_my_compass.py
    wayfarer sim --rover forestrover --depth bus --set parts.compass.driver=my_compass.py --trials 3

In a rover file it is [parts.compass] with driver = "my_compass.py"; then `wayfarer check` tries the real part. The
simulated chip is in test_my_compass.py, which the rover does not need. For another kind of part, such as motors, change
``part``, and give the class the methods of that kind in wayfarer.hal.
"""

import asyncio
from dataclasses import dataclass
from struct import Struct
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.hal import CompassReading

WHO_AM_I, IDENTITY = b"\x0f", 0x9C  # register, and what a MyCompass has there (data sheet, page 1)
ATTITUDE = b"\x10"  # register of the block below (page 2)
BLOCK = Struct(">HhhB")  # heading, pitch and roll in tenths of a degree, and 0 to 3: how well it is calibrated


@dataclass(frozen=True)
class MyCompassSettings:
    """What a person may write into [parts.compass], beside the driver; a value outside of its range is refused."""

    bus: str = "/dev/i2c-1"
    """Device file of the I2C bus."""
    address: Annotated[int, Interval(ge=0x08, le=0x77)] = 0x60
    """I2C address, 7-bit."""
    heading_offset_deg: Annotated[float, Interval(ge=-180, le=180)] = 0.0
    """Added to the heading, for a part that is mounted across."""


class MyCompass:
    """The made-up compass as ``wayfarer.hal.Compass``."""

    part: ClassVar[str] = "compass"
    simulated_chip: ClassVar[str] = "test_my_compass.py:CHIP"  # for --depth bus
    Settings = MyCompassSettings

    def __init__(self, settings: MyCompassSettings, buses: Buses) -> None:
        """Keep what was given: no bus is used before ``open``."""
        self._settings, self._bus = settings, buses.i2c(settings.bus)
        self.name = f"MyCompass at 0x{settings.address:02X} on {settings.bus}"  # for messages and the log

    async def open(self) -> None:
        """Speak to the part for the first time: report a missing or a different one here."""
        try:
            (identity,) = await self._bus.write_read(self._settings.address, WHO_AM_I, 1)
        except NotResponding as error:
            raise NotResponding(f"{self.name}: no answer ({error}); check power, wires and address") from error
        if identity != IDENTITY:
            raise WrongPart(self.name, "a MyCompass", f"identity 0x{identity:02X}")
        await self.read()

    async def read(self) -> CompassReading:
        """Return what it measures now; called 20 times per second; the bus raises ``NotResponding`` itself."""
        block = await self._bus.write_read(self._settings.address, ATTITUDE, BLOCK.size)
        heading, pitch, roll, calibrated = BLOCK.unpack(block)
        if heading >= 3600 or abs(pitch) > 1800 or abs(roll) > 1800 or calibrated > 3:
            raise BadReading(f"{self.name}: {block.hex(' ')} cannot be true")  # dropped; the rover waits for the next
        return CompassReading(
            t_s=asyncio.get_running_loop().time(),
            heading_deg=(heading / 10.0 + self._settings.heading_offset_deg) % 360.0,  # clockwise from magnetic north
            pitch_deg=pitch / 10.0,  # positive: nose up
            roll_deg=roll / 10.0,  # positive: right side down
            calibration=calibrated,  # 0 to 3; None if a part does not say it
        )

    async def close(self) -> None:
        """Nothing to release; it never raises."""
