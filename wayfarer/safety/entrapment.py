"""Detects an escape without progress, which would otherwise continue forever. Pure.

An entrapped rover repeats its manoeuvres for ever, although each of them ends in time. A rover that works its way out
of a pocket is different in one thing, the *free run*: it drives ahead for some distance without an anomaly. In a pocket
there is a free run every few seconds. There is none with an anomaly that never clears, with very frequent anomalies, or
if something holds the body.
"""

from __future__ import annotations

from typing import Final

from wayfarer.clamp import clamp
from wayfarer.safety.settings import EntrapmentSettings
from wayfarer.safety.tick_interval import ROUNDING_S, Moved, TickInterval

# A reading counts for at most half of the commanded distance. The largest fifth of the readings, rounded up, is
# ignored, because it may be noise or coasting: wild readings twice a second are a fifth of those of a sensor at 10 Hz.
HALF: Final = 0.5
ONE_OF: Final = 5
# A rover may also go round in a circle, with a free run in each round: on a hillside one climbed to a trunk and slid
# back for 700 s. So it must leave a place as well, by dead reckoning. From no source: three lengths of the largest
# shipped rover, and twice ``give_up_s``.
PLACE_M: Final = 1.5
PLACE_S: Final = 120.0
# Once there was no progress, the algorithm gets this much driven time between two rungs of the ladder: five probes.
RUNG_S: Final = 10.0


class PlaceMonitor:
    """Measures for how long the wheels have been driven at one place; ``stays`` is whether that is too long."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin here: a mission begins at north 0, east 0."""
        self._north_m = self._east_m = self._driven_s = 0.0

    @property
    def stays(self) -> bool:
        """Whether the rover has not left the place for too long."""
        return self._driven_s >= PLACE_S

    @property
    def left(self) -> bool:
        """Whether the rover is not known to stay: a free run counts as progress."""
        return self._driven_s < PLACE_S - RUNG_S

    def update(self, interval: TickInterval, north_m: float, east_m: float) -> None:
        """Take in a tick, and where the rover is by dead reckoning."""
        left, right = interval.commanded
        if left or right:
            self._driven_s += interval.driven_s
        north_m -= self._north_m
        east_m -= self._east_m
        if north_m * north_m + east_m * east_m > PLACE_M * PLACE_M:
            self._north_m += north_m
            self._east_m += east_m
            self._driven_s = 0.0

    def try_again(self) -> None:
        """Judge another try at the same place, for a shorter time."""
        self._driven_s = min(self._driven_s, PLACE_S - RUNG_S)


# Driven ahead without sight for so long, the algorithm has had its chance: as long as ``give_up_s``. Shorter runs
# interrupt an algorithm that gets on: after 9 m (9 to 30 s) the path of a rover whose sensor is dead was 1.9 to 2.5
# times as long as without (physics-light, 40 trials of each shipped rover).
UNSEEN_S: Final = 60.0
# So much seen ahead without a blind spot ends a blind run: at the edge of one, a body that a trunk holds is seen to
# back off and to come back. From no source.
SEEN_M: Final = 1.0


class BlindRunMonitor:
    """Measures for how long the rover was driven ahead without sight; ``long`` is whether that is too long.

    A rover without sight covers ground by its commands alone, so that neither of the other monitors ever finds that a
    trunk holds it, or that it goes round in a loop.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin a blind run here."""
        self._unseen_s = self._seen_m = 0.0

    @property
    def long(self) -> bool:
        """Whether the rover was driven without sight for too long."""
        return self._unseen_s >= UNSEEN_S

    def update(self, interval: TickInterval, moved: Moved | None, *, blind: bool) -> None:
        """Take in a tick.

        Args:
            interval: the wheel commands since the last tick.
            moved: what the motion sensor's new reading shows, None if there is none.
            blind: whether the motion sensor has seen nothing for a while.
        """
        if blind:
            self._seen_m = 0.0
            if interval.forward_m > 0.0:
                self._unseen_s += interval.driven_s
        elif moved is not None and moved.known:
            self._seen_m = max(0.0, self._seen_m + moved.forward_m)
            if self._seen_m >= SEEN_M:
                self.reset()


class EntrapmentMonitor:
    """Judges each tick of an armed rover and says when it makes no progress; ``reset`` starts again.

    ``progressed`` is whether the latest tick completed a free run.
    """

    def __init__(self, settings: EntrapmentSettings) -> None:
        self._settings = settings
        self._run_m = 0.0
        self._seen_m: list[float] = []
        self.reset()

    def reset(self) -> None:
        """Forget everything: a mission begins."""
        self._sees_ground = self.progressed = False
        self._begin_place()

    def try_again(self) -> None:
        """Judge another try at the same place, for a shorter time."""
        self._begin_place()
        self._tried_s = max(0.0, self._settings.give_up_s - RUNG_S)

    def ends(self, interval: TickInterval, anomalous: bool, moved: Moved | None) -> bool:
        """Judge one tick and return whether the rover has made no progress for too long.

        Args:
            interval: the wheel commands since the last tick.
            anomalous: whether an anomaly is there now.
            moved: what the motion sensor's new reading shows, None if there is none.
        """
        settings, forward_m = self._settings, interval.forward_m
        left, right = interval.commanded
        if left or right:
            self._tried_s += interval.driven_s
        self.progressed = False
        if moved is not None:
            self._take_ground(moved)
        if anomalous:
            self._count_anomaly()
        elif forward_m > 0.0:
            self._run_m += forward_m
            if self._run_m >= settings.free_run_m and self._covers_ground():
                self.progressed = True
                self._begin_place()
        return self._tried_s >= settings.give_up_s or self._anomalies >= settings.anomalies_max

    def _begin_place(self) -> None:
        self._anomalies = 0
        self._tried_s = 0.0
        self._next_anomaly_s = 0.0
        self._begin_run()

    def _begin_run(self) -> None:
        self._run_m = 0.0
        self._seen_m.clear()

    def _count_anomaly(self) -> None:
        self._begin_run()
        if self._tried_s < self._next_anomaly_s:
            return
        self._next_anomaly_s = self._tried_s + self._settings.anomaly_every_s - ROUNDING_S
        self._anomalies += 1

    def _take_ground(self, moved: Moved) -> None:
        """Note what was seen. If nothing is known it is half of the commanded distance: unknown is never still."""
        self._sees_ground = True
        most_m = HALF * moved.commanded_m
        if most_m > 0.0:
            self._seen_m.append(clamp(moved.forward_m, -most_m, most_m) if moved.known else most_m)

    def _covers_ground(self) -> bool:
        """Return whether the rover moved over the ground in this run, as far as the sensor can see."""
        believed_m = sorted(self._seen_m)[: len(self._seen_m) * (ONE_OF - 1) // ONE_OF]
        return not self._sees_ground or sum(believed_m) >= self._settings.covered_m
