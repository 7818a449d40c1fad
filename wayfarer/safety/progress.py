"""Finds an escape without progress, which would otherwise continue forever. Pure.

An entrapped rover repeats its manoeuvres for ever, although each of them ends in time. There are three kinds of
progress, and each must come within some driven time:

* **A free run**: it drives ahead for some distance without an anomaly. A rover that works its way out of a pocket has
  one every few seconds. There is none with an anomaly that never clears, with very frequent anomalies, or if something
  holds the body.
* **It leaves its place**, by dead reckoning. A rover may go round in a circle, with a free run in each round: on a
  hillside one climbed to a trunk and slid back for 700 s.
* **It sees ground.** A rover without sight covers ground by its commands alone, so that neither of the others ever
  finds that a trunk holds it, or that it goes round in a loop.
"""

from __future__ import annotations

from typing import Final

from wayfarer.clamp import clamp
from wayfarer.safety.settings import EntrapmentSettings
from wayfarer.safety.tick_interval import ROUNDING_S, Moved, TickInterval

# In a free run a reading counts for at most half of the commanded distance. The largest fifth of the readings, rounded
# up, is ignored, because it may be noise or coasting: wild readings twice a second are a fifth of those of a sensor at
# 10 Hz.
HALF: Final = 0.5
ONE_OF: Final = 5
# Chosen by us: three lengths of the largest shipped rover, and twice ``give_up_s``.
PLACE_M: Final = 1.5
PLACE_S: Final = 120.0
# Once there was no progress, the algorithm gets this much driven time between two rungs of the ladder: five probes.
RUNG_S: Final = 10.0
# Driven ahead without sight for so long, the algorithm has had its chance: as long as ``give_up_s``. Shorter runs
# interrupt an algorithm that gets on: after 9 m (9 to 30 s) the path of a rover whose sensor is dead was 1.9 to 2.5
# times as long as without (physics-light, 40 trials of each shipped rover).
UNSEEN_S: Final = 60.0
# So much seen ahead without a blind spot ends a blind run: at the edge of one, a body that a trunk holds is seen to
# back off and to come back. Chosen by us.
SEEN_M: Final = 1.0


class ProgressMonitor:
    """Judges each tick of an armed rover.

    ``stuck`` is whether there was no free run for too long, or it stayed at one place for too long; ``progressed``
    whether the latest tick completed a free run, and it is not known to stay. ``blind`` is whether it was driven ahead
    without sight for too long.
    """

    def __init__(self, settings: EntrapmentSettings) -> None:
        self._settings = settings
        self._give_up_s, self._free_run_m = settings.give_up_s, settings.free_run_m
        self._anomalies_max = settings.anomalies_max
        self._seen_m: list[float] = []  # in this run
        self.reset()

    def reset(self) -> None:
        """Forget everything: a mission begins at north 0, east 0."""
        self._north_m = self._east_m = self._stayed_s = 0.0
        self._sees_ground = self.progressed = False
        self._begin_tries()
        self.begin_blind_run()

    def try_again(self) -> None:
        """Judge another try at the same place, for a shorter time."""
        self._begin_tries()
        self._tried_s = max(0.0, self._give_up_s - RUNG_S)
        self._stayed_s = min(self._stayed_s, PLACE_S - RUNG_S)

    def begin_blind_run(self) -> None:
        """Begin a blind run here."""
        self._unseen_s = self._seen_ahead_m = 0.0

    @property
    def stuck(self) -> bool:
        """Whether the algorithm has had its chance."""
        tried = self._tried_s >= self._give_up_s or self._anomalies >= self._anomalies_max
        return tried or self._stayed_s >= PLACE_S

    @property
    def blind(self) -> bool:
        """Whether the rover was driven without sight for too long."""
        return self._unseen_s >= UNSEEN_S

    def update(
        self, interval: TickInterval, moved: Moved | None, north_m: float, east_m: float,
        *, anomalous: bool, blind: bool, drives: bool,
    ) -> None:  # fmt: skip
        """Judge one tick.

        Args:
            interval: the wheel commands since the last tick.
            moved: what the motion sensor's new reading shows, None if there is none.
            north_m: where the rover is by dead reckoning.
            east_m: the same to the east.
            anomalous: whether an anomaly is there now.
            blind: whether the motion sensor has seen nothing for a while.
            drives: whether the algorithm drives: what the ladder does is neither a free run nor a try.
        """
        driven_s = interval.driven_s if interval.left or interval.right else 0.0
        self._stayed_s += driven_s
        north_m -= self._north_m
        east_m -= self._east_m
        if north_m * north_m + east_m * east_m > PLACE_M * PLACE_M:
            self._north_m += north_m
            self._east_m += east_m
            self._stayed_s = 0.0
        if blind:
            self._seen_ahead_m = 0.0
            if interval.forward_m > 0.0:
                self._unseen_s += interval.driven_s
        elif moved is not None and moved.known:
            self._seen_ahead_m = max(0.0, self._seen_ahead_m + moved.forward_m)
            if self._seen_ahead_m >= SEEN_M:
                self.begin_blind_run()
        self.progressed = False
        if drives:
            self._tried_s += driven_s
            self._count_run(interval.forward_m, moved, anomalous=anomalous)

    def _begin_tries(self) -> None:
        self._anomalies = 0
        self._tried_s = self._next_anomaly_s = 0.0
        self._begin_run()

    def _begin_run(self) -> None:
        self._run_m = 0.0
        self._seen_m.clear()

    def _count_run(self, forward_m: float, moved: Moved | None, *, anomalous: bool) -> None:
        if moved is not None:
            self._sees_ground = True
            most_m = HALF * moved.commanded_m
            if most_m > 0.0:  # half of it if nothing is known, because unknown is never still
                self._seen_m.append(clamp(moved.forward_m, -most_m, most_m) if moved.known else most_m)
        if anomalous:
            self._begin_run()
            if self._tried_s >= self._next_anomaly_s:
                self._next_anomaly_s = self._tried_s + self._settings.anomaly_every_s - ROUNDING_S
                self._anomalies += 1
        elif forward_m > 0.0:
            self._run_m += forward_m
            if self._run_m < self._free_run_m:
                return
            # It must have moved over the ground in this run, as far as the sensor can see.
            believed_m = sorted(self._seen_m)[: len(self._seen_m) * (ONE_OF - 1) // ONE_OF]
            if not self._sees_ground or sum(believed_m) >= self._settings.covered_m:
                self._begin_tries()
                self.progressed = self._stayed_s < PLACE_S - RUNG_S
