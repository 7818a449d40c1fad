"""Basicmicro RoboClaw: a motor board on a serial port, with a deadman that it can be asked for.

``roboclaw_board.py`` speaks to it. Boards: RoboClaw Solo to 2x60A, and the MCP series, in *packet serial* mode.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from struct import unpack
from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Interval, MultipleOf

from wayfarer.drivers.buses import Buses
from wayfarer.drivers.levels import MotorLevels
from wayfarer.drivers.roboclaw_board import CHIP, FULL_DUTY, TIMEOUT_UNITS_PER_S, Opcode, link_to
from wayfarer.errors import BadReading, NotResponding, PowerLost
from wayfarer.hal import STOP, MotorHealth, WheelCommand

Baud = Literal[38400, 57600, 115200, 230400, 460800]

_TIMEOUT_TRIES = 3
_UNITS_PER_VOLT = 10
# What goes over the wire for a command to move (timeout and duties) and for a reading of the wheels (counters and
# currents): bytes sent and received, and in how many requests. The board needs more than 3 ms for an answer: with 5 ms
# every answer of 8 bytes at 38400 baud was late (zauberzeug/lizard, pull request 294).
_DRIVE_BYTES, _WHEELS_BYTES, _REQUESTS = 14, 20, 2
_ANSWERS_AFTER_S = 0.004
_WHEELS_HZ = 20.0
_BITS_PER_BYTE = 10  # with start and stop bit
_LOAD_MAX = 0.7  # of the time; the rest is for stops and health, and for a process that Linux wakes late


@dataclass(frozen=True, slots=True)
class RoboClawSettings:
    """How the board is wired and set up: packet serial, with its address and baud rate, in Motion Studio."""

    port: str = "/dev/serial0"
    """Device file of the serial port. By USB it is found under ``/dev/serial/by-id``, by a name that has Roboclaw in
    it. On a Pi 5 the header's pins are ``/dev/ttyAMA0``."""
    baud: Baud = 38400
    """Speed of the serial line in bit/s, as in Motion Studio; by USB any."""
    address: Annotated[int, Interval(ge=128, le=135)] = 128
    """Address of the board, 0x80 to 0x87."""
    left: Literal[1, 2] = 1
    """The output of the left wheels, M1 or M2, by its number; the other one drives the right ones."""
    reverse_left: bool = False
    """The left motors turn backwards when they are commanded forwards."""
    reverse_right: bool = False
    """The right motors turn backwards when they are commanded forwards."""
    timeout_s: Annotated[float, Interval(ge=0.2, le=2), MultipleOf(0.1)] = 0.2
    """The board's own serial timeout, in whole tenths of a second. It is set at each opening, and read back. Requests
    may feed it too, so the wheels stop by themselves within twice this time after the last command."""
    duty_limit: Annotated[float, Interval(gt=0, le=1)] = 1.0
    """The highest share of the battery's voltage that the motors may get."""

    @property
    def deadman_s(self) -> float:
        """How long after the last byte the board stops the motors."""
        return self.timeout_s

    def keeps_up_with(self, control_hz: float) -> str | None:
        """Return None if the board can take so many commands per second beside its wheels, otherwise the reason."""
        bytes_per_s = _DRIVE_BYTES * control_hz + _WHEELS_BYTES * _WHEELS_HZ
        load = bytes_per_s * _BITS_PER_BYTE / self.baud + _REQUESTS * (control_hz + _WHEELS_HZ) * _ANSWERS_AFTER_S
        return None if load <= _LOAD_MAX else f"baud = {self.baud}: the board would answer too late"


class _Fault(NamedTuple):
    """A fault of the board: its bit in a status of 16 bits (old firmware) and of 32 bits, and its sentence."""

    in_16: int
    in_32: int
    text: str


