"""Simulated Sabertooth 2x12 in packetised serial mode; it drives the simulated world's wheels.

Packets and commands as in the Sabertooth 2x12 User's Guide (April 2012), pages 15 to 20, as far as the rover's driver
and pysabertooth use them: each motor forward and back, minimum voltage, serial timeout and baud rate. Of the settings
only the serial timeout has an effect. Older boards take the line's speed from the first byte (2x5 and 2x10 User's
Guide, page 15).
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Final, Literal

from mypy_extensions import mypyc_attr

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_board import MotorBoardChip
from wayfarer.simhal.world.simulated_world import SimulatedWorld

ADDRESS: Final = 128
FULL_LEVEL: Final = 127.0  # the level that is duty 1 in the world

_PACKET_BYTES: Final = 4
_ADDRESS_BIT: Final = 0x80  # set in the first byte of a packet, and in that one only

# What each motor command turns: the output (M1, M2), and its direction.
_MOTORS: Final = {0: (0, 1), 1: (0, -1), 4: (1, 1), 5: (1, -1)}
_SERIAL_TIMEOUT: Final = 14
_BAUD: Final = 15
# Minimum voltage, timeout, baud rate (pages 18 and 19). The user's guide gives no end for the timeout.
_SETTINGS: Final = {2: range(121), _SERIAL_TIMEOUT: range(128), _BAUD: range(1, 5)}
_TIMEOUT_UNIT_S: Final = 0.1
_AUTOBAUD: Final = 0xAA
_START_UP_S: Final = 2.0  # for which an older board hears nothing


@mypyc_attr(allow_interpreted_subclasses=True)
class SabertoothChip(MotorBoardChip):
    """Implements ``buses.SerialChip``.

    Args:
        address: as set on the DIP switches, 128 to 135.
        left: the output that the left wheels are on, M1 or M2; the other drives the right ones.
        autobaud: an older board, switched on now. It hears nothing for two seconds. If the first byte then is AA, it
            takes commands; any other makes it take a wrong speed, so that it hears none until its power was off.

    Packets for other addresses, and any other AA, are passed over. ``settings`` holds the data
    of the latest setting commands; ``dropped`` counts packets that broke off or whose checksum was wrong. Any packet
    keeps the serial timeout from tripping.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], *,
        address: int = ADDRESS, full_level: float = FULL_LEVEL,
        left: Literal[1, 2] = 1, reverse_left: bool = False, reverse_right: bool = False, autobaud: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(
            world, clock, full_level,
            left_is_second=left == 2, reverse_left=reverse_left, reverse_right=reverse_right,
        )  # fmt: skip
        self.settings: dict[int, int] = {}
        self.dropped = 0
        self._address = address
        self._heard_s = -inf
        self._packet: list[int] = []
        self._autobaud = autobaud
        self._heard = not autobaud  # the first byte
        self._deaf = False
        self._started_s = clock() + _START_UP_S if autobaud else -inf

    @property
    def stops_by_s(self) -> float:
        """When the serial timeout stops the motors unless a packet comes before; infinite while it is off."""
        timeout_s = self.settings.get(_SERIAL_TIMEOUT, 0) * _TIMEOUT_UNIT_S
        return self._heard_s + timeout_s if timeout_s else inf

    def power_cycle(self) -> None:
        """Lose power for a moment: motors off, minimum voltage and serial timeout forgotten; the baud rate is kept."""
        self.tick()
        self.settings = {command: data for command, data in self.settings.items() if command == _BAUD}
        self._packet.clear()
        if self._autobaud:
            self._heard, self._deaf, self._started_s = False, False, self._clock() + _START_UP_S
        self._stop(self._clock())

    def receive(self, data: bytes) -> None:
        """Take bytes, in pieces of any length; an address begins a new packet, even if the last one is incomplete."""
        self.tick()
        if not data or self._clock() < self._started_s:
            return
        if not self._heard:
            self._heard, self._deaf = True, data[0] != _AUTOBAUD
        if self._deaf:
            return
        packet = self._packet
        for byte in data:
            if byte & _ADDRESS_BIT:
                self.dropped += bool(packet)
                packet.clear()
                if byte == self._address:
                    packet.append(byte)
            elif packet:
                packet.append(byte)
                if len(packet) == _PACKET_BYTES:
                    self._check(packet[0], packet[1], packet[2], packet[3])
                    packet.clear()

    def _check(self, address: int, command: int, data: int, checksum: int) -> None:
        if (address + command + data) & 0x7F != checksum:
            self.dropped += 1
        elif command in _MOTORS:
            self._heard_s = self._clock()
            output, direction = _MOTORS[command]
            first, second = self.levels
            level = direction * data
            self._turn(self._heard_s, (level, second) if output == 0 else (first, level))
        elif data in _SETTINGS.get(command, ()):
            self._heard_s = self._clock()
            self.settings[command] = data
        else:
            raise ChipMisuse(f"Sabertooth: command {command} with data {data}")
