"""The motion burst of a PMW3901: what its bytes say, and whether they can be true. Pure."""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple

_BURST: Final = Struct("<BBhhBxxxBB")  # motion, observation, dx, dy, SQUAL, raw sum, maximum and minimum, shutter
MOTION_BIT: Final = 0x80
SQUAL_DARK: Final = 0x19  # too little texture at the longest exposure: data sheet 7.2
SHUTTER_UPPER_DARK: Final = 0x1F
FRAME_S: Final = 0.00826  # how often it looks (hardware.md 2.1)


class Burst(NamedTuple):
    """One motion burst: displacement in counts since the read before, and what the picture was like.

    ``motion`` is the chip's own word that it saw any; ``shutter`` is the exposure, in 0..8191.
    """

    motion: bool
    observation: int
    dx: int
    dy: int
    squal: int
    shutter: int


def decode(data: bytes) -> Burst:
    """Return what the 12 bytes after a burst's address say (hardware.md 2.4)."""
    motion, observation, dx, dy, squal, upper, lower = _BURST.unpack(data)
    return Burst(bool(motion & MOTION_BIT), observation, dx, dy, squal, (upper & 0x1F) << 8 | lower)


def quality(burst: Burst, squal_full: int) -> float:
    """Return how far a burst can be believed, from 0 (dark, or nothing to see) to 1; still or moving alike."""
    dark = burst.squal < SQUAL_DARK and burst.shutter >> 8 == SHUTTER_UPPER_DARK
    return 0.0 if dark else min(1.0, burst.squal / squal_full)


def contradiction(burst: Burst, longest_s: float, limit_counts_s: float) -> str | None:
    """Return what cannot be true of a burst, or None.

    Its counts are of ``longest_s`` at most, and of one frame more: one that began before that may have ended in it.
    """
    limit = int(limit_counts_s * (longest_s + FRAME_S))
    if max(abs(burst.dx), abs(burst.dy)) > limit:
        return f"more than {limit} counts in {longest_s:.3f} s"
    if not burst.motion and (burst.dx or burst.dy):
        return "counts, and no motion seen"
    return None
