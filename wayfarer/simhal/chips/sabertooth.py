"""Simulated Sabertooth 2x12 in packetised serial mode; it drives the simulated world's wheels.

Packets and commands as in the Sabertooth 2x12 User's Guide (April 2012), pages 15 to 20. Settings are stored; of them
only the serial timeout has an effect: ramping, deadband and voltage limits do not change how the simulated motors turn.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Final, Literal, NamedTuple

from mypy_extensions import mypyc_attr

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_board import MotorBoardChip
from wayfarer.simhal.world.simulated_world import SimulatedWorld

ADDRESS: Final = 128
FULL_LEVEL: Final = 127.0  # the level that is duty 1 in the world

_PACKET_BYTES: Final = 4
_ADDRESS_BIT: Final = 0x80  # set in the first byte of a packet, and in that one only
_CENTRE: Final = 64  # of a 7-bit command: 0 is full back, 127 full forward

_MINIMUM_VOLTAGE: Final = 2
_MAXIMUM_VOLTAGE: Final = 3
_SERIAL_TIMEOUT: Final = 14
_BAUD: Final = 15
_RAMPING: Final = 16
_DEADBAND: Final = 17
# Pages 18 and 19. The user's guide gives no end for the maximum voltage and the timeout.
_SETTINGS: Final = {
    _MINIMUM_VOLTAGE: range(121),
    _MAXIMUM_VOLTAGE: range(128),
    _SERIAL_TIMEOUT: range(128),
    _BAUD: range(1, 5),
    _RAMPING: range(1, 81),
    _DEADBAND: range(128),
}
_PERSISTENT: Final = {_BAUD, _RAMPING, _DEADBAND}
_TIMEOUT_UNIT_S: Final = 0.1


class _Move(NamedTuple):
    """A motor command: its set, which of the set's two values it gives, and that value's level for a data byte."""

    mixed: bool
    value: int
    level: Callable[[int], float]


def _ahead(data: int) -> float:
    return data


def _back(data: int) -> float:
    return -data


def _both_ways(data: int) -> float:
    """Return the level of a 7-bit command, -127 to 127."""
    off = data - _CENTRE
    return off * FULL_LEVEL / (_CENTRE if off < 0 else 127 - _CENTRE)


_MOVES: Final = {
    0: _Move(False, 0, _ahead),
    1: _Move(False, 0, _back),
    4: _Move(False, 1, _ahead),
    5: _Move(False, 1, _back),
    6: _Move(False, 0, _both_ways),
    7: _Move(False, 1, _both_ways),
    8: _Move(True, 0, _ahead),
    9: _Move(True, 0, _back),
    10: _Move(True, 1, _ahead),
    11: _Move(True, 1, _back),
    12: _Move(True, 0, _both_ways),  # 12 and 13: from the compatible set of other boards, unconfirmed for the 2x12
    13: _Move(True, 1, _both_ways),
}


@mypyc_attr(allow_interpreted_subclasses=True)
class SabertoothChip(MotorBoardChip):
    """Implements ``buses.SerialChip``.

    Args:
        address: as set on the DIP switches, 128 to 135.
        left: the output that the left wheels are on, M1 or M2; the other drives the right ones.

    Packets for other addresses and the AA of older boards' baud detection are passed over. ``settings`` holds the data
    of the latest setting commands; ``dropped`` counts packets that broke off or whose checksum was wrong. Any packet
    keeps the serial timeout from tripping. In mixed mode M1 turns faster in a turn to the right, which is assumed: the
    rover's driver does not use it.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], *,
        address: int = ADDRESS, full_level: float = FULL_LEVEL,
        left: Literal[1, 2] = 1, reverse_left: bool = False, reverse_right: bool = False,
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
        self._mixed = False
        self._values: list[float | None] = [0, 0]

    @property
    def stops_by_s(self) -> float:
        """When the serial timeout stops the motors unless a packet comes before; infinite while it is off."""
        timeout_s = self.settings.get(_SERIAL_TIMEOUT, 0) * _TIMEOUT_UNIT_S
        return self._heard_s + timeout_s if timeout_s else inf

    def power_cycle(self) -> None:
        """Lose power for a moment: motors off, voltage limits and the serial timeout forgotten."""
        self.tick()
        self.settings = {command: data for command, data in self.settings.items() if command in _PERSISTENT}
        self._packet.clear()
        self._mixed = False
        self._stop(self._clock())

    def receive(self, data: bytes) -> None:
        """Take bytes, in pieces of any length; an address begins a new packet, even if the last one is incomplete."""
        self.tick()
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

    # -- packets -------------------------------------------------------------------------------------------------

    def _check(self, address: int, command: int, data: int, checksum: int) -> None:
        if (address + command + data) & 0x7F != checksum:
            self.dropped += 1
        elif command in _MOVES:
            self._heard_s = self._clock()
            self._move(_MOVES[command], data)
        elif data in _SETTINGS.get(command, ()):
            self._heard_s = self._clock()
            self.settings[command] = data
        else:
            raise ChipMisuse(f"Sabertooth: command {command} with data {data}")

    # -- motors --------------------------------------------------------------------------------------------------

    def _move(self, move: _Move, data: int) -> None:
        """Take one value; the first of another set stops the motors until the second has come."""
        values: list[float | None] = [None, None] if move.mixed is not self._mixed else [*self._values]
        values[move.value] = move.level(data)
        self._mixed = move.mixed
        self._values = values
        self._turn(self._heard_s, self._levels(*values))

    def _stop(self, t_s: float) -> None:
        self._values = [0, 0]
        super()._stop(t_s)

    def _levels(self, first: float | None, second: float | None) -> tuple[float, float]:
        """Return the levels of M1 and M2, -127 to 127, negative for back."""
        if first is None or second is None:
            return 0, 0
        if not self._mixed:
            return first, second
        return _within_full(first + second), _within_full(first - second)


def _within_full(level: float) -> float:
    return max(-FULL_LEVEL, min(FULL_LEVEL, level))
