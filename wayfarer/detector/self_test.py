"""Judges the self-test of the wheels: each side alone, ahead and back (``escape.ladder`` drives it)."""

from __future__ import annotations

from typing import Final, NamedTuple

from wayfarer.safety.tick_interval import TickInterval

PUSHES_FROM: Final = 0.1  # duty from which a side counts as commanded
# Responses are shares of what ideal ground gives. In both directions below this, a side does the opposite of what it is
# told: four times the noise of a compass.
OPPOSES: Final = -0.25
# The pulses, in this order: left side ahead, left back, right ahead, right back.
TURNS: Final = (1.0, -1.0, -1.0, 1.0)  # clockwise positive
MOVES: Final = (1.0, -1.0, 1.0, -1.0)
BEFORE: Final = -1  # the first pulse
# The heading may lag: 0.5 s for a tilt-compensated compass under vibration, at 20 ticks a second. With the right number
# of ticks the two pulses of each side agree best. That must be clear: a pulse later, the sides are mixed up.
LAG_TICKS: Final = 10
CLEARER: Final = 1.5
NOISE_DEG2: Final = 30.0  # from noise of 1 degree alone
LEAST_DEG: Final = 5.0  # 3.5 standard deviations of the turn that the same noise shows in a pulse


class PulseSample(NamedTuple):
    """A tick of a self-test: the pulse that it belongs to, what was commanded, and what was observed."""

    pulse: int
    duty_s: float
    turned_deg: float
    moved_m: float


class SelfTest:
    """Takes the ticks of one self-test, and compares what each side alone did to the body."""

    def __init__(self) -> None:
        self._samples: list[PulseSample] = []
        self._pulse = BEFORE

    def add(self, interval: TickInterval, turned_deg: float, ahead_m: float) -> None:
        """Take in a tick; the pause after a pulse belongs to it."""
        left, right = interval.commanded
        duty = left + right
        if abs(duty) >= PUSHES_FROM and (left == 0.0 or right == 0.0):
            self._pulse = (0 if right == 0.0 else 2) + (0 if duty > 0.0 else 1)
        self._samples.append(PulseSample(self._pulse, abs(duty) * interval.driven_s, turned_deg, ahead_m))

    def responses(self, deg_s_per_duty: float, m_s_per_duty: float) -> tuple[float, float]:
        """Return the better response of the left and of the right side; negative if it does the opposite.

        Ground that holds every turn still lets one side drag the other along, so motion ahead counts as well.

        Args:
            deg_s_per_duty: turn rate of the body with one side alone at full duty on ideal ground.
            m_s_per_duty: its speed, in the same way.
        """
        duty_s, moved_m = [0.0] * 4, [0.0] * 4
        for sample in self._samples:
            if sample.pulse != BEFORE:
                duty_s[sample.pulse] += sample.duty_s
                moved_m[sample.pulse] += sample.moved_m
        turned_deg = self._turned_deg(0)
        late_deg = max((self._turned_deg(ticks) for ticks in range(1, LAG_TICKS + 1)), key=_agreement)
        if _agreement(late_deg) > CLEARER * _agreement(turned_deg) + NOISE_DEG2:
            turned_deg = late_deg
        shares = []
        for pulse in range(4):
            if duty_s[pulse] <= 0.0:
                shares.append(0.0)
                continue
            turned = turned_deg[pulse] * TURNS[pulse] / (duty_s[pulse] * deg_s_per_duty)
            moved = moved_m[pulse] * MOVES[pulse] / (duty_s[pulse] * m_s_per_duty)
            if abs(turned_deg[pulse]) < LEAST_DEG:
                turned = max(turned, 0.0)
            shares.append(min(turned, moved) if min(turned, moved) <= OPPOSES else max(turned, moved))
        return max(shares[:2]), max(shares[2:])

    def _turned_deg(self, lag_ticks: int) -> list[float]:
        """Return how far each pulse turned the body, clockwise positive, if the heading lags by so many ticks."""
        turned_deg = [0.0] * 4
        for now, then in zip(self._samples[lag_ticks:], self._samples, strict=False):
            if then.pulse != BEFORE:
                turned_deg[then.pulse] += now.turned_deg
        return turned_deg


def _agreement(turned_deg: list[float]) -> float:
    """Return a measure that is largest where the pulses ahead and back of each side turn the body opposite ways."""
    left_ahead, left_back, right_ahead, right_back = turned_deg
    return (left_ahead - left_back) ** 2 + (right_ahead - right_back) ** 2
