"""Lags: of the body behind its wheels, and of the compass behind the body.

A body follows its wheels as a filter of the first order. What has lasted is forgotten in the same way.

A tilt-compensated or fused compass under vibration shows the heading of up to half a second ago, with a new time. A
loop over such a heading oscillates. So the turns that the compass shows are correlated with the turns that the wheels
were expected to give, at several delays: with the right one the correlation is largest. The heading plus the expected
turn of that delay is the heading of now (a Smith predictor).
"""

from __future__ import annotations

from typing import Final

# A body follows its wheels with about this lag (``simhal.world.physics.Physics``: 0.1 s; ForestRover's mass and motors:
# 0.12 s).
BODY_LAG_S: Final = 0.1

# Delays that are compared, in control ticks; at 20 ticks a second they are 0.1 s apart, up to 0.6 s.
STEP: Final = 2
DELAYS: Final = 7
LONGEST_TICKS: Final = STEP * (DELAYS - 1)
# A delay must be this much better than none, and at least so many steps: a body's own lag differs by some hundredths of
# a second from the expected, and 0.1 s is harmless.
CLEARER: Final = 1.6
LEAST: Final = 2
# Turns so far are forgotten by 63 % after this much excitation: three turns of 30 degrees, each in 15 ticks of 2
# degrees or more. Nothing is concluded before half of it was seen, nor if the body did less than this share of it.
MEMORY_DEG2: Final = 400.0
LEAST_SHARE: Final = 0.2
EXACT_DEG: Final = 1.0 / 64.0


def lagged(value: float, target: float, dt_s: float, lag_s: float) -> float:
    """Return what follows a target with a lag, after ``dt_s``: in small steps it comes nearer by 63 % in ``lag_s``."""
    return value + (target - value) * dt_s / (dt_s + lag_s)


def faded(value: float, dt_s: float, fade_s: float) -> float:
    """Return what is left of a value after ``dt_s``: the same as ``lagged`` towards 0."""
    return value * fade_s / (fade_s + dt_s)


class CompassLag:
    """Predicts the turn that a compass has not shown yet: ``pending_deg``, clockwise positive, 0 without a lag."""

    def __init__(self) -> None:
        self._products = [0.0] * DELAYS  # of shown and expected turns, at each delay
        self._energy = 0.0  # of expected turns
        self._ticks = 0
        self.forget()

    @property
    def ticks(self) -> int:
        """The lag in control ticks, 0 if none is known."""
        return self._ticks

    def forget(self) -> None:
        """Forget the latest turns, as after a hold; the lag is kept, because it is a property of the compass."""
        self._expected_deg = [0.0] * (LONGEST_TICKS + 1)  # of each of the latest ticks, the newest first
        self.pending_deg = 0.0

    def update(self, shown_deg: float, expected_deg: float) -> float:
        """Take in a tick: the turn that the compass shows, and the one that the wheels were expected to give.

        Returns how much ``pending_deg`` has changed.
        """
        expected = self._expected_deg
        expected.pop()
        expected.insert(0, expected_deg)
        self._correlate(shown_deg, expected_deg)
        before_deg, self.pending_deg = self.pending_deg, 0.0
        if self._ticks:
            # In steps of which sums are exact: a mirrored world must give mirrored wheels.
            self.pending_deg = round(self._share() * sum(expected[: self._ticks]) / EXACT_DEG) * EXACT_DEG
        return self.pending_deg - before_deg

    def _correlate(self, shown_deg: float, expected_deg: float) -> None:
        """Add a tick to the sums, and choose the delay; a body that is held shows nothing and changes nothing."""
        energy = expected_deg * expected_deg
        keep = MEMORY_DEG2 / (MEMORY_DEG2 + energy)
        products, expected = self._products, self._expected_deg
        best, most = 0, 0.0
        for n in range(DELAYS):  # in each tick: max() with a key costs 5,000 instructions if this is compiled
            product = products[n] = (products[n] + shown_deg * expected[n * STEP]) * keep
            if n == 0 or product > most:
                best, most = n, product
        self._energy = (self._energy + energy) * keep
        if self._energy < MEMORY_DEG2 / 2.0 or products[best] < LEAST_SHARE * self._energy:
            return
        if best >= LEAST and products[best] > CLEARER * products[0]:
            self._ticks = best * STEP
        elif best < LEAST:
            self._ticks = 0

    def _share(self) -> float:
        """Return the share of the expected turns that the body does, 0 to 1."""
        share = self._products[self._ticks // STEP] / self._energy
        return 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
