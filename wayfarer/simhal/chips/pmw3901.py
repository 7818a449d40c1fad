"""Simulated PMW3901 on SPI: banks, start-up, motion burst (docs/reference/hardware.md).

It counts from the end of its start-up on: once registers 02..06 have been read after a reset and the table's last block
has been written. Until then its counts are 0, its observation byte is not BF, and the sensor is left alone; after that
every burst, and every read of register 02, samples the sensor once. The sensor knows no reset: what moved while the
chip restarted is in the next count.

What the chip does not know fails: frame grab, shutdown, and any register that no published start-up table names.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from struct import Struct, pack
from types import MappingProxyType
from typing import Final

from mypy_extensions import mypyc_attr

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.sensor_models import FlowSensorModel

BANK: Final = 0x7F
BURST: Final = 0x16
ORIENTATION: Final = 0x5B
MOTION: Final = range(0x02, 0x07)  # motion byte, then both displacements, low byte first
PICTURE: Final = range(0x07, 0x0D)  # SQUAL, raw sum, maximum and minimum, shutter lower and upper
BURST_LENGTH: Final = 13
_BURST: Final = Struct("<BBhh6B")  # what follows the first byte of one
WAKE_S: Final = 0.001  # the data sheet's least wait after a reset
TWO_FRAMES_S: Final = 0.015
SQUAL_KNEE: Final = 0x19  # below a knee it reports no motion (PX4 #28632); where, nobody says: the data sheet's "dark"
_REMEMBERED_WRITES: Final = 200  # an opening writes some 90
RAW_SUM: Final = 0x55  # of an ordinary picture
RAW_MAX: Final = 0xA0
RAW_MIN: Final = 0x1E

WRITABLE: Final = {
    bank: bytes.fromhex(registers)
    for bank, registers in {
        0x00: "15 3A 40 44 45 4A 4B 4D 4E 50 51 54 55 5A 5B 61 64 65 74 75",
        0x03: "40",
        0x05: "41 43 45 5B 5F 7B",
        0x06: "40 44 4E 62 63",
        0x07: "32 40 41 43 44 45 4B 4C 70",
        0x08: "65 6A",
        0x09: "48 49 4F 57 5F 60 61 62 63",
        0x0A: "45",
        0x0D: "48 6F",
        0x0E: "43 48 70 71",
        0x10: "5B",
        0x14: "63 65 66 6F",
        0x15: "48",
    }.items()
}
READABLE: Final = {
    **WRITABLE,
    0x00: WRITABLE[0x00] + bytes.fromhex("00 01 02 03 04 05 06 07 08 09 0A 0B 0C 16 5F"),
    0x0E: WRITABLE[0x0E] + bytes.fromhex("47 67 73"),
}
FACTORY: Final[Mapping[tuple[int, int], int]] = MappingProxyType(
    {
        (0x00, 0x00): 0x49,
        (0x00, 0x01): 0x01,
        (0x00, 0x5F): 0xB6,
        (0x00, ORIENTATION): 0xA0,
        (0x0E, 0x67): 0x80,
        (0x0E, 0x70): 20,
        (0x0E, 0x71): 100,
        (0x0E, 0x73): 0x00,
    }
)


def as_on_the_crazyflie(forward: int, right: int) -> tuple[int, int]:
    """Return the chip's x and y for a displacement of a body that carries it as the Crazyflie does."""
    return right, -forward


