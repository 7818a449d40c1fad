"""Dimension Engineering Sabertooth 2x12: the motor driver of a Lynxmotion A4WD3, over packetised serial.

Packets and commands are those of the Sabertooth 2x12 User's Guide (April 2012), pages 15 to 20. The link is one way:
the board answers nothing, acknowledges nothing, and drops a packet with a wrong checksum silently.

Older boards, the 2x5, the 2x10 and the first 2x25, store no speed of the line: they take it from the first byte that
they receive, which must be AA (Sabertooth 2x5 and 2x10 User's Guide, page 15; not before two seconds after power-up).
For them there is ``autobaud``. The 2x12, 2x25 V2, 2x32 and 2x60 need none (examples of the maker's Arduino library).
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from math import inf
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval, MultipleOf

from wayfarer.drivers.buses import Buses
from wayfarer.drivers.levels import MotorLevels
from wayfarer.hal import STOP, MotorHealth, WheelCommand

FULL_LEVEL = 127

_M1, _M2 = 0, 4  # the commands of a motor: this forward, the next one back
_MINIMUM_VOLTAGE, _SERIAL_TIMEOUT = 2, 14
_TIMEOUT_UNITS_PER_S = 10  # page 19
_UNITS_PER_VOLT, _LOWEST_V = 5, 6.0  # page 18
_CHECKSUM_MASK = 0x7F
# A reset of the board cannot be noticed, and clears its settings. The timeout is sent after each command to move, so
# that the wheels never turn without it for longer than a packet takes; at 2400 baud the wire is too slow for that at
# 20 Hz. All settings are sent again this often.
_RESEND_S = 1.0
_TIMEOUT_EACH_TIME_FROM_BAUD = 9600
_DRIVE_BYTES, _SETTINGS_BYTES, _TIMEOUT_BYTES = 8, 8, 4  # two packets, two packets, one packet
_BITS_PER_BYTE = 10  # with start and stop bit
_LOAD_MAX = 0.7  # of the wire; the rest is for stops, and for a process that Linux wakes late
_STOPS = 3  # bytes may be lost without notice
_AUTOBAUD = b"\xaa"  # page 15 of the 2x5's guide; no address of a board, so one that knows its speed passes it over
_START_UP_S = 2.0  # the same page: until then the board ignores it


def packet(address: int, command: int, data: int) -> bytes:
    """Return one packet: address, command, data and their sum modulo 128 (page 15)."""
    return bytes((address, command, data, (address + command + data) & _CHECKSUM_MASK))


@dataclass(frozen=True, slots=True)
class SabertoothSettings:
    """How the board is wired and switched: packetised serial, with its address on the DIP switches."""

    port: str = "/dev/serial0"
    """Device file of the serial port. On a Pi 5 the header's pins are ``/dev/ttyAMA0``; an adapter is found under
    ``/dev/serial/by-id``, by a name that stays."""
    baud: Literal[2400, 9600, 19200, 38400] = 9600
    """Speed of the serial line in bit/s."""
    autobaud: bool = False
    """The board takes the speed from the byte AA, and no command before: true for a 2x5, a 2x10 or the first 2x25;
    false for a 2x12, 2x25 V2, 2x32 or 2x60. Such a board takes its speed from the first byte after it is switched on:
    switch it on
    before the daemon starts, or off and on again if it does not answer."""
    address: Annotated[int, Interval(ge=128, le=135)] = 128
    """Address of the board, as on its switches."""
    left: Literal[1, 2] = 1
    """The output of the left wheels, M1 or M2, by its number; the other one drives the right ones."""
    reverse_left: bool = False
    """The left motors turn backwards when they are commanded forwards."""
    reverse_right: bool = False
    """The right motors turn backwards when they are commanded forwards."""
    timeout_s: Annotated[float, Interval(ge=0.1, le=12.7), MultipleOf(0.1)] = 0.3
    """The board's own deadman, in whole tenths of a second; off at power-up, so it is sent again behind each command to
    move."""
    battery_min_v: Annotated[float, Interval(ge=6, le=30)] | None = None
    """Below this voltage the board stops the motors; without a value, as it is set itself. It cannot report it."""
    duty_limit: Annotated[float, Interval(gt=0, le=1)] = 1.0
    """The highest share of the battery's voltage that the motors may get."""

    @property
    def deadman_s(self) -> float:
        """How long after the last command the board stops the motors."""
        return self.timeout_s

    @property
    def timeout_each_time(self) -> bool:
        """Whether the wire is fast enough to send the timeout after each command to move."""
        return self.baud >= _TIMEOUT_EACH_TIME_FROM_BAUD

    def keeps_up_with(self, control_hz: float) -> str | None:
        """Return None if the wire is fast enough for this number of commands per second, otherwise the reason.

        Commands that the wire is too slow for wait in the kernel's buffer, and a stop would wait behind them.
        """
        drive_bytes = self.autobaud + _DRIVE_BYTES + _TIMEOUT_BYTES * self.timeout_each_time
        bits_per_s = (drive_bytes * control_hz + _SETTINGS_BYTES / _RESEND_S) * _BITS_PER_BYTE
        if bits_per_s <= _LOAD_MAX * self.baud:
            return None
        return f"baud = {self.baud}: commands would queue on the wire, and a stop would wait behind them"


