"""The two kinds of ports of a link, a UDP socket and a serial line. Neither waits, and what does not fit is dropped."""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Callable, Iterator
from typing import Protocol

from wayfarer.views.mavlink.address import Address, is_this_computer
from wayfarer.views.mavlink.frames import INPUT_BYTES, Frame, FrameReader


class Port(Protocol):
    """An open link. Its methods raise OSError where it has to be opened again."""

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` on the running loop when something has arrived, until the port is closed."""

    def read(self, now_s: float) -> Iterator[tuple[Frame, bool]]:
        """Yield the frames of one datagram or one read, each with whether a program of this computer sent it."""

    def write(self, frame: bytes) -> None:
        """Send a frame, if there is a station to send it to and room for it."""

    def believe(self) -> None:
        """Note that the frame that was read last is valid: its sender is the station."""

    def forget(self) -> None:
        """Note that the station is silent: another may take its place."""

    def close(self) -> None:
        """Close it. Safe twice."""


class UdpPort:
    """A UDP socket. ``udpout`` is connected: the kernel drops what others than the station send.

    ``udpin`` waits for a station, and has one at a time: so nobody can multiply what the rover sends.
    """

    def __init__(self, address: Address) -> None:
        family = socket.AF_INET6 if ":" in address.where else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._connected = address.kind == "udpout"
        self._reader = FrameReader()
        self._station: tuple[object, ...] | None = None
        self._sender: tuple[object, ...] = ()
        where = (address.where, address.number)
        try:
            self._socket.connect(where) if self._connected else self._socket.bind(where)
        except OSError:
            self._socket.close()
            raise

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` for each datagram."""
        asyncio.get_running_loop().add_reader(self._socket, ready)

    def read(self, now_s: float) -> Iterator[tuple[Frame, bool]]:  # noqa: ARG002 - a datagram is whole
        """Yield the frames of one datagram."""
        try:
            data, self._sender = self._socket.recvfrom(INPUT_BYTES)
        except (BlockingIOError, ConnectionRefusedError):  # nobody listens at the station yet
            return
        is_local = is_this_computer(str(self._sender[0]))
        for frame in self._reader.datagram(data):
            yield frame, is_local

    def write(self, frame: bytes) -> None:
        """Send a frame."""
        try:
            if self._connected:
                self._socket.send(frame)
            elif self._station is not None:
                self._socket.sendto(frame, self._station)
        except (BlockingIOError, ConnectionRefusedError):
            return

    def believe(self) -> None:
        """Keep the first sender."""
        if self._station is None:
            self._station = self._sender

    def forget(self) -> None:
        """Let another one take its place."""
        self._station = None

    def close(self) -> None:
        """Close the socket."""
        if self._socket.fileno() >= 0:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()


class SerialPort:
    """A serial line, as of a telemetry radio."""

    def __init__(self, address: Address) -> None:
        import serial

        try:
            self._line = serial.Serial(address.where, address.number, timeout=0, write_timeout=0, exclusive=True)
        except ValueError as error:  # a rate that the device does not have
            raise OSError(str(error)) from None
        self._reader = FrameReader()
        self._unsent = b""

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` when bytes are there."""
        asyncio.get_running_loop().add_reader(self._line.fileno(), ready)

    def read(self, now_s: float) -> Iterator[tuple[Frame, bool]]:
        """Yield the frames that the bytes so far complete."""
        try:
            data = os.read(self._line.fileno(), INPUT_BYTES)
        except BlockingIOError:
            return
        if not data:
            raise OSError("the line was hung up")
        for frame in self._reader.feed(data, now_s):
            yield frame, False

    def write(self, frame: bytes) -> None:
        """Send a frame, after the rest of the one before; drop it where that has not gone yet."""
        try:
            if self._unsent:
                self._unsent = self._unsent[os.write(self._line.fileno(), self._unsent) :]
            if not self._unsent:
                self._unsent = frame[os.write(self._line.fileno(), frame) :]
        except BlockingIOError:
            return

    def believe(self) -> None:
        """Nothing: a line has one other end."""

    def forget(self) -> None:
        """Nothing."""

    def close(self) -> None:
        """Close the line."""
        if self._line.is_open:
            asyncio.get_running_loop().remove_reader(self._line.fileno())
            self._line.close()


def open_port(address: Address) -> Port:
    """Open a link.

    Raises:
        OSError: it is not there, or not yet.
    """
    return SerialPort(address) if address.kind == "serial" else UdpPort(address)
