"""The link to a ground station: its address, the UDP socket or serial line, what keeps it open, and frames in it.

Nothing here waits: what does not fit is dropped, and nothing that happens to a link stops the rover.

A frame of MAVLink 2 (https://mavlink.io/en/guide/serialization.html): marker, payload length, two bytes of flags,
sequence number, system, component, three bytes of message number, payload, checksum, and if the first flag says so a
signature of 13 bytes, which nobody looks at: there is nothing that only some may ask for. MAVLink 1 is not read.

pymavlink's own parser is not used: after a stray marker it skips as many bytes as the next byte says, with all good
frames in them (10 of 20 were lost after the two bytes FD FF). Here only the marker is skipped.
"""

from __future__ import annotations

import asyncio
import fcntl
import logging
import os
import socket
import struct
import termios
import tty
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from ipaddress import ip_address
from typing import NamedTuple

from pymavlink.dialects.v20 import common

from wayfarer.errors import BadInput, NotThereYet

MARKER = 0xFD
HEADER_BYTES, CHECKSUM_BYTES, SIGNATURE_BYTES = 10, 2, 13
LONGEST_BYTES = HEADER_BYTES + 255 + CHECKSUM_BYTES + SIGNATURE_BYTES
SIGNED = 0x01  # the only flag that a reader must know
# Looked at in one turn of the loop; a station puts a frame or a few into a datagram.
INPUT_BYTES = 2_048
WHOLE_WITHIN_S = 0.1  # the longest frame takes 0.05 s at 57,600 baud


