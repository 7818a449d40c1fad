"""Judges the self-test of the wheels: each side alone, ahead and back (``escape.ladder`` drives it)."""

from __future__ import annotations

from typing import Final, NamedTuple

from wayfarer.safety.tick_interval import TickInterval

PUSHES_FROM: Final = 0.1  # duty from which a side counts as commanded
# The pulses, in this order: left side ahead, left back, right ahead, right back.
TURNS: Final = (1.0, -1.0, -1.0, 1.0)  # clockwise positive
MOVES: Final = (1.0, -1.0, 1.0, -1.0)
BEFORE: Final = -1  # the first pulse
# Shares of what ideal ground gives. Motion below the first is the opposite of what was commanded. A response is clear
# from the second on, a turn the other way only from so many degrees: the motors' field may bend the heading as far.
OPPOSES: Final = -0.25
CLEAR: Final = 0.4
OPPOSES_DEG: Final = 5.0
BODY_LAG_S: Final = 0.1  # of the body behind its wheels, as ``escape.turn_control.LAG_S``
# The longest lag of a compass that is looked for: 0.5 s (``simhal.world.senses.FIELD``) and a body slower than most. It
# must stay below the time from one pulse to the next, 0.7 s.
COMPASS_LAG_MAX_S: Final = 0.6


class Response(NamedTuple):
    """What a side alone does to the body, as a share of ideal ground's: 0 nothing, negative the opposite."""

    turned: float
    moved: float


class SelfTest:
    """Adds up what each pulse of one self-test did to the body.

    Args:
        turned_before: whether the body was turned just before the test. A compass that lags shows that turn during the
            first pulse, so the turn of the first pulse is not counted.
    """

    def __init__(self, *, turned_before: bool) -> None:
        self._uncounted = 0 if turned_before else BEFORE
        self._pulse = BEFORE
        self._following = 0.0
        self._dt_s = 0.0
        # Of each tick: its pulse, how far that one was expected to turn an ideal body, and how far this body turned.
        self._pulses: list[int] = []
        self._expected: list[float] = []
        self._turned_deg: list[float] = []
        self._duty_s, self._moved_m = [0.0] * 4, [0.0] * 4

    def add(self, interval: TickInterval, turned_deg: float, ahead_m: float) -> None:
        """Take in a tick; the pause after a pulse belongs to it, because the body coasts."""
        left, right = interval.commanded
        duty = left + right
        if abs(duty) >= PUSHES_FROM and (left == 0.0 or right == 0.0):
            pulse = (0 if right == 0.0 else 2) + (0 if duty > 0.0 else 1)
            if pulse != self._pulse:
                self._pulse, self._following = pulse, 0.0
        if self._pulse == BEFORE:
            return
        driven_s = self._dt_s = interval.driven_s
        self._following += (duty - self._following) * driven_s / (driven_s + BODY_LAG_S)
        self._pulses.append(self._pulse)
        self._expected.append(self._following * driven_s)
        self._turned_deg.append(turned_deg)
        self._duty_s[self._pulse] += abs(duty) * driven_s
        self._moved_m[self._pulse] += ahead_m

    def responses(self, deg_s_per_duty: float, m_s_per_duty: float) -> tuple[Response, Response]:
        """Return the response of the left and of the right side, of two pulses the better one: one may be blocked.

        Args:
            deg_s_per_duty: turn rate of the body with one side alone at full duty on ideal ground.
            m_s_per_duty: its speed, in the same way.
        """
        turned, moved = [0.0] * 4, [0.0] * 4
        for pulse, shown_deg in enumerate(self._shown_deg(self._compass_lag_ticks())):
            if self._duty_s[pulse] > 0.0:
                turned_deg = shown_deg * TURNS[pulse]
                if abs(turned_deg) >= OPPOSES_DEG or turned_deg > 0.0:
                    turned[pulse] = turned_deg / (self._duty_s[pulse] * deg_s_per_duty)
                moved[pulse] = self._moved_m[pulse] * MOVES[pulse] / (self._duty_s[pulse] * m_s_per_duty)
        return Response(max(turned[:2]), max(moved[:2])), Response(max(turned[2:]), max(moved[2:]))

    def _shown_deg(self, lag_ticks: int) -> list[float]:
        """Return the turn that a compass with this lag shows for each pulse; the last one may have come too late."""
        shown_deg = [0.0] * 4
        for pulse, turned_deg in zip(self._pulses, self._turned_deg[lag_ticks:], strict=False):
            if pulse != self._uncounted:
                shown_deg[pulse] += turned_deg
        return shown_deg

    def _compass_lag_ticks(self) -> int:
        """Return the lag at which the turns fit the pulses best, whatever the sign of each: a matched filter.

        A compass that lags by as much as a pause shows each turn during the next pulse, where it is the turn of a side
        that does the opposite.
        """
        most = round(COMPASS_LAG_MAX_S / self._dt_s) if self._dt_s else 0
        return max(range(most + 1), key=self._fit)

    def _fit(self, lag_ticks: int) -> float:
        """Return how much of the turns the pulses explain if the compass lags so much, in any unit."""
        products = [0.0] * 4
        shown_deg = self._turned_deg[lag_ticks:]
        for pulse, expected, turned_deg in zip(self._pulses, self._expected, shown_deg, strict=False):
            if pulse != self._uncounted:
                products[pulse] += expected * turned_deg
        return sum(product * product for product in products)


def any_opposes(left: Response, right: Response) -> bool:
    """Return whether a side does the opposite of what it is told.

    Its motion says so, and where none was seen its turns. If the turns of both sides do, the sides are exchanged, or
    the compass turns the wrong way: then each turn makes the heading worse.
    """
    if left.moved <= OPPOSES or right.moved <= OPPOSES:
        return True
    sees = max(left.moved, right.moved) >= CLEAR
    opposed = (left.turned <= -CLEAR) + (right.turned <= -CLEAR)
    return opposed == 2 or (opposed == 1 and not sees)


def strength(side: Response) -> float:
    """Return how strong a side is, at most 1: ground that holds every turn still lets it drag the other one along."""
    return min(max(side.turned, side.moved), 1.0)
