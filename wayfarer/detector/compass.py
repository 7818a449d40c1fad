"""What the compass says: plausible and fresh, or not; and the heading that decisions use.

That is the compass's heading, or while it cannot be believed, one that is reckoned from the wheel commands. A
skid-steered body turns by a share of what is commanded; the share depends on ground, tyres and weight. It is learnt
from each turn that the compass shows. Reckoning drifts: with a share that is 15 % off, a turn of 90 degrees is off by
13. So it is the last resort: the rover stands for ``RECKON_AFTER_S`` first, while the compass is opened again.
"""

from __future__ import annotations

from math import inf
from typing import Final

from wayfarer.angles import wrap180
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import CompassReading
from wayfarer.safety.conditions import HEADING_DOUBTED, SILENT_COMPASS, Condition
from wayfarer.safety.tick_interval import Debounce, TickInterval

# Headings that differ by no more count as equal: two steps of a CMPS14's 0.1 degrees.
DITHER_DEG: Final = 0.2
# No fine compass repeats heading, pitch and roll to the last digit for so long on a body that is seen to drive: its
# wheels shake it. One of whole degrees does on a smooth floor, so a compass must have shown a step within
# ``DITHER_DEG`` first. Chosen by us: a hundred readings, and 5 m at 1 m/s.
REPEATS_S: Final = 5.0
# It does not show the same heading either during so much of commanded turns on a body that is seen to move (fault
# catalogue, fault 4). A body that stands may be held, so then pitch and roll must stay as well. Slower turns do not
# count.
FROZEN_S: Final = 1.0
TURNS_FROM_DEG_S: Final = 20.0
# A heading is rejected if it is further from the last one, and faster than the rover can turn (fault 5: in 50 ms).
JUMP_DEG: Final = 45.0
# The rover stops while so many of the last ten readings were rejected (fault 5).
REJECTED: Final = 5
LATEST: Final = (1 << 10) - 1  # a bit for each
# If every reading was rejected for so long, because of a jump, the newest one is believed, but the rover stops first.
JUMPED_S: Final = 0.5
# A compass that is calibrated less than arming demands is reported after so long. After that, each rejected reading
# makes it implausible for as long (fault 10).
UNCALIBRATED_S: Final = 0.9
# A compass that is silent for so long is lost (fault 2).
LOST_S: Final = 5.0