_FAULTS = (
    _Fault(0x0004, 0x0001, "emergency stop: release it; if it latches, switch the board off and on"),
    _Fault(0x0008, 0x0002, "too hot: let the board cool, and give it air"),
    _Fault(0x0010, 0x0004, "too hot at its second sensor: let the board cool, and give it air"),
    _Fault(0x0020, 0x0008, "main battery voltage too high: motors that brake charge it, or its limit is too low"),
    _Fault(0x0040, 0x0010, "logic voltage too high: check what feeds LB+"),
    _Fault(0x0080, 0x0020, "logic voltage too low: charge the battery, or check what feeds LB+"),
    _Fault(0x0100, 0x0040, "{M1}: driver fault: check the motor's wires for a short, switch the board off and on"),
    _Fault(0x0200, 0x0080, "{M2}: driver fault: check the motor's wires for a short, switch the board off and on"),
    _Fault(0, 0x1000, "{M1}: current too high: look for a blocked wheel or a short"),
    _Fault(0, 0x2000, "{M2}: current too high: look for a blocked wheel or a short"),
    _Fault(0, 0x4000, "main battery voltage too low: charge it, or lower the limit in Motion Studio"),
)
_LIMITS_CURRENT = _Fault(0x0001, 0x10000, ""), _Fault(0x0002, 0x20000, "")  # of M1 and M2: warnings


