"""The registers of a PMW3901: decodes its motion burst, and the values that it is started with. Pure.

The start-up values are published by the manufacturer without explanation. Each block is a run of writes,
``register=value`` in hex, in the order of the data sheet (docs/reference/hardware.md); ``7F`` selects a bank. The
reads, choices and waits between the blocks are in ``pmw3901.py``. If the published drivers differ, the value is
that of the data sheet, as in Bitcraze and libdriver: ``74=1F``, where Pimoroni and PX4 write 21.
"""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple, TypeAlias

_BURST: Final = Struct("<BBhhBxxxBB")  # motion, observation, dx, dy, SQUAL, raw sum, maximum and minimum, shutter
MOTION_BIT: Final = 0x80
SQUAL_DARK: Final = 0x19  # too little texture at the longest exposure: data sheet 7.2
SHUTTER_UPPER_DARK: Final = 0x1F
FRAME_S: Final = 0.00826  # the time from one picture of the chip to the next (docs/reference/hardware.md)


class Burst(NamedTuple):
    """One motion burst: displacement in counts since the previous read, and properties of the picture.

    ``motion`` is the chip's own flag for motion; ``shutter`` is the exposure, in 0..8191.
    """

    motion: bool
    observation: int
    dx: int
    dy: int
    squal: int
    shutter: int


def decode(data: bytes) -> Burst:
    """Decode the 12 bytes after a burst's address (docs/reference/hardware.md)."""
    motion, observation, dx, dy, squal, upper, lower = _BURST.unpack(data)
    return Burst(bool(motion & MOTION_BIT), observation, dx, dy, squal, (upper & 0x1F) << 8 | lower)


def quality(burst: Burst, squal_full: int) -> float:
    """Return the quality of a burst, from 0 (dark, or no texture) to 1; it does not depend on motion."""
    dark = burst.squal < SQUAL_DARK and burst.shutter >> 8 == SHUTTER_UPPER_DARK
    return 0.0 if dark else min(1.0, burst.squal / squal_full)


def contradiction(burst: Burst, longest_s: float, limit_counts_s: float) -> str | None:
    """Return what is impossible in a burst, or None.

    Its counts are of at most ``longest_s`` plus one frame, because a frame that began earlier may have ended in it.
    """
    limit = int(limit_counts_s * (longest_s + FRAME_S))
    if max(abs(burst.dx), abs(burst.dy)) > limit:
        return f"more than {limit} counts in {longest_s:.3f} s"
    if not burst.motion and (burst.dx or burst.dy):
        return "counts, but no motion seen"
    return None


Writes: TypeAlias = tuple[tuple[int, int], ...]

TRIM_MAX: Final = 0x3F


def _writes(text: str) -> Writes:
    """Return the (register, value) pairs of a text such as ``7F=00 55=01``."""
    pairs = (word.split("=") for word in text.split())
    return tuple((int(register, 16), int(value, 16)) for register, value in pairs)


WAKE: Final = _writes("7F=00 55=01 50=07  7F=0E")
PROBE: Final = _writes("43=10")  # repeated until register 47 says 08
LONG: Final = _writes("48=04")  # where bit 7 of register 67 is set
SHORT: Final = _writes("48=02")
ASK_TRIM: Final = _writes("7F=00 51=7B 50=00 55=00  7F=0E")
ALLOW_TRIM: Final = _writes("7F=00 61=AD 51=70  7F=0E")
TUNE: Final = _writes("""
    7F=00 61=AD
    7F=03 40=00
    7F=05 41=B3 43=F1 45=14 5B=32 5F=34 7B=08
    7F=06 44=1B 40=BF 4E=3F
    7F=08 65=20 6A=18
    7F=09 4F=AF 5F=40 48=80 49=80 57=77 60=78 61=78 62=08 63=50
    7F=0A 45=60
    7F=00 4D=11 55=80 74=1F 75=1F 4A=78 4B=78 44=08 45=50 64=FF 65=1F
    7F=14 65=67 66=08 63=70
    7F=15 48=48
    7F=07 41=0D 43=14 4B=0E 45=0F 44=42 4C=80
    7F=10 5B=02
    7F=07 40=41 70=00
""")
START: Final = _writes("""
    32=44
    7F=07 40=40
    7F=06 62=F0 63=00
    7F=0D 48=C0 6F=D5
    7F=00 5B=A0 4E=A8 5A=50 40=80
""")
LED_ON: Final = _writes("7F=14 6F=1C  7F=00")
LED_OFF: Final = _writes("7F=14 6F=00  7F=00")


def trim(c1: int, c2: int) -> Writes:
    """Return the writes that replace the trims which a chip was made with, registers 70 and 71 of bank 0E.

    ``c1`` grows by 14 up to 28 and by 11 beyond, to no more than 3F; ``c2`` shrinks to 45 %. One rule or the other:
    Pimoroni's library applies both in turn to 15..28.
    """
    return (0x70, min(c1 + (14 if c1 <= 28 else 11), TRIM_MAX)), (0x71, c2 * 45 // 100)
