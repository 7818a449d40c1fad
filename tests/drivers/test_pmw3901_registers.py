"""What a PMW3901's burst says, and what cannot be true of one."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from wayfarer.drivers.pmw3901 import PMW3901Settings
from wayfarer.drivers.pmw3901_registers import Burst, contradiction, decode, quality

NORMAL = bytes.fromhex("B0 BF 05 00 FB FF 4C 55 A0 1E 02 58")  # docs/reference/hardware.md
STANDING = bytes.fromhex("30 BF 00 00 00 00 4C 55 A0 1E 02 58")
DARK = bytes.fromhex("B0 BF 10 00 F0 FF 12 20 30 10 1F 40")
LIMIT_COUNTS_S = PMW3901Settings().limit_counts_s


@pytest.mark.parametrize(
    ("data", "burst", "good"),
    [
        (NORMAL, Burst(motion=True, observation=0xBF, dx=5, dy=-5, squal=76, shutter=600), 0.8),
        (STANDING, Burst(motion=False, observation=0xBF, dx=0, dy=0, squal=76, shutter=600), 0.8),
        (DARK, Burst(motion=True, observation=0xBF, dx=16, dy=-16, squal=18, shutter=8000), 0.0),
    ],
)
def test_vectors_of_a_rover_that_moves_stands_and_is_in_the_dark(data: bytes, burst: Burst, good: float) -> None:
    assert decode(data) == burst
    assert quality(burst, 95) == good
    assert contradiction(burst, 0.01, LIMIT_COUNTS_S) is None


def test_dark_needs_both_too_little_texture_and_the_longest_exposure() -> None:
    burst = decode(DARK)
    assert quality(burst._replace(shutter=0x1EFF), 95) == 18 / 95
    assert quality(burst._replace(squal=0x19), 95) == 25 / 95


@given(data=st.binary(min_size=12, max_size=12), squal_full=st.integers(1, 255))
@example(data=b"\xff" * 12, squal_full=1)
def test_quality_is_a_fraction_and_grows_with_texture(data: bytes, squal_full: int) -> None:
    burst = decode(data)
    better = burst._replace(squal=min(255, burst.squal + 1))
    assert 0.0 <= quality(burst, squal_full) <= quality(better, squal_full) <= 1.0


@pytest.mark.parametrize(("longest_s", "limit"), [(0.0, 28), (0.01, 63), (0.05, 202), (0.1, 375)])
def test_more_counts_than_the_chip_can_see_in_the_time_are_garbage(longest_s: float, limit: int) -> None:
    """7.4 rad/s are 173 counts in 0.05 s, and a frame of 8.26 ms has 28."""
    burst = decode(NORMAL)
    for dx, dy in ((limit, -limit), (-limit, 0)):
        assert contradiction(burst._replace(dx=dx, dy=dy), longest_s, LIMIT_COUNTS_S) is None
    for dx, dy in ((limit + 1, 0), (0, -limit - 1)):
        text = contradiction(burst._replace(dx=dx, dy=dy), longest_s, LIMIT_COUNTS_S)
        assert text is not None
        assert str(limit) in text


def test_counts_without_motion_contradict_themselves() -> None:
    assert contradiction(decode(STANDING)._replace(dy=1), 0.05, LIMIT_COUNTS_S) == "counts, but no motion seen"
