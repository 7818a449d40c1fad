"""Basicmicro RoboClaw over packet serial: how to speak to it, for the drivers of its motors and of its wheels.

Commands, numbers and the CRC are those of the RoboClaw Series User Manual, pages 58 to 74 (docs/reference/hardware.md).
A request is two bytes, address and command; its answer ends with a CRC over both and the data. A command that changes
something has the CRC itself, and is acknowledged by FF.

**What only asks may keep the motors running**: the board's timeout counts the bytes that it receives, and no source
says that a request is not counted. So a request that comes later than the timeout after the last command to move has a
stop right behind it. If requests go on while nothing drives any more, the wheels stop after twice the timeout.

**A board that is set to standard serial** takes each byte as a command that turns a motor, and a zero as a stop (page
55). So until a board has answered once, a zero follows each request and each command.
"""

from __future__ import annotations

import asyncio
from binascii import crc_hqx
from collections.abc import Awaitable, Callable
from contextlib import suppress
from enum import IntEnum
from math import inf
from struct import pack
from typing import TypeVar
from weakref import WeakValueDictionary

from wayfarer.drivers.buses import SerialPort
from wayfarer.errors import BadReading, DriverError, NotResponding, WrongPart

T = TypeVar("T")

CHIP = "RoboClaw"  # motors and wheels are two drivers' at one address
FULL_DUTY = 32767
TIMEOUT_UNITS_PER_S = 10
A_PER_STEP = 0.01  # of a motor's current

_CRC_BYTES = 2
_ACKNOWLEDGED = b"\xff"
_STOPS = 3  # as many go out at once: the first may end up in a packet that broke off
_STANDARD_SERIAL_STOP = b"\0"
_GAP_S = 0.011  # page 59: after more than 10 ms without a byte the board drops a packet that is not whole
_RETRIES = 2
_RETRY_WITHIN_S = 0.1  # after this no retry: the board is not there, or the process was suspended
_VERSION_BYTES_MIN = 8 + _CRC_BYTES  # a shorter name says nothing; the manual's longest is 48


class Opcode(IntEnum):
    """The commands that are used, with the manual's numbers."""

    SET_TIMEOUT = 14
    GET_TIMEOUT = 15
    GET_VERSION = 21
    GET_BATTERY = 24
    SET_DUTIES = 34
    GET_DUTIES = 48
    GET_CURRENTS = 49
    GET_ENCODERS = 78
    GET_STATUS = 90


def with_crc(address: int, command: int, data: bytes = b"") -> bytes:
    """Return the packet of a command that changes something (page 59)."""
    packet = bytes((address, command)) + data
    return packet + crc_hqx(packet, 0).to_bytes(_CRC_BYTES, "big")