class FrameReader:
    """Finds the frames in a stream, or in datagrams. Never holds more than ``LONGEST_BYTES`` between two calls.

    Each frame that it yields has a right checksum, and its message is one of the dialect ``common``.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._since_s = 0.0

    def feed(self, data: bytes, now_s: float) -> Iterator[bytes]:
        """Yield the frames that bytes of a stream complete; at most ``INPUT_BYTES`` of them are looked at."""
        if self._rest and now_s - self._since_s > WHOLE_WITHIN_S:
            yield from self._found(self._rest, now_s, at_end=True)  # no frame takes so long: the marker was a stray one
        yield from self._found(self._rest + data[:INPUT_BYTES], now_s, at_end=False)

    def datagram(self, data: bytes) -> Iterator[bytes]:
        """Yield the frames of a datagram, which never go on in the next one."""
        yield from self._found(data[:INPUT_BYTES], 0.0, at_end=True)

    def _found(self, data: bytes, now_s: float, *, at_end: bool) -> Iterator[bytes]:
        place, was_waiting, self._rest = data.find(MARKER), bool(self._rest), b""
        while place >= 0:
            length = _length(data, place)
            if length is None or place + length > len(data):
                if not at_end:
                    self._rest = data[place:]
                    self._since_s = self._since_s if was_waiting and place == 0 else now_s
                    return
                length = 0
            frame = data[place : place + length]
            if is_whole := length > 0 and _is_whole(frame):
                yield frame
            place = data.find(MARKER, place + (length if is_whole else 1))


def _length(data: bytes, place: int) -> int | None:
    """Return how long the frame that begins here would be; None if too little is there to know."""
    if len(data) < place + 3:
        return None
    signature = SIGNATURE_BYTES if data[place + 2] & SIGNED else 0
    return HEADER_BYTES + data[place + 1] + CHECKSUM_BYTES + signature


def _is_whole(frame: bytes) -> bool:
    """Return whether the checksum is right; a message that the dialect does not have cannot be checked."""
    message = common.mavlink_map.get(int.from_bytes(frame[7:10], "little"))
    if message is None or frame[2] & ~SIGNED:
        return False
    end = HEADER_BYTES + frame[1]
    (checksum,) = struct.unpack_from("<H", frame, end)
    return bool(common.x25crc(frame[1:end] + bytes([message.crc_extra])).crc == checksum)


KINDS = ("udpout", "udpin", "serial")
PORTS = range(1, 65_536)
# In baud, and what termios calls them.
BAUDS = {int(name[1:]): getattr(termios, name) for name in dir(termios) if name[:1] == "B" and name[1:].isdecimal()}
FORM = "give udpout:HOST:PORT, udpin:HOST:PORT or serial:DEVICE:BAUD, such as udpout:192.168.1.5:14550"
CONTROL, SPEED_IN, SPEED_OUT = 2, 4, 5  # places in what termios.tcgetattr returns
AGAIN_S = 2.0  # between two tries to open a link
# Who is silent for so long may have come back from another port: three heartbeats. Chosen by us.
MOVED_S = 3.0
COMPONENT = common.MAV_COMP_ID_AUTOPILOT1

_log = logging.getLogger("wayfarer.remote.mavlink")


# -- addresses -------------------------------------------------------------------------------------------------------


class Address(NamedTuple):
    """Where the link goes: an IP address and a port, or a device file and a rate in baud."""

    kind: str
    where: str
    number: int

    def __str__(self) -> str:
        where = f"[{self.where}]" if self.kind != "serial" and ":" in self.where else self.where
        return f"{self.kind}:{where}:{self.number}"


def parse_address(text: str) -> Address:
    """Return the address that a text names; a host is looked up, and is ``NotThereYet`` if nobody knows it."""
    kind, _, rest = text.partition(":")
    where, _, digits = rest.rpartition(":")
    allowed = BAUDS.keys() - {0} if kind == "serial" else PORTS
    if kind not in KINDS or not where:
        raise BadInput(f"--mavlink {text}: not the address of a link; {FORM}")
    if not (digits.isascii() and digits.isdecimal() and int(digits[:8]) in allowed):
        number = "rate in baud" if kind == "serial" else "port"
        raise BadInput(f"--mavlink {text}: '{digits}' is not a {number}; {FORM}")
    if kind == "serial":
        return Address(kind, where, int(digits))
    host = where.removeprefix("[").removesuffix("]")
    try:
        return Address(kind, str(socket.getaddrinfo(host, None, type=socket.SOCK_DGRAM)[0][4][0]), int(digits))
    except UnicodeError:
        raise BadInput(f"--mavlink {text}: {host} is not a host name; {FORM}") from None
    except OSError:
        raise NotThereYet(
            f"--mavlink: host {host} is not known; give its IP address, which needs no network and no name server"
        ) from None


def check_not_a_part(address: Address, devices: Iterable[str]) -> None:
    """Refuse a serial line that a part of the rover is on: what a motor board is sent could turn the wheels.

    Asked at each opening: an adapter that is plugged in again may get the name that another one had. ``devices`` are
    the device files of the rover's parts.
    """
    if address.kind == "serial" and os.path.realpath(address.where) in map(os.path.realpath, devices):
        raise BadInput(
            f"--mavlink {address}: a part of the rover is on {address.where}; name the radio's device, best by"
            " /dev/serial/by-id"
        )


def is_this_computer(host: str) -> bool:
    """Return whether an IP address is one that only programs on this computer can send from."""
    address = ip_address(host.partition("%")[0])
    return (getattr(address, "ipv4_mapped", None) or address).is_loopback


# -- the two kinds of ports: their methods raise OSError if the port has to be opened again ---------------------------


class UdpPort:
    """A UDP socket, which serves one station at a time, so that nobody can multiply what the rover sends.

    ``udpout`` names that one; ``udpin`` waits for one. The socket is not connected, or it would keep the address of a
    network that the computer has left. ``sender`` is who sent what was read last.
    """

    def __init__(self, address: Address) -> None:
        family = socket.AF_INET6 if ":" in address.where else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._reader = FrameReader()
        where = (address.where, address.number)
        self._named = where if address.kind == "udpout" else None
        self._station: tuple[str, int] | None = self._named
        self.sender = ("", 0)
        if self._named is None:
            try:
                self._socket.bind(where)
            except OSError:
                self._socket.close()
                raise

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` for each datagram, until the port is closed."""
        asyncio.get_running_loop().add_reader(self._socket, ready)

    def read(self, now_s: float) -> Iterator[tuple[bytes, bool]]:  # noqa: ARG002 - a datagram is whole
        """Yield the frames of one datagram, each with whether a program of this computer sent it.

        While a station is served, other computers than its own are not heard. It may have come back from another port.
        """
        try:
            data, sender = self._socket.recvfrom(INPUT_BYTES)
        except BlockingIOError:
            return
        self.sender = sender[:2]  # of IPv6, without flow and scope
        is_near = is_this_computer(self.sender[0])
        if is_near or self._is_of_station():
            for frame in self._reader.datagram(data):
                yield frame, is_near

    def _is_of_station(self) -> bool:
        return self._station is None or self._station[0] == self.sender[0]

    def write(self, frame: bytes) -> None:
        """Send a frame, if there is a station to send it to and room for it."""
        if self._station is not None:
            with suppress(BlockingIOError):
                self._socket.sendto(frame, self._station)

    def serve(self) -> bool:
        """Serve the sender from now on, if it is not on another computer than a named one; return whether it is served.

        A named station gets what is sent at its named port, also if it sends from another one.
        """
        if self._named is None:
            self._station = self.sender
        return self._is_of_station()

    def forget(self) -> None:
        """Let another station take the place of the one that is silent, if none is named."""
        self._station = self._named

    def close(self) -> None:
        """Close the socket. Safe twice."""
        if self._socket.fileno() >= 0:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()


class SerialPort:
    """A serial line, as of a telemetry radio: what is sent reaches everybody there."""

    sender = ("", 0)

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
            raise OSError(f"{address.where} cannot be used as a serial line: {error}") from None
        self._reader = FrameReader()
        self._unsent = b""

    def listen(self, ready: Callable[[], None]) -> None:
        """Call ``ready`` when bytes are there, until the port is closed."""
        asyncio.get_running_loop().add_reader(self._line, ready)

    def read(self, now_s: float) -> Iterator[tuple[bytes, bool]]:
        """Yield the frames that the bytes so far complete, by now; the other end counts as near."""
        try:
            data = os.read(self._line, INPUT_BYTES)
            if not data:
                raise OSError("the line was hung up")
        except BlockingIOError:
            data = b""
        for frame in self._reader.feed(data, now_s):
            yield frame, True

    def write(self, frame: bytes) -> None:
        """Send a frame, after the rest of the one before; drop it if that has not gone yet."""
        with suppress(BlockingIOError):
            if self._unsent:
                self._unsent = self._unsent[os.write(self._line, self._unsent) :]
            if not self._unsent:
                self._unsent = frame[os.write(self._line, frame) :]

    def serve(self) -> bool:
        """Return True: a serial line has one station."""
        return True

    def forget(self) -> None:
        """Nothing."""

    def close(self) -> None:
        """Close the line. Safe twice."""
        if self._line >= 0:
            asyncio.get_running_loop().remove_reader(self._line)
            os.close(self._line)
            self._line = -1


