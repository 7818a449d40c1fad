"""Judges the self-test of the wheels: each side alone, ahead and back (``escape.ladder`` drives it)."""

from __future__ import annotations

from typing import Final, NamedTuple

from wayfarer.safety.tick_interval import ROUNDING_S, TickInterval

PUSHES_FROM: Final = 0.1  # duty from which a side counts as commanded
# The pulses, in this order: left side ahead, left back, right ahead, right back.
TURNS: Final = (1.0, -1.0, -1.0, 1.0)  # clockwise positive
MOVES: Final = (1.0, -1.0, 1.0, -1.0)
FIRST: Final = 0
AHEAD: Final = (0, 2)
BEFORE: Final = -1  # the first pulse
# A response is clear from this share of what ideal ground gives; so is one that is the opposite of what was commanded.
# A turn the other way counts only from so many degrees: the motors' field may bend the heading as far.
CLEAR: Final = 0.4
OPPOSES_DEG: Final = 5.0
BODY_LAG_S: Final = 0.1  # of the body behind its wheels, as ``escape.turn_control.LAG_S``
# The longest lag of a compass that is looked for: 0.5 s (``simhal.world.physics.FIELD``) and a body slower than most.
# It must stay below the time from one pulse to the next, 0.7 s.
COMPASS_LAG_MAX_S: Final = 0.6
SHOWN_S: Final = 0.35  # a pulse and the lag of the body: how long a turn must be watched


class Response(NamedTuple):
    """What a side alone does to the body, as shares of ideal ground's: 0 nothing, negative the opposite.

    ``turned`` and ``moved`` are those of the better one of its two pulses: something may block the body one way.
    ``poorer`` is the strength of the other pulse. ``counts`` is whether the turns of both pulses were seen.
    """

    turned: float
    moved: float
    poorer: float
    counts: bool

    @property
    def strength(self) -> float:
        """How strong the side is: ground that holds every turn still lets it drag the other one along."""
        return min(max(self.turned, self.moved), 1.0)


class SelfTest:
    """Records what each pulse of one self-test does to the body.

    ``lag_ticks`` is how late the compass showed it, once ``responses`` were asked for.

    Args:
        unturned_s: the time since the body was last commanded to turn. A compass that lags may show that turn during
            the first pulse, the turn of which is then not counted.
    """

    def __init__(self, unturned_s: float) -> None:
        self.lag_ticks = 0
        self._unturned_s = unturned_s
        self._pulse = BEFORE
        self._following = 0.0
        self._dt_s = 1.0
        # Of each tick: its pulse, how far an ideal body would turn in any unit, and how far this one turned.
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
            self._unturned_s += interval.dt_s
            return
        driven_s = interval.driven_s
        self._dt_s = interval.dt_s
        self._following += (duty - self._following) * driven_s / (driven_s + BODY_LAG_S)
        self._pulses.append(self._pulse)
        self._expected.append(self._following)
        self._turned_deg.append(turned_deg)
        self._duty_s[self._pulse] += abs(duty) * driven_s
        self._moved_m[self._pulse] += ahead_m

    def responses(self, deg_s_per_duty: float, m_s_per_duty: float) -> tuple[Response, Response]:
        """Return the response of the left and of the right side.

        Args:
            deg_s_per_duty: turn rate of the body with one side alone at full duty on ideal ground.
            m_s_per_duty: its speed, in the same way.
        """
        # A compass that lags shows each turn later, perhaps during the next pulse, where it would be the turn of a side
        # that does the opposite. So the turns are shifted by the lag at which they fit the pulses best, whatever the
        # sign of each: a matched filter.
        lag_ticks = self.lag_ticks = max(range(round(COMPASS_LAG_MAX_S / self._dt_s) + 1), key=self._fit)
        turned, moved = [0.0] * 4, [0.0] * 4
        counts = [self._counts(pulse, lag_ticks) for pulse in range(4)]
        # The motors' field bends the heading for as long as they run, which may look like a turn the other way that is
        # shown late. A turn is still there once they stand: seen in the pulse ahead, because its own late turn may hide
        # that of the pulse back.
        shown_deg, stays_deg = self._shown_deg(lag_ticks), self._shown_deg(0)
        for pulse, duty_s in enumerate(self._duty_s):
            if duty_s > 0.0:
                moved[pulse] = self._moved_m[pulse] * MOVES[pulse] / (duty_s * m_s_per_duty)
                turned_deg = shown_deg[pulse] * TURNS[pulse]
                stays = pulse not in AHEAD or stays_deg[pulse] * TURNS[pulse] <= -OPPOSES_DEG
                opposes = turned_deg <= -OPPOSES_DEG and stays
                if counts[pulse] and (turned_deg >= 0.0 or opposes):
                    turned[pulse] = turned_deg / (duty_s * deg_s_per_duty)
        return _response(turned[:2], moved[:2], counts[:2]), _response(turned[2:], moved[2:], counts[2:])

    def _fit(self, lag_ticks: int) -> float:
        """Return how much of the turns the pulses explain if the compass lags so much, in any unit."""
        products = [0.0] * 4
        shown_deg = self._turned_deg[lag_ticks:]
        for pulse, expected, turned_deg in zip(self._pulses, self._expected, shown_deg, strict=False):
            if pulse != FIRST or self._unturned_s >= COMPASS_LAG_MAX_S:
                products[pulse] += expected * turned_deg
        return sum(product * product for product in products)

    def _counts(self, pulse: int, lag_ticks: int) -> bool:
        """Return whether the turn of a pulse, and no earlier one, was shown with this lag before the test ended."""
        if pulse not in self._pulses or (pulse == FIRST and self._unturned_s < COMPASS_LAG_MAX_S):
            return False
        since = len(self._pulses) - self._pulses.index(pulse) - lag_ticks
        return since * self._dt_s >= SHOWN_S - ROUNDING_S

    def _shown_deg(self, lag_ticks: int) -> list[float]:
        """Return how far a compass with this lag showed the body turn for each pulse."""
        shown_deg = [0.0] * 4
        for pulse, turned_deg in zip(self._pulses, self._turned_deg[lag_ticks:], strict=False):
            shown_deg[pulse] += turned_deg
        return shown_deg


def _response(turned: list[float], moved: list[float], counts: list[bool]) -> Response:
    """Return the response of a side from those to its two pulses, the turns of which may not count."""
    counted = [n for n in range(2) if counts[n]]
    poorer = min((max(turned[n], moved[n]) for n in counted), default=0.0)
    return Response(max((turned[n] for n in counted), default=0.0), max(moved), poorer, all(counts))


def any_opposes(left: Response, right: Response) -> bool:
    """Return whether a side does the opposite of what it is told.

    Its motion says so, and where none was seen its turns in both pulses, which go both ways: a heading that drifts goes
    one way. If the turns of both sides do, the sides are exchanged, or the compass turns the wrong way: then each turn
    makes the heading worse.
    """
    if left.moved <= -CLEAR or right.moved <= -CLEAR:
        return True
    opposed = [side for side in (left, right) if side.turned <= -CLEAR]
    sees = max(left.moved, right.moved) >= CLEAR
    return any(side.counts for side in opposed) and (len(opposed) == 2 or not sees)
