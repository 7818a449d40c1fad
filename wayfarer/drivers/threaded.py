"""Buses over blocking devices, each behind its worker thread.

A blocking device is opened in its thread at the first transfer, and again after every error: a USB adapter that was
unplugged comes back as another file, so the old handle may fail for ever. Only the first opening, when no wheel turns
yet, has a longer deadline, because it also loads the bus's library.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

from wayfarer.drivers.buses import CLOSE_WAIT_S
from wayfarer.drivers.worker import TRANSFER_DEADLINE_S, Worker
from wayfarer.errors import NotResponding


class BlockingDevice(Protocol):
    """An open device; every method blocks and raises ``OSError``."""

    def close(self) -> None:
        """Release it."""


class BlockingI2C(BlockingDevice, Protocol):
    """An open I2C bus."""

    def write(self, address: int, data: bytes) -> None:
        """Write bytes."""

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, repeated start, read."""

    def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, stop, read."""


class BlockingSPI(BlockingDevice, Protocol):
    """An open SPI device."""

    def transfer(self, pieces: tuple[bytes, ...]) -> tuple[bytes, ...]:
        """Exchange pieces, chip select low for each in turn."""


class BlockingSerial(BlockingDevice, Protocol):
    """An open serial port."""

    def write(self, data: bytes) -> None:
        """Write bytes and wait until they are in the port's own buffer."""


OPEN_DEADLINE_S = 5.0  # a Raspberry Pi that has just booted may need a second to load a library from its card

D = TypeVar("D", bound=BlockingDevice)
T = TypeVar("T")

# What a person who holds the wires should look for, by the error that Linux gives (hardware.md 7).
_CAUSES = {
    errno.EREMOTEIO: "no acknowledgement",
    errno.ENXIO: "no acknowledgement",
    errno.EIO: "the transfer broke off: a loose wire, or the part stretches the clock",
    errno.ETIMEDOUT: "the bus is stuck: a part holds a line low; switch its power off and on",
    errno.ENOENT: "no such device file: enable the interface with sudo raspi-config",
    errno.ENODEV: "no such device: is it plugged in?",
    errno.ESHUTDOWN: "no such device any more: was SPI switched off?",  # how spidev says that its driver was unbound
    errno.EACCES: "permission denied: add the user to the device's group (ls -l shows it) and log in again",
    errno.EBUSY: "another program has it open",
}


def explain(error: OSError) -> str:
    """Return what an error of a bus means for the person who holds the wires."""
    cause = _CAUSES.get(error.errno or 0)
    return f"{cause} [errno {error.errno}]" if cause else str(error) or type(error).__name__


class Threaded(Generic[D]):
    """A blocking device behind a worker."""

    def __init__(
        self,
        name: str,
        open_device: Callable[[], D],
        deadline_s: float = TRANSFER_DEADLINE_S,
        open_deadline_s: float = OPEN_DEADLINE_S,
    ) -> None:
        self.name = name
        self._open = open_device
        self._worker = Worker(name, deadline_s)
        self._open_deadline_s = open_deadline_s
        self._device: D | None = None
        self._tried = False  # whether an open was attempted

    async def call(self, use: Callable[[D], T]) -> T:
        """Use the device in its thread.

        Raises:
            NotResponding: the device failed, or the deadline passed.
        """
        try:
            if not self._tried:
                await self._worker.call(self._opened, self._open_deadline_s)
            return await self._worker.call(lambda: self._use(use))
        except OSError as error:
            raise NotResponding(f"{self.name}: {explain(error)}") from None
        except ImportError as error:
            raise NotResponding(f"{self.name}: {error}; pip install '.[pi]' in wayfarer's checkout") from None

    def send(self, use: Callable[[D], Any]) -> None:
        """Use the device before all queued transfers, without waiting for it; from any thread."""
        self._worker.post(lambda: self._use(use))

    async def close(self, wait_s: float = CLOSE_WAIT_S) -> None:
        """Release the device after the posted transfers; wait for that no longer than ``wait_s``."""
        await self._worker.close(self._release, wait_s)

    def _use(self, use: Callable[[D], T]) -> T:
        """Open the device if necessary and use it; runs in the worker's thread, as all methods below."""
        device = self._opened()
        try:
            return use(device)
        except OSError:
            self._release()
            raise

    def _opened(self) -> D:
        if self._device is None:
            try:
                self._device = self._open()
            finally:
                self._tried = True  # only now: a call meanwhile needs the same long deadline
        return self._device

    def _release(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.close()


class ThreadedI2C(Threaded[BlockingI2C]):
    """Implements ``buses.I2CBus``."""

    async def write(self, address: int, data: bytes) -> None:
        """Write bytes."""
        await self.call(lambda bus: bus.write(address, data))

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, repeated start, read."""
        return await self.call(lambda bus: bus.write_read(address, data, count))

    async def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, stop, read, with nothing in between."""
        return await self.call(lambda bus: bus.write_then_read(address, data, count))

    def post(self, address: int, data: bytes) -> None:
        """Write without waiting."""
        self.send(lambda bus: bus.write(address, data))


class ThreadedSPI(Threaded[BlockingSPI]):
    """Implements ``buses.SPIBus``."""

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        """Exchange pieces."""
        return await self.call(lambda device: device.transfer(pieces))


class ThreadedSerial(Threaded[BlockingSerial]):
    """Implements ``buses.SerialPort``."""

    async def write(self, data: bytes) -> None:
        """Write bytes."""
        await self.call(lambda port: port.write(data))

    def post(self, data: bytes) -> None:
        """Write without waiting."""
        self.send(lambda port: port.write(data))