class CompassMonitor:
    """Takes each reading once and keeps the plausible ones.

    ``reading`` is the newest plausible reading, None before the first; decisions use no other. ``gained_deg`` is the
    heading gained since the first one, over any number of turns, clockwise positive.
    """

    def __init__(self, settings: DetectorSettings, calibration_min: int) -> None:
        self._stale_s = settings.compass_stale_s
        self._rate_max_deg_s = settings.heading_rate_max_deg_s
        self._calibration_min = calibration_min
        self.reading: CompassReading | None = None
        self.gained_deg = 0.0
        self._seen: CompassReading | None = None
        self._read_t_s = -inf
        self.believed_t_s = 0.0
        self._heading_deg = self._pitch_deg = self._roll_deg = -1.0  # of the latest reading, also if it was rejected
        self._values_deg = (-inf, -inf)  # the last two headings that were new
        self._equal_s = self._all_equal_s = 0.0  # turning while the rover moves; turning at all
        self._repeated_s = 0.0  # moving, all values equal
        self._fine = False
        self._frozen = False
        self._low_since_s: float | None = None
        self._rejections = 0  # a bit for each of the last readings, the newest lowest: 1 was rejected
        self._jump_persistence = Debounce(JUMPED_S)
        self._jump_persists = False
        self._doubted_until_s = -inf

    def update(
        self, t_s: float, driven_s: float, reading: CompassReading | None, *, turns: bool, moves: bool
    ) -> list[Condition]:
        """Judge a tick, before which the wheels were driven for ``driven_s``, and commanded to turn if ``turns``.

        ``moves`` says whether the rover is known to move: one that stands may be held, and then its heading stays.
        """
        if turns:
            self._all_equal_s += driven_s
        if moves:
            self._repeated_s += driven_s
            if turns:
                self._equal_s += driven_s
        if reading is not self._seen and reading is not None:
            self._take(t_s, reading)
        stale = t_s - self.believed_t_s > self._stale_s or self.reading is None
        conditions: list[Condition] = []
        if not (stale or self._rejections or self._frozen or self._low_since_s is not None):
            return conditions  # nearly every tick ends here
        many = self._rejections.bit_count() >= REJECTED
        if self._jump_persists or many or t_s < self._doubted_until_s:
            conditions.append(Condition.COMPASS_IMPLAUSIBLE)
            self._jump_persists = False
        if self._frozen:
            conditions.append(Condition.COMPASS_FROZEN)
        if self._uncalibrated(t_s):
            conditions.append(Condition.COMPASS_UNCALIBRATED)
        if stale:
            lost = t_s - self.believed_t_s > LOST_S
            conditions.append(Condition.COMPASS_LOST if lost else Condition.COMPASS_STALE)
        return conditions

    def _take(self, t_s: float, reading: CompassReading) -> None:
        self._seen = reading
        read_t_s, heading_deg, calibration = reading.t_s, reading.heading_deg, reading.calibration
        pitch_deg, roll_deg = reading.pitch_deg, reading.roll_deg
        if not (  # written so that NaN fails it
            self._read_t_s <= read_t_s <= t_s
            and 0.0 <= heading_deg < 360.0
            and abs(pitch_deg) <= 180.0
            and abs(roll_deg) <= 180.0
            and (calibration is None or 0 <= calibration <= 3)
        ):
            self._reject(t_s)  # impossible, however often it is repeated; the heading will soon be stale
            return
        since_s, self._read_t_s = read_t_s - self._read_t_s, read_t_s
        # A heading is new if it is none of the last two values: a part that hangs may toggle between two.
        last_deg, other_deg = self._values_deg
        if not (
            abs(wrap180(heading_deg - last_deg)) <= DITHER_DEG or abs(wrap180(heading_deg - other_deg)) <= DITHER_DEG
        ):
            self._values_deg = (heading_deg, last_deg)
            self._equal_s = self._all_equal_s = self._repeated_s = 0.0
            self._frozen = False
        else:
            if heading_deg != self._heading_deg or pitch_deg != self._pitch_deg or roll_deg != self._roll_deg:
                self._all_equal_s = self._repeated_s = 0.0
                self._fine = self._fine or 0.0 < abs(heading_deg - self._heading_deg) <= DITHER_DEG
            turning_s = max(self._equal_s, self._all_equal_s)
            self._frozen = turning_s >= FROZEN_S or (self._fine and self._repeated_s >= REPEATS_S)
        self._heading_deg, self._pitch_deg, self._roll_deg = heading_deg, pitch_deg, roll_deg
        if calibration is None or calibration >= self._calibration_min:
            self._low_since_s = None
        elif self._low_since_s is None:
            self._low_since_s = read_t_s
        self._weigh(t_s, since_s, reading)

    def _weigh(self, t_s: float, since_s: float, reading: CompassReading) -> None:
        """Accept a reading, unless the rover cannot have turned that far in the time since the previous reading."""
        believed, read_t_s = self.reading, self._read_t_s
        if believed is not None:
            turned_deg = wrap180(self._heading_deg - believed.heading_deg)
            if abs(turned_deg) > JUMP_DEG and abs(turned_deg) > self._rate_max_deg_s * since_s:
                self._reject(t_s)
                # A jump that stays may be true: a person has turned the rover. Accept it, but stop first.
                self._jump_persists = self._jump_persistence.update(read_t_s, True)
                if not self._jump_persists:
                    return
            elif self._rejections:
                self._rejections = self._rejections << 1 & LATEST
            self.gained_deg += turned_deg
        if self._rejections:
            self._jump_persistence.update(read_t_s, False)
        self.reading = reading
        start_t_s = self.believed_t_s
        self.believed_t_s = read_t_s if read_t_s > start_t_s else start_t_s  # no age is longer than the run

    def _reject(self, t_s: float) -> None:
        self._rejections = (self._rejections << 1 | 1) & LATEST
        if self._uncalibrated(t_s):
            self._doubted_until_s = t_s + UNCALIBRATED_S

    def _uncalibrated(self, t_s: float) -> bool:
        return self._low_since_s is not None and t_s - self._low_since_s >= UNCALIBRATED_S


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
        self._full_turn_deg_s = vehicle.full_turn_deg_s
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
        t_s = interval.t_s
        commanded_deg = (interval.left - interval.right) / 2.0 * self._full_turn_deg_s * interval.driven_s
        doubted = bool(conditions) and not HEADING_DOUBTED.isdisjoint(conditions)
        if doubted or self._doubt_since_s is not None:
            self._choose(t_s, doubted=doubted, armed=armed)
        self._unseen_deg += commanded_deg
        if self.reckons:
            # Turn the heading by what was commanded; at first, by all since the compass last showed a turn.
            turned_deg, self._unseen_deg = self._share * self._unseen_deg, 0.0
            self.gained_deg += turned_deg
            self._reckoned_deg = (self._reckoned_deg + turned_deg) % 360.0
            silent = not SILENT_COMPASS.isdisjoint(conditions)
            pitch_deg, roll_deg = (0.0, 0.0) if silent else (compass.pitch_deg, compass.roll_deg)
            self.reading = CompassReading(t_s, self._reckoned_deg, pitch_deg, roll_deg, None)
            conditions[:] = [each for each in conditions if each not in HEADING_DOUBTED]
            conditions.append(Condition.HEADING_RECKONED)
            return
        if not doubted:
            if commanded_deg * self._turn_deg < 0.0 or (not commanded_deg and self._turn_deg):
                self._learn()
            self._turn_deg += commanded_deg
            self._turned_deg += turned_deg
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

    def _learn(self) -> None:
        """Learn from the present turn, which is over."""
        if abs(self._turn_deg) >= LEARN_FROM_DEG:
            share = self._turned_deg / self._turn_deg
            if SHARE_LEAST <= share <= SHARE_MOST:
                self._share += LEARN_RATE * (share - self._share)
        self._turn_deg = self._turned_deg = 0.0
