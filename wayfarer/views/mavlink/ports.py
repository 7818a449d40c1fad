"""The two kinds of ports of a link, a UDP socket and a serial line. Neither waits, and what does not fit is dropped."""

from __future__ import annotations

import asyncio
import fcntl
import os
import socket
import termios
import tty
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import Protocol

from wayfarer.views.mavlink.address import BAUDS, Address, check_not_a_part, is_this_computer
from wayfarer.views.mavlink.frames import INPUT_BYTES, Frame, FrameReader

CONTROL, SPEED_IN, SPEED_OUT = 2, 4, 5  # places in what termios.tcgetattr returns


class Port(Protocol):
    """An open link. Its methods raise OSError where it has to be opened again."""

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` on the running loop when something has arrived, until the port is closed."""

    def read(self, now_s: float) -> Iterator[tuple[Frame, bool]]:
        """Yield the frames of one datagram or one read, each with whether a program of this computer sent it."""

    def write(self, frame: bytes) -> None:
        """Send a frame, if there is a station to send it to and room for it."""

    def answer(self, frame: bytes) -> None:
        """Send a frame to the sender of the one that was read last, where that hears nothing else from here."""

    def believe(self) -> None:
        """Note that the frame that was read last was a station's heartbeat: its sender is the station."""

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

    def answer(self, frame: bytes) -> None:
        """Send a frame to a sender that is not our station; ``udpout`` has no such."""
        if not self._connected and self._sender != self._station:
            with suppress(BlockingIOError):
                self._socket.sendto(frame, self._sender)

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
        self._line = os.open(address.where, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            fcntl.flock(self._line, fcntl.LOCK_EX | fcntl.LOCK_NB)  # two programs would take each other's bytes
            tty.setraw(self._line)
            settings = termios.tcgetattr(self._line)
            settings[CONTROL] = settings[CONTROL] & ~termios.CRTSCTS | termios.CLOCAL | termios.CREAD
            settings[SPEED_IN] = settings[SPEED_OUT] = BAUDS[address.number]
            termios.tcsetattr(self._line, termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            os.close(self._line)
            raise OSError(f"{address.where} is no serial line that can be used: {error}") from None
        self._reader = FrameReader()
        self._unsent = b""

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` when bytes are there."""
        asyncio.get_running_loop().add_reader(self._line, ready)

    def read(self, now_s: float) -> Iterator[tuple[Frame, bool]]:
        """Yield the frames that the bytes so far complete."""
        try:
            data = os.read(self._line, INPUT_BYTES)
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
                self._unsent = self._unsent[os.write(self._line, self._unsent) :]
            if not self._unsent:
                self._unsent = frame[os.write(self._line, frame) :]
        except BlockingIOError:
            return

    def answer(self, frame: bytes) -> None:
        """Nothing: the other end hears all that is sent."""

    def believe(self) -> None:
        """Nothing: a line has one other end."""

    def forget(self) -> None:
        """Nothing."""

    def close(self) -> None:
        """Close the line."""
        if self._line >= 0:
            asyncio.get_running_loop().remove_reader(self._line)
            os.close(self._line)
            self._line = -1


def open_port(address: Address, devices: Iterable[str]) -> Port:
    """Open a link; ``devices`` are the device files of the rover's parts.

    Raises:
        OSError: it is not there, or not yet.
        BadInput: a part of the rover is there.
    """
    check_not_a_part(address, devices)
    return SerialPort(address) if address.kind == "serial" else UdpPort(address)
