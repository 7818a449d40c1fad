"""Client of the hardware-in-the-loop server (``hil_server.py``): buses whose chips run in another process.

A rover file with ``buses = "tests.system.hil_buses:buses"`` gets them; ``WAYFARER_BENCH`` names the socket.
"""

from __future__ import annotations

import os
import socket
from functools import partial
from typing import Any

import msgspec

from wayfarer.drivers.linux import LinuxBuses
from wayfarer.drivers.threaded import ThreadedI2C, ThreadedSerial, ThreadedSPI

SOCKET_VARIABLE = "WAYFARER_BENCH"


def from_hex(pieces: list[str]) -> tuple[bytes, ...]:
    """Return the bytes of pieces as they cross the socket."""
    return tuple(bytes.fromhex(piece) for piece in pieces)


class HilConnection:
    """A blocking line to a bus of the bench, or without one to the bench itself.

    Raises:
        OSError: there is no bench at that path.
    """

    def __init__(self, path: str, bus: str = "") -> None:
        self._bus = bus
        self._connection = socket.socket(socket.AF_UNIX)
        try:
            self._connection.connect(path)
        except OSError as error:
            self._connection.close()
            raise OSError(f"no HIL server at {path}: {error.strerror}") from None
        self._answers = self._connection.makefile("rb")

    def ask(self, do: str, **details: object) -> dict[str, Any]:
        """Return the bench's reply.

        Raises:
            OSError: the transfer failed on the wire, or the bench has ended.
        """
        self._connection.sendall(msgspec.json.encode({"do": do, **details}) + b"\n")
        line = self._answers.readline()
        if not line:
            raise OSError("the HIL server has ended")
        reply: dict[str, Any] = msgspec.json.decode(line)
        if "error" in reply:
            raise OSError(reply["errno"], reply["error"])
        return reply

    def carry(self, kind: str, *pieces: bytes, **details: int) -> tuple[bytes, ...]:
        """Do a transfer on the bus and return what came back; raises as ``ask``."""
        return from_hex(self.ask(kind, bus=self._bus, data=[piece.hex() for piece in pieces], **details)["data"])

    def close(self) -> None:
        """Hang up."""
        self._answers.close()
        self._connection.close()


class HilI2C(HilConnection):
    """An I2C bus of the bench; implements ``threaded.BlockingI2C``."""

    def write(self, address: int, data: bytes) -> None:
        """Write bytes."""
        self.carry("i2c", data, address=address)

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, then read."""
        return self.carry("i2c", data, address=address, count=count)[0]

    write_then_read = write_read


class HilSPI(HilConnection):
    """An SPI device of the bench; implements ``threaded.BlockingSPI``."""

    def transfer(self, pieces: tuple[bytes, ...]) -> tuple[bytes, ...]:
        """Exchange pieces."""
        return self.carry("spi", *pieces)


class HilSerial(HilConnection):
    """A serial port of the bench; implements ``threaded.BlockingSerial``."""

    came = b""

    def write(self, data: bytes) -> None:
        """Write bytes."""
        self.came += self.carry("serial", data)[0]

    def forget_input(self) -> None:
        """Throw away what has come."""
        self.came = b""

    def read(self, count: int, _wait_s: float = 0.0) -> bytes:
        """Return what has come, of which nothing comes later."""
        read, self.came = self.came[:count], self.came[count:]
        return read


class HilBuses(LinuxBuses):
    """Implements ``drivers.buses.Buses`` over the bench at a socket."""

    def __init__(self, path: str) -> None:
        super().__init__()
        self._path = path

    def i2c(self, name: str) -> ThreadedI2C:
        """Return an I2C bus of the bench."""
        return self._once(name, lambda: ThreadedI2C(name, partial(HilI2C, self._path, name)))

    def spi(self, name: str, *, mode: int, speed_hz: int) -> ThreadedSPI:
        """Return an SPI device of the bench; its mode and speed are not simulated."""
        return self._once(name, lambda: ThreadedSPI(name, partial(HilSPI, self._path, name)))

    def serial(self, name: str, *, baud: int) -> ThreadedSerial:
        """Return a serial port of the bench; its speed is not simulated."""
        return self._once(name, lambda: ThreadedSerial(name, partial(HilSerial, self._path, name)))


def buses() -> HilBuses:
    """Return the buses of the bench at ``$WAYFARER_BENCH``."""
    return HilBuses(os.environ[SOCKET_VARIABLE])
