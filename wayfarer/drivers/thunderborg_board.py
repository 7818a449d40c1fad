"""PiBorg ThunderBorg on I2C: how to speak to it, for the drivers of its motors and its lights, and its lights.

Commands and the form of a request are those of PiBorg's own ThunderBorg.py, the only documentation. A request is a
write, a stop and a read of 6 bytes: the echo of the command, the answer, and filler.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar, TypeVar

from annotated_types import Interval

from wayfarer.drivers.buses import Buses, I2CBus
from wayfarer.errors import BadReading, DriverError, NotResponding, WrongPart
from wayfarer.hal import Colour

T = TypeVar("T")

DEFAULT_ADDRESS = 0x15
CHIP = "ThunderBorg"  # motors and lights are two drivers' at one address

_ID = 0x15  # identifies the kind of board: a board with another address still answers this
_REPLY_BYTES = 6
_RETRIES = 2  # PiBorg asks three times for a right echo; here also for writes that are not acknowledged
_RETRY_WITHIN_S = 0.1  # after this no retry: the bus hangs, or the process was suspended
_FULL_COLOUR = 255


class Opcode(IntEnum):
    """The commands of the board, with the numbers of ThunderBorg.py."""

    SET_BOTH_LEDS = 5
    SET_LEDS_SHOW_BATTERY = 6
    SET_A_FORWARD = 8
    SET_A_REVERSE = 9
    GET_A = 10
    SET_B_FORWARD = 11
    SET_B_REVERSE = 12
    GET_B = 13
    ALL_OFF = 14
    GET_DRIVE_FAULT_A = 15
    GET_DRIVE_FAULT_B = 16
    SET_FAILSAFE = 19
    GET_FAILSAFE = 20
    GET_BATTERY = 21
    GET_ID = 153


class ThunderBorgLink:
    """Writes and requests to one ThunderBorg, for the drivers of its motors and lights; counts its ``retries``."""

    def __init__(self, bus: I2CBus, address: int) -> None:
        self.where = f"ThunderBorg at 0x{address:02X} on {bus.name}"
        self._bus = bus
        self._address = address
        self.retries = 0

    async def write(self, *data: int) -> None:
        """Send a command and its data.

        Raises:
            NotResponding: not acknowledged three times.
        """
        await self._retry(lambda: self._bus.write(self._address, bytes(data)))

    async def request(self, command: int, count: int) -> bytes:
        """Return the first ``count`` bytes of the answer.

        Raises:
            NotResponding: not acknowledged three times.
            BadReading: three answers to something else.
        """
        return (await self._retry(lambda: self._ask_once(command)))[:count]

    async def identify(self) -> None:
        """Make sure that a ThunderBorg answers.

        Raises:
            NotResponding: nothing acknowledges.
            WrongPart: something else does.
        """
        expected = "a ThunderBorg (id 0x15)"
        try:
            (board,) = await self.request(Opcode.GET_ID, 1)
        except BadReading as error:
            raise WrongPart(self.where, expected, "no echo of the request") from error
        if board != _ID:
            raise WrongPart(self.where, expected, f"id 0x{board:02X}")

    def post(self, *data: int) -> None:
        """Send a command without waiting, from any thread; it never raises."""
        self._bus.post(self._address, bytes(data))

    async def _ask_once(self, command: int) -> bytes:
        echo, *answer = await self._bus.write_then_read(self._address, bytes((command,)), _REPLY_BYTES)
        if echo != command:
            raise BadReading(
                f"{self.where}: asked 0x{command:02X}, answered to 0x{echo:02X}; noise on the wires, or another "
                "program talks to the board: shorten the I2C cable, stop the other program"
            )
        return bytes(answer)

    async def _retry(self, transfer: Callable[[], Awaitable[T]]) -> T:
        clock = asyncio.get_running_loop().time
        ends_s = clock() + _RETRY_WITHIN_S
        for _ in range(_RETRIES):
            try:
                return await transfer()
            except DriverError as error:
                if clock() > ends_s:
                    raise NotResponding(f"{self.where}: no answer in time ({error})") from error
            self.retries += 1
        try:
            return await transfer()
        except NotResponding as error:
            if error.remedy:  # no wire is the reason
                raise
            raise NotResponding(
                f"{self.where}: no answer ({error}); battery off or flat, or a loose plug: check the board's power "
                "switch and its I2C cable"
            ) from error


# -- the two coloured LEDs, on the board and on its lid, as a status light ---------------------------------------------


@dataclass(frozen=True, slots=True)
class ThunderBorgLightSettings:
    """Where the board is: as for the motors."""

    bus: str = "/dev/i2c-1"
    """Device file of the I2C bus."""
    address: Annotated[int, Interval(ge=0x03, le=0x77)] = DEFAULT_ADDRESS
    """I2C address, 7-bit."""


class ThunderBorgLight:
    """Both LEDs in one colour; implements ``hal.StatusLight``.

    The board ignores colours while its LEDs show the battery. It may acknowledge a colour without showing it: a user in
    PiBorg's forum had to send each twice. So each change is sent twice, and the same colour is not sent again.
    """

    part: ClassVar[str] = "light"
    chip: ClassVar[str] = CHIP
    addresses: ClassVar[Sequence[int]] = (DEFAULT_ADDRESS,)
    Settings = ThunderBorgLightSettings

    def __init__(self, settings: ThunderBorgLightSettings, buses: Buses) -> None:
        self._board = ThunderBorgLink(buses.i2c(settings.bus), settings.address)
        self.name = f"light of {self._board.where}"
        self._shown: Colour | None = None

    async def open(self) -> None:
        """Find the board and take its LEDs from the battery display."""
        self._shown = None
        await self.identify()
        await self._board.write(Opcode.SET_LEDS_SHOW_BATTERY, 0)

    async def identify(self) -> None:
        """Ask the board for its id; changes nothing. Raises as ``ThunderBorgLink.identify``."""
        await self._board.identify()

    async def close(self) -> None:
        """Nothing to release; the last colour stays."""

    async def show(self, colour: Colour) -> None:
        """Show a colour until the next call, in 255 steps of each part."""
        if colour == self._shown:
            return
        red, green, blue = (round(_FULL_COLOUR * part) for part in colour)
        for _ in range(2):
            await self._board.write(Opcode.SET_BOTH_LEDS, red, green, blue)
        self._shown = colour