class RoboClaw:
    """Both motors of a RoboClaw; implements ``hal.DriveMotors``.

    A duty of 1 is ``duty_limit``. Duties are rounded to the board's 32767 steps, towards zero.

    The deadman is the board's serial timeout. ``open`` sets it and reads it back, because there is firmware that does
    not acknowledge it; nothing is stored in the board. Whether the board forgets it with its power depends on what is
    stored there. So it is read before each command to move, and no such command is sent if it is not ours.

    Warnings are not faults. A motor whose current the board limits gets less than was commanded, and ``read_back``
    reports the command then: a rover that pushes against a trunk obeys.

    ``error_counts`` counts the requests that were tried again, and how often the board had lost its power.
    """

    part: ClassVar[str] = "motors"
    chip: ClassVar[str] = CHIP
    Settings = RoboClawSettings

    def __init__(self, settings: RoboClawSettings, buses: Buses) -> None:
        self._board = link_to(buses.serial(settings.port, baud=settings.baud), settings.address)
        self.name = self._board.where
        self.deadman_s: float | None = 2.0 * settings.timeout_s  # requests may have fed it once more
        self._timeout_s = settings.timeout_s
        self._timeout = bytes((round(settings.timeout_s * TIMEOUT_UNITS_PER_S),))
        self._is_swapped = settings.left == 2
        self._levels = MotorLevels(
            FULL_DUTY * settings.duty_limit, reverse_left=settings.reverse_left, reverse_right=settings.reverse_right
        )
        sides = ("right", "left") if self._is_swapped else ("left", "right")
        self._outputs = {f"M{at}": f"M{at} ({side})" for at, side in enumerate(sides, 1)}
        self._told = (0, 0)  # M1 and M2
        self._is_limited = (False, False)
        self._power_losses = 0
        self._forgot = False  # the board has lost its power, and its timeout, since it was last opened

    @property
    def error_counts(self) -> dict[str, int]:
        """How many requests were tried again, and how often the board was found to have lost its power."""
        return {"requests retried": self._board.retries, "power lost": self._power_losses}

    async def open(self) -> None:
        """Find the board, stop both motors, set its timeout, and read that back.

        Raises:
            NotResponding: no answer, or the timeout does not stay set.
            WrongPart: something else answers.
            BadReading: a RoboClaw does, damaged or too late.
        """
        version = await self._board.identify()
        self.name = f"{self._board.where} ({version})"
        await self.drive(STOP)
        if not await self._arm():
            raise NotResponding(f"{self.name}: {self._does_not_arm()}")
        self._forgot = False

    async def close(self) -> None:
        """Nothing to release; the timeout stays set."""

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command, both sides at once; duties beyond -1..1 count as these.

        A ``halt`` that comes meanwhile has priority: the motors are stopped after it. So they are if the command took
        longer than the timeout, because the process was suspended meanwhile.

        Raises:
            NotResponding: not acknowledged.
            PowerLost: the board had lost its power since it was opened. Its timeout was set again.
        """
        left, right = self._levels.of(command)
        halts, retries = self._board.halts, self._board.retries
        clock = asyncio.get_running_loop().time
        ends_s = clock() + self._timeout_s
        if left or right:
            await self._refuse_without_timeout()
        if self._board.halts == halts and clock() <= ends_s:
            await self._set(left, right)
        if (left or right) and self._board.retries != retries:  # a board that was silent may have just started
            await self._refuse_without_timeout()
        if self._board.halts != halts or clock() > ends_s:
            await self.stop()
            return STOP
        return self._levels.duties(left, right)

    async def stop(self) -> None:
        """Stop both motors; never raises. If the port hangs, the stop is sent first after that."""
        try:
            await self._set(0, 0)
        except Exception:
            self.halt()

    def halt(self) -> None:
        """Stop both motors without waiting."""
        self._board.halt()

    async def read_back(self) -> WheelCommand:
        """Return the duties that the board says it applies; zero once the timeout has tripped.

        Raises:
            NotResponding: no answer.
            BadReading: an answer that cannot be true.
        """
        says = unpack(">hh", await self._board.ask(Opcode.GET_DUTIES, 4))
        if max(map(abs, says)) > FULL_DUTY + 1:
            raise BadReading(f"{self.name}: duties of {says} of {FULL_DUTY}")
        first, second = (
            told if limited and told and 0.0 < said / told <= 1.0 else said
            for said, told, limited in zip(says, self._told, self._is_limited, strict=True)
        )
        return self._levels.duties(second, first) if self._is_swapped else self._levels.duties(first, second)

    async def health(self) -> MotorHealth:
        """Return the main battery's voltage, in tenths, and the faults of the board's status.

        Raises:
            NotResponding: no answer.
            BadReading: an answer that cannot be true.
        """
        battery_v = int.from_bytes(await self._board.ask(Opcode.GET_BATTERY, 2), "big") / _UNITS_PER_VOLT
        status = await self._board.ask(Opcode.GET_STATUS, 2, 4)
        faults = [] if await self._keep_timeout() else [self._does_not_arm()]
        flags, is_old = int.from_bytes(status, "big"), len(status) == 2
        said = [each.text for each in _FAULTS if flags & (each.in_16 if is_old else each.in_32)]
        first, second = (bool(flags & (each.in_16 if is_old else each.in_32)) for each in _LIMITS_CURRENT)
        self._is_limited = first, second
        return MotorHealth(battery_v, (*faults, *(text.format(**self._outputs) for text in said)))

    async def _set(self, left: int, right: int) -> None:
        self._told = (right, left) if self._is_swapped else (left, right)
        await self._board.drive(*self._told, self._timeout_s)

    async def _refuse_without_timeout(self) -> None:
        await self._keep_timeout()
        if self._forgot:
            await self.stop()
            raise PowerLost(self.name)

    async def _keep_timeout(self) -> bool:
        """Read the timeout, and set it if it is not ours; return whether it is now."""
        if await self._board.ask(Opcode.GET_TIMEOUT, 1) == self._timeout:
            return True
        self._forgot = True
        self._power_losses += 1
        return await self._arm()

    async def _arm(self) -> bool:
        """Set the timeout and read it back; return whether it is set."""
        for _ in range(_TIMEOUT_TRIES):
            if await self._board.set_timeout(self._timeout):
                return True
        return False

    def _does_not_arm(self) -> str:
        return (
            f"its timeout does not stay at {self._timeout_s:g} s: set {_TIMEOUT_TRIES} times, another is read, and "
            "nothing would stop the wheels if this computer failed: update the firmware in Motion Studio"
        )