def open_port(address: Address, devices: Iterable[str]) -> UdpPort | SerialPort:
    """Open a link, or raise ``OSError`` if it is not there yet; ``devices`` are those of the rover's parts."""
    check_not_a_part(address, devices)
    return SerialPort(address) if address.kind == "serial" else UdpPort(address)


# -- the link ----------------------------------------------------------------------------------------------------------


class Sender(NamedTuple):
    """Who sends: an address, and MAVLink's numbers of system and component. Many may share an address."""

    host: str
    port: int
    system: int
    component: int


class Link:
    """One link to one station. ``heard_s`` is the loop's time at which the served station's heartbeat last came.

    The first station that beats is served until it is silent: another one's heartbeats do not show that it is there.

    Args:
        address: where it goes.
        system_id: the rover's number.
        devices: the device files of the rover's parts, which are not links.
        on_message: takes each message, and whether its sender is near: on this computer, or on a serial line. Must
            not wait.
    """

    def __init__(
        self, address: Address, system_id: int, devices: tuple[str, ...],
        on_message: Callable[[common.MAVLink_message, bool], None],
    ) -> None:  # fmt: skip
        self._address = address
        self._devices = devices
        self._on_message = on_message
        self._coder = common.MAVLink(None, system_id, COMPONENT)
        self._port: UdpPort | SerialPort | None = None
        self._station: Sender | None = None
        self.heard_s = float("-inf")

    async def run(self) -> None:
        """Keep the link open until cancelled."""
        loop = asyncio.get_running_loop()
        warned, warned_s = "", 0.0
        while True:
            self._broken: asyncio.Future[OSError] = loop.create_future()
            try:
                if self._address.kind == "serial":  # a driver may take its time
                    self._port = await asyncio.to_thread(open_port, self._address, self._devices)
                else:
                    self._port = open_port(self._address, self._devices)
                self._port.listen(self.look)
                raise await self._broken
            except (OSError, BadInput) as error:
                why = getattr(error, "strerror", None) or str(error)
                if warned != why or self.heard_s > warned_s:  # once, not every two seconds
                    warned, warned_s = why, loop.time()
                    _log.warning("MAVLink at %s is not open (tried again every %g s): %s", self._address, AGAIN_S, why)
            finally:
                self._close()
            await asyncio.sleep(AGAIN_S)

    def _close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _break(self, error: OSError) -> None:
        """Close the port, which would stay readable and keep the loop busy, and let it be opened again."""
        self._close()
        if not self._broken.done():
            self._broken.set_result(error)

    def send(self, message: common.MAVLink_message) -> int:
        """Send a message; return how many bytes it has, 0 if the link is not open."""
        if self._port is None:
            return 0
        data: bytes = message.pack(self._coder)
        self._coder.seq = (self._coder.seq + 1) % 256
        try:
            self._port.write(data)
        except OSError as error:
            self._break(error)
        return len(data)

    @property
    def is_served(self) -> bool:
        """Whether a station has come and was not said to be silent since."""
        return self._station is not None

    def station_is_silent(self) -> None:
        """Let another station take the place of the one that is silent."""
        self._station = None
        if self._port is not None:
            self._port.forget()

    def look(self) -> None:
        """Take what has arrived; called again and again, also what stands behind a stray marker with nothing after."""
        port = self._port
        if port is None:
            return
        now_s = asyncio.get_running_loop().time()
        try:
            for frame, is_near in port.read(now_s):
                self._receive(port, frame, is_near, now_s)
        except OSError as error:
            self._break(error)

    def _receive(self, port: UdpPort | SerialPort, frame: bytes, is_near: bool, now_s: float) -> None:
        try:
            message = self._coder.decode(bytearray(frame))
            # Only a station's: another vehicle may be there, and an enemy may send our own messages back to us.
            if isinstance(message, common.MAVLink_heartbeat_message) and message.type == common.MAV_TYPE_GCS:
                sender = Sender(*port.sender, message.get_srcSystem(), message.get_srcComponent())
                station = self._station or sender
                has_moved = now_s - self.heard_s > MOVED_S and sender._replace(port=station.port) == station
                if (sender == station or has_moved) and port.serve():
                    self._station, self.heard_s = sender, now_s
            self._on_message(message, is_near)
        except common.MAVError:
            return  # a text that is not UTF-8
        except Exception:  # a bug must not lose the next frame, which may be a stop
            _log.exception("in taking what a ground station sent")