class Sabertooth:
    """Both motors of a Sabertooth; implements ``hal.DriveMotors``.

    A duty of 1 is ``duty_limit``. Duties are rounded to the board's steps, towards zero, and ``drive`` returns the
    rounded ones: data / (127 * duty_limit).

    The deadman is the board's serial timeout: it is off by default, forgotten at each loss of power, and cannot be read
    back. So it is sent after each command to move; at 2400 baud, once per second. Only a person who watches the wheels
    can confirm that it trips; ``wayfarer check`` asks for this. Without the confirmation, or a reason in the rover
    file, the rover is not armed. This driver also cannot notice that no board is connected to the wire.
    """

    part: ClassVar[str] = "motors"
    Settings = SabertoothSettings

    def __init__(self, settings: SabertoothSettings, buses: Buses) -> None:
        self._port = buses.serial(settings.port, baud=settings.baud)
        self.name = f"Sabertooth {settings.address} on {settings.port}"
        timeout_units = round(settings.timeout_s * _TIMEOUT_UNITS_PER_S)
        self.deadman_s: float | None = timeout_units / _TIMEOUT_UNITS_PER_S
        # Before each command, because a reset of the board cannot be noticed.
        self._greeting = _AUTOBAUD if settings.autobaud else b""
        self._starts_in_s = _START_UP_S if settings.autobaud else 0.0
        self._address = settings.address
        self._halts = 0
        self._levels = MotorLevels(
            FULL_LEVEL * settings.duty_limit, reverse_left=settings.reverse_left, reverse_right=settings.reverse_right
        )
        self._left, self._right = (_M1, _M2) if settings.left == 1 else (_M2, _M1)
        self._timeout = packet(settings.address, _SERIAL_TIMEOUT, timeout_units)
        self._timeout_each_time = settings.timeout_each_time
        self._board_settings = self._timeout
        if settings.battery_min_v is not None:
            units = round((settings.battery_min_v - _LOWEST_V) * _UNITS_PER_VOLT)
            self._board_settings += packet(settings.address, _MINIMUM_VOLTAGE, units)
        self._resend_at_s = -inf

    async def open(self) -> None:
        """Send the board its settings and stop both motors.

        A board with ``autobaud`` may have been switched on together with the computer: nothing is sent to it before it
        can have started, at the first opening.

        Raises:
            NotResponding: the port is gone; a missing board cannot be noticed.
        """
        if self._starts_in_s:
            await asyncio.sleep(self._starts_in_s)
            self._starts_in_s = 0.0
        self._resend_at_s = -inf
        await self.drive(STOP)

    async def close(self) -> None:
        """Nothing to release; the port belongs to the buses."""

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command; duties beyond -1..1 count as these. Both sides, and settings that are due, are one write.

        A ``halt`` that comes meanwhile has priority: a stop is sent again after the command.

        Raises:
            NotResponding: the port is gone.
        """
        left, right = self._levels.of(command)
        halts = self._halts
        now_s = asyncio.get_running_loop().time()
        all_due = now_s >= self._resend_at_s
        # Settings come after the command: a board that starts during these bytes does not move a wheel without them.
        timeout = self._timeout if self._timeout_each_time and (left or right) else b""
        packets = self._motor_packets(left, right) + (self._board_settings if all_due else timeout)
        await self._port.write(self._greeting + packets)
        if all_due:
            self._resend_at_s = now_s + _RESEND_S
        if self._halts != halts:
            await self.stop()
            return STOP
        return self._levels.duties(left, right)

    async def stop(self) -> None:
        """Stop both motors, sent three times; never raises. If the port hangs, the stop is sent first after that."""
        try:
            await self._port.write(self._greeting + self._motor_packets(0, 0) * _STOPS)
        except Exception:
            self.halt()

    def halt(self) -> None:
        """Stop both motors without waiting."""
        self._halts += 1
        self._port.post(self._greeting + self._motor_packets(0, 0) * _STOPS)

    async def read_back(self) -> None:
        """Return None: the board cannot be asked."""

    async def health(self) -> MotorHealth:
        """Return an empty report: the board reports neither voltage nor faults."""
        return MotorHealth(None, ())

    def _motor_packets(self, left: int, right: int) -> bytes:
        left_command, right_command = self._left + (left < 0), self._right + (right < 0)
        return packet(self._address, left_command, abs(left)) + packet(self._address, right_command, abs(right))