class RoboClawLink:
    """Requests and commands to one RoboClaw; counts its ``retries`` and the ``halts``."""

    def __init__(self, port: SerialPort, address: int) -> None:
        self.where = f"RoboClaw {address} on {port.name}"
        self.retries = self.halts = 0
        self._port = port
        self._address = address
        self._stops = with_crc(address, Opcode.SET_DUTIES, bytes(4)) * _STOPS
        self._has_answered = False
        self._moves_until_s = inf  # a request after that has a stop behind it; infinite while the wheels are stopped

    async def drive(self, first: int, second: int, timeout_s: float) -> None:
        """Give both motors their duties, of ``FULL_DUTY``. It is not tried again after a ``halt``.

        Raises:
            NotResponding: not acknowledged.
            BadReading: something else was answered.
        """
        if first or second:
            self._moves_until_s = asyncio.get_running_loop().time() + timeout_s
        duties, until_s, halts = pack(">hh", first, second), self._moves_until_s, self.halts

        async def send() -> None:
            if self.halts == halts:
                await self._send_once(Opcode.SET_DUTIES, duties)

        await self._retry(send)
        # It was sent, and no newer command meanwhile.
        if not first and not second and (self._moves_until_s, self.halts) == (until_s, halts):
            self._moves_until_s = inf

    async def set_timeout(self, units: bytes) -> bool:
        """Set the serial timeout and read it back; return whether it is set.

        There is firmware that does not acknowledge a command with one byte of data. Raises as ``ask``.
        """
        with suppress(DriverError):
            await self._send_once(Opcode.SET_TIMEOUT, units)
        return await self.ask(Opcode.GET_TIMEOUT, 1) == units

    def halt(self) -> None:
        """Stop both motors without waiting, from any thread; it never raises."""
        self.halts += 1
        self._post_stop()

    def _post_stop(self) -> None:
        self._port.post(self._for_any_mode(self._stops))

    async def ask(self, command: int, *counts: int) -> bytes:
        """Return the data of an answer, which has one of these numbers of bytes, the smallest first.

        Raises:
            NotResponding: no answer.
            BadReading: an answer to something else, or a damaged one.
        """

        def data_in(received: bytes) -> bytes | None:
            for count in counts:
                # The last bytes: before them there may be acknowledgements of stops that were posted.
                answer = received[-count - _CRC_BYTES :]
                if len(answer) == count + _CRC_BYTES and self._is_answer(command, answer):
                    return answer[:count]
            return None

        return await self._retry(lambda: self._ask_once(command, data_in, counts[0] + _CRC_BYTES))

    async def identify(self) -> str:
        """Return the board's name and firmware, such as ``2x15a v4.1.34``.

        Raises:
            NotResponding: nothing answers.
            WrongPart: something else does.
            BadReading: a RoboClaw does, damaged or too late.
        """
        seen = b""

        def data_in(received: bytes) -> bytes | None:
            nonlocal seen
            seen = received
            return received[:-_CRC_BYTES] if self._is_answer(Opcode.GET_VERSION, received) else None

        try:
            version = await self._retry(lambda: self._ask_once(Opcode.GET_VERSION, data_in, _VERSION_BYTES_MIN))
        except BadReading as error:
            if b"claw" in seen.lower():
                raise
            raise WrongPart(self.where, CHIP, f"no answer from one ({error})") from error
        return version.rstrip(b"\n\0").decode("ascii", "replace").removeprefix("USB ").removeprefix("Roboclaw ")

    async def _send_once(self, command: int, data: bytes) -> None:
        packet = with_crc(self._address, command, data)
        answer = await self._port.exchange(self._for_any_mode(packet), lambda received: 1 - len(received))
        if answer[:1] != _ACKNOWLEDGED:
            raise self._not_understood(command, answer)

    async def _ask_once(self, command: int, data_in: Callable[[bytes], bytes | None], least: int) -> bytes:
        """Ask, and have the motors stopped behind that if nobody commands them any more.

        An answer has come when there is data in it; it has so many bytes at least.
        """
        came = b""

        def missing(received: bytes) -> int:
            nonlocal came
            came = received
            return 0 if data_in(received) is not None else max(1, least - len(received))

        try:
            request = self._for_any_mode(bytes((self._address, command)))
            data = data_in(await self._port.exchange(request, missing))
            self._has_answered = True
        except NotResponding:
            if came:
                raise self._not_understood(command, came) from None
            raise
        finally:
            if asyncio.get_running_loop().time() > self._moves_until_s:
                self._post_stop()
        assert data is not None
        return data

    def _for_any_mode(self, packet: bytes) -> bytes:
        return packet if self._has_answered else packet + _STANDARD_SERIAL_STOP

    def _is_answer(self, command: int, answer: bytes) -> bool:
        return crc_hqx(bytes((self._address, command)) + answer, 0) == 0

    def _not_understood(self, command: int, answer: bytes) -> BadReading:
        return BadReading(
            f"{self.where}: asked {command}, and {answer.hex(' ').upper()} is not a complete answer; noise on the "
            "wires, another baud rate, or another part or program at the port"
        )

    async def _retry(self, transfer: Callable[[], Awaitable[T]]) -> T:
        clock = asyncio.get_running_loop().time
        ends_s = clock() + _RETRY_WITHIN_S
        for left in range(_RETRIES, -1, -1):
            try:
                return await transfer()
            except NotResponding as error:
                if error.remedy:  # no wire is the reason
                    raise
                if not left or clock() > ends_s:
                    raise NotResponding(
                        f"{self.where}: no answer ({error}); battery off, another address or baud rate, or "
                        "it is not in packet serial mode: check its power and its settings in Motion Studio"
                    ) from error
            except DriverError:
                if not left or clock() > ends_s:
                    raise
            self.retries += 1
            await asyncio.sleep(_GAP_S)
        raise AssertionError("the last try returns or raises")


_LINKS: WeakValueDictionary[tuple[int, int], RoboClawLink] = WeakValueDictionary()


def link_to(port: SerialPort, address: int) -> RoboClawLink:
    """Return the link to a board, the same one for all its drivers: it must know of each command to move."""
    key = id(port), address  # the link keeps its port, so that no other has this id meanwhile
    if (link := _LINKS.get(key)) is None:
        link = _LINKS[key] = RoboClawLink(port, address)
    return link
