"""Judges the self-test of the wheels: each side alone, ahead and back (``escape.ladder`` drives it)."""

from __future__ import annotations

from typing import Final, NamedTuple

from wayfarer.safety.tick_interval import TickInterval

PUSHES_FROM: Final = 0.1  # duty from which a side counts as commanded
# The pulses, in this order: left side ahead, left back, right ahead, right back.
TURNS: Final = (1.0, -1.0, -1.0, 1.0)  # clockwise positive
MOVES: Final = (1.0, -1.0, 1.0, -1.0)
BEFORE: Final = -1  # the first pulse
# Shares of what ideal ground gives. A response below the first is the opposite of what was commanded, if the body
# turned by at least so many degrees: four times the noise of a pulse. One above the last is clear.
OPPOSES: Final = -0.25
OPPOSES_DEG: Final = 5.0
CLEAR: Final = 0.4


class Response(NamedTuple):
    """What a side alone does to the body, as a share of ideal ground's: 0 nothing, negative the opposite."""

    turned: float
    moved: float


class SelfTest:
    """Adds up what each pulse of one self-test did to the body."""

    def __init__(self) -> None:
        self._pulse = BEFORE
        self._duty_s, self._turned_deg, self._moved_m = [0.0] * 4, [0.0] * 4, [0.0] * 4

    def add(self, interval: TickInterval, turned_deg: float, ahead_m: float) -> None:
        """Take in a tick; the pause after a pulse belongs to it, because a compass may lag."""
        left, right = interval.commanded
        duty = left + right
        if abs(duty) >= PUSHES_FROM and (left == 0.0 or right == 0.0):
            self._pulse = (0 if right == 0.0 else 2) + (0 if duty > 0.0 else 1)
        if self._pulse != BEFORE:
            self._duty_s[self._pulse] += abs(duty) * interval.driven_s
            self._turned_deg[self._pulse] += turned_deg
            self._moved_m[self._pulse] += ahead_m

    def responses(self, deg_s_per_duty: float, m_s_per_duty: float) -> tuple[Response, Response]:
        """Return the response of the left and of the right side, of two pulses the better one: one may be blocked.

        Args:
            deg_s_per_duty: turn rate of the body with one side alone at full duty on ideal ground.
            m_s_per_duty: its speed, in the same way.
        """
        turned, moved = [0.0] * 4, [0.0] * 4
        for pulse in range(4):
            if self._duty_s[pulse] > 0.0:
                turned_deg = self._turned_deg[pulse] * TURNS[pulse]
                if abs(turned_deg) >= OPPOSES_DEG or turned_deg > 0.0:
                    turned[pulse] = turned_deg / (self._duty_s[pulse] * deg_s_per_duty)
                moved[pulse] = self._moved_m[pulse] * MOVES[pulse] / (self._duty_s[pulse] * m_s_per_duty)
        return Response(max(turned[:2]), max(moved[:2])), Response(max(turned[2:]), max(moved[2:]))


def any_opposes(left: Response, right: Response) -> bool:
    """Return whether a side does the opposite of what it is told.

    Its turns say so, and its motion where any was seen. If the turns of both sides do, the sides are exchanged, or the
    compass turns the wrong way: then each turn makes the heading worse.
    """
    if left.turned <= OPPOSES and right.turned <= OPPOSES:
        return True
    sees = max(abs(left.moved), abs(right.moved)) >= CLEAR
    return any(side.moved <= OPPOSES or (side.turned <= OPPOSES and not sees) for side in (left, right))


def strength(side: Response) -> float:
    """Return how strong a side is, at most 1: ground that holds every turn still lets it drag the other one along."""
    return min(max(side.turned, side.moved), 1.0)
