"""Simulated buses with simulated chips, for the real drivers at bus depth.

A chip speaks whole transactions, as on the wire. It declares what it understands; an undeclared register, a wrong
length, a device that is not there or two at one address are mistakes in the driver or in the simulated rover, and fail
loudly. Transfers take no simulated time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from wayfarer.drivers.buses import ANSWER_WITHIN_S, CLOSE_WAIT_S, Camera, Frame, Missing, whole
from wayfarer.errors import NotResponding
from wayfarer.simhal.pins import FakePins


class ChipMisuse(AssertionError):
    """A transfer that the chip's datasheet does not know: a mistake in a driver, or in the rig."""


class I2CChip(Protocol):
    """A chip on an I2C bus."""

    def write(self, data: bytes) -> None:
        """Take the bytes of one write."""

    def read(self, count: int) -> bytes:
        """Give the bytes of one read."""


class SPIChip(Protocol):
    """A chip on an SPI bus."""

    def exchange(self, data: bytes) -> bytes:
        """Take the bytes of one chip-select period and give as many."""


class SerialChip(Protocol):
    """A chip on a serial line."""

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any length, and return what the chip sends now; nothing if it only listens."""


class FakeI2C:
    """An I2C bus with chips on it; implements ``drivers.buses.I2CBus``."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._chips: dict[int, I2CChip] = {}

    def attach(self, address: int, chip: I2CChip) -> None:
        """Put a chip at an address."""
        if address in self._chips:
            raise ChipMisuse(f"{self.name}: two chips at 0x{address:02X}")
        self._chips[address] = chip

    async def write(self, address: int, data: bytes) -> None:
        """Write to the chip at an address."""
        self.chip_at(address).write(data)

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, then read."""
        return self._transfer(address, data, count)

    write_then_read = write_read

    def _transfer(self, address: int, data: bytes, count: int) -> bytes:
        chip = self.chip_at(address)
        chip.write(data)
        return chip.read(count)

    def post(self, address: int, data: bytes) -> None:
        """Write at once."""
        with suppress(NotResponding):
            self.chip_at(address).write(data)

    def chip_at(self, address: int) -> I2CChip:
        """Return the chip that answers at an address.

        Raises:
            NotResponding: there is none.
        """
        try:
            return self._chips[address]
        except KeyError:
            raise NotResponding(f"{self.name}: no answer at address 0x{address:02X}") from None


class FakeSPI:
    """An SPI bus with one chip or none; implements ``drivers.buses.SPIBus``."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.chip: SPIChip | None = None

    def attach(self, chip: SPIChip) -> None:
        """Put the chip there."""
        if self.chip is not None:
            raise ChipMisuse(f"{self.name}: two chips on one SPI device")
        self.chip = chip

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        """Exchange pieces with the chip; without one the line floats high."""
        if self.chip is None:
            return tuple(b"\xff" * len(piece) for piece in pieces)
        return tuple(map(self.chip.exchange, pieces))


class FakeSerial:
    """A serial line; implements ``drivers.buses.SerialPort``."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.chip: SerialChip | None = None

    def attach(self, chip: SerialChip) -> None:
        """Put the chip there."""
        if self.chip is not None:
            raise ChipMisuse(f"{self.name}: two chips on one serial line")
        self.chip = chip

    async def write(self, data: bytes) -> None:
        """Send bytes to the devices on the line."""
        self.post(data)

    async def exchange(self, data: bytes, missing: Missing, *, within_s: float = ANSWER_WITHIN_S) -> bytes:
        """Send bytes and return what comes back; only an answer that is not whole takes time."""
        answer = self.send(data)
        if missing(answer) > 0:
            await asyncio.sleep(within_s)
        return whole(self.name, answer, missing, within_s)

    def post(self, data: bytes) -> None:
        """Send bytes to the devices on the line; what they answer is not read."""
        self.send(data)

    def send(self, data: bytes) -> bytes:
        """Send bytes at once and return what the chip answers."""
        return b"" if self.chip is None else self.chip.receive(data)


class FakeBuses:
    """Hands out fake buses by name; implements ``drivers.buses.Buses``."""

    I2C, SPI, SERIAL = FakeI2C, FakeSPI, FakeSerial  # what it hands out

    def __init__(self) -> None:
        self._i2c: dict[str, FakeI2C] = {}
        self._spi: dict[str, FakeSPI] = {}
        self._serial: dict[str, FakeSerial] = {}
        self.cameras: dict[str, Callable[[float, int, int], Frame]] = {}
        self._pins = FakePins()

    def i2c(self, name: str) -> FakeI2C:
        """Return the I2C bus of that name."""
        return self._i2c.setdefault(name, self.I2C(name))

    def spi(self, name: str, *, mode: int = 0, speed_hz: int = 400_000) -> FakeSPI:  # noqa: ARG002
        """Return the SPI device of that name; its mode and speed are not simulated."""
        return self._spi.setdefault(name, self.SPI(name))

    def serial(self, name: str, *, baud: int = 9600) -> FakeSerial:  # noqa: ARG002
        """Return the serial port of that name; its speed is not simulated."""
        return self._serial.setdefault(name, self.SERIAL(name))

    def camera(self, name: str, *, width: int, height: int, rate_hz: float, exposure_us: int | None) -> Camera:  # noqa: ARG002
        """Return the camera of that name."""
        return FakeCamera(name, width, height, self.cameras.get(name))

    def pins(self) -> FakePins:
        """Return the GPIO pins."""
        return self._pins

    async def close(self, wait_s: float = CLOSE_WAIT_S) -> None:
        """Nothing to release."""


class FakeCamera:
    """A camera that sees the simulated world; implements ``drivers.buses.Camera``."""

    def __init__(self, name: str, width: int, height: int, render: Callable[[float, int, int], Frame] | None) -> None:
        self.name = f"camera {name}"
        self._size = width, height
        self._render = render

    async def frame(self) -> Frame:
        """Return what is seen now."""
        if self._render is None:
            raise NotResponding(f"{self.name}: no camera")
        return self._render(asyncio.get_running_loop().time(), *self._size)
