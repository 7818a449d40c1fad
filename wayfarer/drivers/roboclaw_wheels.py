"""The wheels of a RoboClaw: its two encoder counters and its two motor currents, on the port of its motors.

Counters are 32 bits wide and wrap; currents come in steps of 10 mA (RoboClaw Series User Manual, commands 49 and 78).
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from struct import unpack
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from wayfarer.drivers.buses import Buses
from wayfarer.drivers.roboclaw import Baud
from wayfarer.drivers.roboclaw_board import A_PER_STEP, CHIP, Opcode, link_to
from wayfarer.hal import WheelReading

_HALF = 1 << 31  # of what a counter can hold
_JUMP_M_S = 10.0  # no rim is so fast: the counters began again. Chosen by us


@dataclass(frozen=True, slots=True)
class RoboClawWheelsSettings:
    """Where the board is, as for its motors, and what its encoders count."""

    port: str = "/dev/serial0"
    """Device file of the serial port, as in ``[parts.motors]``."""
    baud: Baud = 38400
    """Speed of the serial line in bit/s, as in ``[parts.motors]``."""
    address: Annotated[int, Interval(ge=128, le=135)] = 128
    """Address of the board, 0x80 to 0x87."""
    counts_per_m: Annotated[float, Interval(gt=0, le=1e6)] | None = None
    """Counts for each metre that the rim of a wheel turns: turn a wheel once, and divide the counts by its
    circumference. Without a value no encoders are wired, and only the currents are read."""
    left: Literal[1, 2] = 1
    """The output of the left wheels, M1 or M2, by its number, and their encoder, 1 or 2."""
    reverse_left: bool = False
    """The left encoder counts down when its wheels turn forwards."""
    reverse_right: bool = False
    """The right encoder counts down when its wheels turn forwards."""


class RoboClawWheels:
    """Encoders and currents of a RoboClaw; implements ``hal.WheelSensor``.

    ``error_counts`` counts how often the counters began again, as they do if the board loses its power.
    """

    part: ClassVar[str] = "wheels"
    chip: ClassVar[str] = CHIP
    Settings = RoboClawWheelsSettings

    def __init__(self, settings: RoboClawWheelsSettings, buses: Buses) -> None:
        self._board = link_to(buses.serial(settings.port, baud=settings.baud), settings.address)
        self.name = f"wheels of {self._board.where}"
        self._m_per_count = 1.0 / settings.counts_per_m if settings.counts_per_m else None
        self._is_swapped = settings.left == 2
        self._signs = (-1 if settings.reverse_left else 1), (-1 if settings.reverse_right else 1)
        self._counted: tuple[float, int, int] | None = None  # when, and the counters of left and right
        self._restarts = 0

    @property
    def error_counts(self) -> dict[str, int]:
        """How often the counters began again."""
        return {"counters restarted": self._restarts}

    async def open(self) -> None:
        """Find the board; what its wheels did before is not known. Raises as ``RoboClawLink.identify``."""
        await self._board.identify()
        self._counted = None

    async def close(self) -> None:
        """Nothing to release."""

    async def read(self) -> WheelReading:
        """Return the way of the rims since the previous read, and the size of the currents now.

        Raises:
            NotResponding: no answer.
            BadReading: an answer that cannot be true.
        """
        left, right = self._sides(">hh", await self._board.ask(Opcode.GET_CURRENTS, 4))
        ways: tuple[float | None, float | None] = None, None
        if self._m_per_count is not None:  # last: after them nothing fails, and no way is lost
            counters = self._sides(">II", await self._board.ask(Opcode.GET_ENCODERS, 8))
            ways = self._ways(self._m_per_count, counters)
        return WheelReading(asyncio.get_running_loop().time(), *ways, abs(left) * A_PER_STEP, abs(right) * A_PER_STEP)

    def _sides(self, layout: str, data: bytes) -> tuple[int, int]:
        """Return what the board says of M1 and M2, of left and right."""
        first, second = unpack(layout, data)
        return (second, first) if self._is_swapped else (first, second)

    def _ways(self, m_per_count: float, counters: tuple[int, int]) -> tuple[float | None, float | None]:
        now_s, before = asyncio.get_running_loop().time(), self._counted
        self._counted = (now_s, *counters)
        if before is None:
            return None, None
        left_m, right_m = (
            sign * ((counter - last + _HALF) % (2 * _HALF) - _HALF) * m_per_count
            for sign, counter, last in zip(self._signs, counters, before[1:], strict=True)
        )
        if max(abs(left_m), abs(right_m)) > _JUMP_M_S * (now_s - before[0]) + m_per_count:
            self._restarts += 1
            return None, None
        return left_m, right_m