@mypyc_attr(allow_interpreted_subclasses=True)
class PMW3901Chip:
    """The chip; implements ``buses.SPIChip``.

    Args:
        sense: the displacement of the body, in counts.
        clock: seconds.
        mounting: the chip's x and y counts from those forward and right.
        factory: what registers hold after a reset, by (bank, register), if it is not what ``FACTORY`` says.
        probes_needed: how many writes of 43=10 it takes until register 47 says 08.

    Attributes:
        writes: the latest writes as (register, value), in order.
        squal: what the picture is worth, unless the sensor reports less. Below 19 hex nothing is seen to move; 76 is
            an indoor floor.
        shutter: exposure in 0..8191; 1F00 hex and more is the longest, in the dark.
    """

    def __init__(
        self,
        sense: FlowSensorModel,
        clock: Callable[[], float],
        *,
        mounting: Callable[[int, int], tuple[int, int]] = as_on_the_crazyflie,
        factory: Mapping[tuple[int, int], int] | None = None,
        probes_needed: int = 1,
    ) -> None:
        self.writes: deque[tuple[int, int]] = deque(maxlen=_REMEMBERED_WRITES)
        self.squal, self.shutter = 76, 600
        self._sense, self._clock, self._mounting = sense, clock, mounting
        self._factory = {**FACTORY, **(factory or {})}
        self._probes_needed = probes_needed
        self._awake_s = 0.0
        self.power_cycle()

    def power_cycle(self) -> None:
        """Forget everything, as a reset does too."""
        self._registers = dict(self._factory)
        self._bank = self._probes = 0
        self._unread = set(MOTION)
        self._running = False
        self._observed_s = 0.0

    def exchange(self, data: bytes) -> bytes:
        """Take one write, one read of a register, or one burst.

        Raises:
            ChipMisuse: a register that is not there, a wrong length, or a word too soon after the reset.
        """
        if len(data) != (BURST_LENGTH if data[:1] == bytes((BURST,)) else 2):
            raise ChipMisuse(
                f"PMW3901: {len(data)} bytes ({data.hex(' ')}); a register takes 2, a burst {BURST_LENGTH}"
            )
        now_s = self._clock()
        if now_s < self._awake_s:
            raise ChipMisuse(f"PMW3901: spoken to within {WAKE_S * 1e3:g} ms of its reset")
        register = data[0] & 0x7F
        if data[0] & 0x80:
            self._write(register, data[1], now_s)
            return bytes(2)
        self._check(register, READABLE)
        return b"\0" + (self._burst(now_s) if register == BURST else bytes((self._read(register, now_s),)))

    def _check(self, register: int, registers: Mapping[int, bytes]) -> None:
        if register not in registers.get(self._bank, b""):
            raise ChipMisuse(
                f"PMW3901: no such register 0x{register:02X} in bank 0x{self._bank:02X}, or not to be written"
            )

    def _write(self, register: int, value: int, now_s: float) -> None:
        self.writes.append((register, value))
        if register == BANK:
            if value not in WRITABLE:
                raise ChipMisuse(f"PMW3901: no bank 0x{value:02X}")
            self._bank = value
            return
        self._check(register, WRITABLE)
        self._registers[self._bank, register] = value
        match self._bank, register, value:
            case 0x00, 0x3A, 0x5A:
                self.power_cycle()
                self._awake_s = now_s + WAKE_S
            case 0x00, 0x15, _:
                self._observed_s = now_s + TWO_FRAMES_S
            case 0x00, 0x40, 0x80:
                self._running = not self._unread
            case 0x0E, 0x43, 0x10:
                self._probes += 1

    def _read(self, register: int, now_s: float) -> int:
        match self._bank, register:
            case 0x00, 0x02:
                x, y = self._counts(now_s)
                for at, value in zip(MOTION, pack("<Bhh", _motion(x, y), x, y), strict=True):
                    self._registers[0x00, at] = value
            case 0x00, 0x15:
                return self._observation(now_s)
            case 0x00, at if at in PICTURE:
                upper, lower = divmod(self.shutter, 256)
                return (self._worth(), RAW_SUM, RAW_MAX, RAW_MIN, lower, upper)[at - PICTURE.start]
            case 0x0E, 0x47:
                return 0x08 if self._probes >= self._probes_needed else 0x00
        if self._bank == 0x00:
            self._unread.discard(register)
        return self._registers.get((self._bank, register), 0x00)

    def _burst(self, now_s: float) -> bytes:
        x, y = self._counts(now_s)
        upper, lower = divmod(self.shutter, 256)
        return _BURST.pack(
            _motion(x, y), self._observation(now_s), x, y, self._worth(), RAW_SUM, RAW_MAX, RAW_MIN, upper, lower
        )

    def _worth(self) -> int:
        return min(self.squal, self._sense.squal)

    def _observation(self, now_s: float) -> int:
        return 0xBF if self._running and now_s >= self._observed_s else 0x00

    def _counts(self, now_s: float) -> tuple[int, int]:
        """Return the counts since the last call, which start again at 0."""
        if not self._running:
            return 0, 0
        x, y = self._mounting(*self._sense.sample(now_s))
        if self.squal < SQUAL_KNEE:
            return 0, 0
        x, y = orient(self._registers[0x00, ORIENTATION], x, y)
        return _saturate(x), _saturate(y)


def _motion(x: int, y: int) -> int:
    """Return the motion byte that goes with counts."""
    return 0xB0 if x or y else 0x30


def orient(register: int, x: int, y: int) -> tuple[int, int]:
    """Return the counts as register 5B changes them: bit 7 swaps, then bit 5 inverts x and bit 6 inverts y.

    ``x`` and ``y`` are as under A0, which the start-up table leaves there.
    """
    x, y = y, -x  # what A0 was made of
    if register & 0x80:
        x, y = y, x
    return -x if register & 0x20 else x, -y if register & 0x40 else y


def _saturate(counts: int) -> int:
    return max(-0x8000, min(counts, 0x7FFF))
