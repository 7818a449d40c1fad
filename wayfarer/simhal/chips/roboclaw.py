"""Simulated RoboClaw on a serial line, which drives the simulated world's wheels.

Packets, CRC and commands are those of the RoboClaw Series User Manual, pages 58 to 74, as far as the rover's driver
uses them. If sources disagree the chip takes the harder case: requests feed the timeout, and a board that lost its
power has none.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Mapping
from math import inf
from struct import pack, unpack
from typing import Final, Literal, NamedTuple

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_boards import MotorBoardChip
from wayfarer.simhal.world.simulated_world import SimulatedWorld

ROBOCLAW_ADDRESS: Final = 0x80
ROBOCLAW_FAULT: Final = 0x40  # a driver fault of M1, in a status of four bytes
ROBOCLAW_FULL_LEVEL: Final = 32767.0  # the level that is duty 1 in the world

_PACKET_GAP_S: Final = 0.010  # page 59: after a longer one a packet that is not whole is dropped
_TIMEOUT_UNIT_S: Final = 0.1
_A_PER_STEP: Final = 0.01
_ACKNOWLEDGED: Final = b"\xff"
_CRC_BYTES: Final = 2
_SET_TIMEOUT: Final = 14
_SET_DUTIES: Final = 34
_WRITES: Final = {_SET_TIMEOUT: 1, _SET_DUTIES: 4}  # and how many bytes of data they have


class Encoders(NamedTuple):
    """How the wheels' encoders are wired: the way of a rim for a count, at which input the left one is, their signs."""

    m_per_count: float
    left_is_second: bool
    left_sign: int
    right_sign: int


class RoboClawChip(MotorBoardChip):
    """Implements ``buses.SerialChip``.

    Args:
        address: 0x80 to 0x87; packets for others are passed over.
        left: the output that the left wheels are on, M1 or M2; the other drives the right ones.
        version: what it says that it is.
        status_bytes: 2 with older firmware, 4 with newer; ``status`` has its flags.
        acknowledges_one_byte: False for firmware 4.3.6, which does not acknowledge a command with one byte of data.
        fed_by_requests: whether a request keeps the serial timeout from tripping.

    ``encoders`` are None if there are none: their counters stay where they are. Counters wrap at 32 bits.
    ``timeout`` is in tenths of a second, 0 is off; ``keeps_timeout`` is False for a board that takes none. ``dropped``
    counts packets that broke off or whose CRC was wrong.
    """

    def __init__(
        self, world: SimulatedWorld, clock: Callable[[], float], *,
        address: int = ROBOCLAW_ADDRESS, full_level: float = ROBOCLAW_FULL_LEVEL, left: Literal[1, 2] = 1,
        reverse_left: bool = False, reverse_right: bool = False,
        version: str = "USB Roboclaw 2x15a v4.1.34", status_bytes: Literal[2, 4] = 4,
        acknowledges_one_byte: bool = True, fed_by_requests: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(
            world, clock, full_level,
            left_is_second=left == 2, reverse_left=reverse_left, reverse_right=reverse_right,
        )  # fmt: skip
        self.version, self.status_bytes = version, status_bytes
        self.acknowledges_one_byte, self.fed_by_requests = acknowledges_one_byte, fed_by_requests
        self.status = self.timeout = self.dropped = 0
        self.keeps_timeout = True
        self.encoders: Encoders | None = None
        self.counters_began = (0, 0)  # what the encoders had counted when the board got its power
        self._address = address
        self._packet = b""
        self._byte_s = self._fed_s = -inf
        self._answers: Mapping[int, Callable[[], bytes]] = {
            15: lambda: bytes((self.timeout,)),
            21: lambda: self.version.encode() + b"\n\0",
            24: lambda: round(self._world.battery_v * 10.0).to_bytes(2, "big"),
            78: lambda: pack(">II", *(count % 2**32 for count in self._counters())),
            48: lambda: pack(">hh", *map(int, self.levels)),
            49: lambda: pack(">hh", *self._currents()),
            90: lambda: self.status.to_bytes(self.status_bytes, "big"),
        }

    @property
    def stops_by_s(self) -> float:
        """When the serial timeout stops the motors unless it is fed before; infinite while it is off."""
        return self._fed_s + self.timeout * _TIMEOUT_UNIT_S if self.timeout else inf

    def power_cycle(self) -> None:
        """Lose power for a moment: motors off, timeout forgotten."""
        self.tick()
        self.timeout, self._packet = 0, b""
        self.counters_began = self._counted()
        self._stop(self._clock())

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any length, and return what it answers."""
        self.tick()
        now_s = self._clock()
        if self._packet and now_s - self._byte_s > _PACKET_GAP_S:
            self.dropped += 1
            self._packet = b""
        self._byte_s = now_s
        if not self._packet and data[:1] == bytes((self._address,)) and not self._knows(*data[1:2]):
            raise ChipMisuse(f"RoboClaw: command {data[1]}")
        answer = b""
        for byte in data:
            if self._packet or byte == self._address:
                self._packet += bytes((byte,))
                answer += self._take()
        return answer

    def _knows(self, command: int = _SET_TIMEOUT) -> bool:
        """Return whether there is such a command; one that is still to come may be."""
        return command in self._answers or command in _WRITES

    def _take(self) -> bytes:
        """Do what the packet says, if it is whole."""
        packet = self._packet
        if len(packet) < 2:
            return b""
        command = packet[1]
        if command in self._answers:
            self._packet = b""
            if self.fed_by_requests:
                self._fed_s = self._clock()
            answer = self._answers[command]()
            return answer + crc_hqx(packet + answer, 0).to_bytes(_CRC_BYTES, "big")
        if command not in _WRITES:  # behind a packet that broke off
            self._packet = b""
            self.dropped += 1
            return b""
        if len(packet) < 2 + _WRITES[command] + _CRC_BYTES:
            return b""
        self._packet = b""
        if crc_hqx(packet, 0):
            self.dropped += 1
            return b""
        self._fed_s = self._clock()
        data = packet[2:-_CRC_BYTES]
        if command == _SET_DUTIES:
            first, second = unpack(">hh", data)
            self._turn(self._fed_s, (first, second))
        elif self.keeps_timeout:
            self.timeout = data[0]
        return _ACKNOWLEDGED if self.acknowledges_one_byte or len(data) > 1 else b""

    def _counted(self) -> tuple[int, int]:
        """Return what encoders 1 and 2 have counted so far."""
        if self.encoders is None:
            return 0, 0
        self._world.advance_to(self._clock())
        left_m, right_m = self._world.rims_m
        m_per_count, left_is_second, left_sign, right_sign = self.encoders
        left, right = left_sign * round(left_m / m_per_count), right_sign * round(right_m / m_per_count)
        return (right, left) if left_is_second else (left, right)

    def _counters(self) -> tuple[int, int]:
        (first, second), (began_first, began_second) = self._counted(), self.counters_began
        return first - began_first, second - began_second

    def _currents(self) -> list[int]:
        """Return the currents of M1 and M2, positive."""
        self._world.advance_to(self._clock())
        currents = [0, 0]
        for output, load in zip((self._left, self._right), self._world.motor_load, strict=True):
            currents[output] = round(load * self._world.stall_current_a / _A_PER_STEP)
        return currents
