"""The heading that decisions use: the compass's, or while it cannot be believed, one reckoned from the wheel commands.

A skid-steered body turns by a share of what is commanded; the share depends on ground, tyres and weight. It is learnt
from each turn that the compass shows. Reckoning drifts: with a share that is 15 % off, a turn of 90 degrees is off by
13. So it is the last resort: the rover stands for ``RECKON_AFTER_S`` first, while the compass is opened again.
"""

from __future__ import annotations

from math import degrees
from typing import Final

from wayfarer.escape.api import Vehicle
from wayfarer.hal import CompassReading
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import TickInterval

# A CMPS14 or BNO055 that was opened again answers after 0.65 s (BNO055 data sheet, table 0-2); three tries.
RECKON_AFTER_S: Final = 3.0
# Believed again after this time without a doubt: ten times what one rejected reading lasts.
BELIEVE_AFTER_S: Final = 1.0
# A turn shows the share of the commands that the body obeys if so much was commanded in one direction. A body that
# obeys less than the least share may be held, one that obeys more than the most was turned by something else.
LEARN_FROM_DEG: Final = 15.0
SHARE_LEAST: Final = 0.25
SHARE_MOST: Final = 1.5
LEARN_RATE: Final = 0.3  # of the newest turn: the ground changes, and a compass has some degrees of noise

DOUBTS: Final = frozenset(
    {
        Condition.COMPASS_STALE,
        Condition.COMPASS_LOST,
        Condition.COMPASS_IMPLAUSIBLE,
        Condition.COMPASS_FROZEN,
    }
)
_SILENT: Final = frozenset({Condition.COMPASS_STALE, Condition.COMPASS_LOST})


class HeadingEstimator:
    """Chooses between compass and commands.

    ``reading`` is what decisions use: None before the first plausible reading; ``reckons`` is whether its heading comes
    from the commands. Without a compass its pitch and roll are 0: a tilt is not known then. ``gained_deg`` is the
    heading gained since the start of the run, over any number of turns, clockwise positive.

    Args:
        vehicle: gives the turn rate at full duty.
        may_reckon: False for a rover that is to stand without a compass.
    """

    def __init__(self, vehicle: Vehicle, *, may_reckon: bool) -> None:
        self._deg_s_per_duty = degrees(vehicle.max_speed_m_s / vehicle.track_m)
        self._may_reckon = may_reckon
        self.reading: CompassReading | None = None
        self.reckons = False
        self.gained_deg = 0.0
        self._share = 1.0
        self._turn_deg = self._turned_deg = 0.0  # of this turn: commanded, and shown by the compass
        self._reckoned_deg = 0.0
        self._unseen_deg = 0.0  # commanded since the compass's heading last changed
        self._doubt_since_s: float | None = None
        self._sure_since_s = 0.0

    def update(
        self, interval: TickInterval, compass: CompassReading | None, turned_deg: float, conditions: list[Condition],
        *, armed: bool,
    ) -> None:  # fmt: skip
        """Judge a tick.

        Args:
            interval: the wheel commands before it.
            compass: the newest plausible reading.
            turned_deg: how far the compass says that the body has turned since the last tick.
            conditions: those of the compass; while the heading is reckoned, this takes their place.
            armed: whether a mission is under way. Nobody else needs a heading that is unsure.
        """
        if compass is None:
            return
        t_s, (left, right) = interval.t_s, interval.commanded
        commanded_deg = (left - right) * self._deg_s_per_duty * interval.driven_s
        doubted = bool(conditions) and not DOUBTS.isdisjoint(conditions)
        if doubted or self._doubt_since_s is not None:
            self._choose(t_s, doubted=doubted, armed=armed)
        self._unseen_deg += commanded_deg
        if self.reckons:
            self._reckon(t_s, compass, silent=not _SILENT.isdisjoint(conditions))
            conditions[:] = [each for each in conditions if each not in DOUBTS]
            conditions.append(Condition.HEADING_RECKONED)
            return
        if not doubted:
            self._learn(commanded_deg, turned_deg)
            if turned_deg or not commanded_deg:
                self._unseen_deg = 0.0
        self.reading = compass
        self.gained_deg += turned_deg

    def _choose(self, t_s: float, *, doubted: bool, armed: bool) -> None:
        """Decide whether to reckon, and when a doubt is over: short spells of sense in between do not end it."""
        if doubted:
            self._sure_since_s = t_s
            if self._doubt_since_s is None:
                self._doubt_since_s = t_s
        elif t_s - self._sure_since_s > BELIEVE_AFTER_S:
            self.reckons, self._doubt_since_s = False, None
            self._turn_deg = self._turned_deg = self._unseen_deg = 0.0
            return
        assert self._doubt_since_s is not None
        if not armed or not self._may_reckon:
            self.reckons = False
        elif doubted and not self.reckons and t_s - self._doubt_since_s >= RECKON_AFTER_S:
            self.reckons = True
            self._reckoned_deg = self.reading.heading_deg if self.reading is not None else 0.0

    def _reckon(self, t_s: float, compass: CompassReading, *, silent: bool) -> None:
        """Turn the heading by what was commanded; at first, by all since the compass last showed a turn."""
        turned_deg = self._share * self._unseen_deg
        self._unseen_deg = 0.0
        self._reckoned_deg = (self._reckoned_deg + turned_deg) % 360.0
        self.gained_deg += turned_deg
        pitch_deg, roll_deg = (0.0, 0.0) if silent else (compass.pitch_deg, compass.roll_deg)
        self.reading = CompassReading(t_s, self._reckoned_deg, pitch_deg, roll_deg, None)

    def _learn(self, commanded_deg: float, turned_deg: float) -> None:
        """Add a tick to the present turn; when it is over, learn from it."""
        if commanded_deg * self._turn_deg < 0.0 or (not commanded_deg and self._turn_deg):
            self._end_turn()
        self._turn_deg += commanded_deg
        self._turned_deg += turned_deg

    def _end_turn(self) -> None:
        if abs(self._turn_deg) >= LEARN_FROM_DEG:
            share = self._turned_deg / self._turn_deg
            if SHARE_LEAST <= share <= SHARE_MOST:
                self._share += LEARN_RATE * (share - self._share)
        self._turn_deg = self._turned_deg = 0.0
