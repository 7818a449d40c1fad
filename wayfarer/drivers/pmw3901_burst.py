"""The motion burst of a PMW3901: decodes its bytes, and checks whether they are plausible. Pure."""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple

_BURST: Final = Struct("<BBhhBxxxBB")  # motion, observation, dx, dy, SQUAL, raw sum, maximum and minimum, shutter
MOTION_BIT: Final = 0x80
SQUAL_DARK: Final = 0x19  # too little texture at the longest exposure: data sheet 7.2
SHUTTER_UPPER_DARK: Final = 0x1F
FRAME_S: Final = 0.00826  # the time from one picture of the chip to the next (hardware.md 2.1)


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
    """Decode the 12 bytes after a burst's address (hardware.md 2.4)."""
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
        return "counts, and no motion seen"
    return None
