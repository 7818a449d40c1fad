"""What an armed rover does that makes no progress with its algorithm, instead of giving up: the ladder, rests, detours.

Each *rung* is a short series of wheel commands that the algorithms do not have: the other side, full duty, rocking, a
long way back, a random turn (recovery behaviours: Nav2's default tree, Ardumower Sunray), a shuffle to the side. After
each rung the algorithm has its turn again. After the last one the rover rests, so that motors and board cool, and then
begins again; each rest is longer than the one before. A rover that makes progress begins with the first rung the next
time.

Pure: time comes in as ``t_s``, chance from a separate generator. Its seed is in the log, so that a replay draws the
same.
"""

from __future__ import annotations

from random import Random
from typing import Final, NamedTuple

from wayfarer.angles import clamp
from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.hal import WheelCommand
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.settings import EntrapmentSettings
from wayfarer.safety.tick_interval import ROUNDING_S, Moved, TickInterval


class Step(NamedTuple):
    """A wheel command for ``for_s`` seconds: duties of driving ahead and of turning, the latter to the rung's side."""

    for_s: float
    ahead: float
    turn: float


class Rung(NamedTuple):
    """A named series of steps; one that is ``random`` draws how much of its turns it does, and its side."""

    name: str
    steps: tuple[Step, ...]
    random: bool = False


# A body that is wedged across between two trunks has some centimetres to drive and some degrees to turn. Ahead on one
# heading and back on another one moves it sideways, as a car is parked: to where the gap is wide enough to turn. Turned
# to its limit it has nothing left to drive, and nobody knows the limit, so the turns are random. The way is long: all
# shuffles between two rests go to one side by the same turn, and those after the rest to the other one by another turn:
# with a new turn for each, one undoes the other.
SHUFFLE: Final = Rung(
    "ladder.shuffle",
    (Step(0.3, 0.0, 0.8), Step(0.25, 0.8, 0.0), Step(0.3, 0.0, -0.8), Step(0.25, -0.8, 0.0)) * 6,
)
# No step is longer than 3 s, for which motors may be held (fault catalogue, faults 29 and 58). The duties are shares of
# what the gate allows. The times are chosen by us: at 1 m/s and 180 degrees per second they are some body lengths,
# and turns of a quarter to three quarters.
RUNGS: Final = (
    Rung("ladder.other_side", (Step(0.6, -0.6, 0.0), Step(1.0, 0.0, 0.8), Step(0.8, 0.6, 0.0))),
    Rung("ladder.full_duty", (Step(1.5, -1.0, 0.0), Step(1.5, 0.0, 1.0), Step(1.0, 1.0, 0.0))),
    Rung("ladder.rock", (*(Step(0.5, 1.0, 0.0), Step(0.5, -1.0, 0.0)) * 4, Step(1.0, 0.0, 1.0))),
    Rung("ladder.long_back", (Step(3.0, -1.0, 0.0), Step(1.0, 0.0, 1.0))),
    Rung("ladder.random_turn", (Step(1.0, -0.8, 0.0), Step(2.5, 0.0, 1.0), Step(1.5, 0.8, 0.0)), random=True),
    *(SHUFFLE,) * 3,
)
# A step of a random walk, for a rover that was driven long without sight. It is not a step on the ladder: there may be
# nothing in the way. Times and duties as above.
BLIND_DETOUR: Final = Rung(
    "ladder.blind_detour", (Step(1.0, -0.8, 0.0), Step(2.5, 0.0, 1.0), Step(2.5, 0.8, 0.0)), random=True
)
REST_S: Final = 30.0  # the first; each further one is twice as long
REST_MAX_S: Final = 600.0
LEAST_TURN: Final = 0.3  # of a random rung's turn

_HARMLESS: Final = (Anomaly.IMMOBILISED, Anomaly.TOUCHED)  # to push against something is what a rung is for


class Ladder:
    """Climbs one rung after the other; ``begun`` is whether a rung was climbed since the last progress.

    ``rung`` is the one that is being climbed, None if the algorithm drives, or if the rover rests, until
    ``rest_until_s``.
    """

    def __init__(self, rng: Random) -> None:
        self._rng = rng
        self.reset()

    def reset(self) -> None:
        """Forget everything: a new mission begins. Its random turns are others than those of the mission before."""
        self._last_turn = self._shuffle_side = 1.0
        self._shuffle_share = self._rng.uniform(LEAST_TURN, 1.0)
        self.rest_until_s = 0.0
        self.progress()

    def progress(self) -> None:
        """Begin with the first rung and the shortest rest the next time."""
        self.begun = False
        self._next = 0
        self._rest_s = REST_S
        self.rung: Rung | None = None

    def climb(self, t_s: float) -> None:
        """Begin the next rung; after the last one, rest from now on, and then begin the first."""
        self.begun = True
        if self._next < len(RUNGS):
            self._next += 1
            self.begin(RUNGS[self._next - 1])
            return
        self._next = 0
        self._shuffle_side, self._shuffle_share = -self._shuffle_side, self._rng.uniform(LEAST_TURN, 1.0)
        self.rest_until_s = t_s + self._rest_s
        self._rest_s = min(2.0 * self._rest_s, REST_MAX_S)

    def begin(self, rung: Rung) -> None:
        """Begin a rung now; it is not a step on the ladder."""
        self.rung = rung
        self._step, self._ends_t_s = -1, 0.0
        self._side, self._share = -self._last_turn, 1.0
        if rung.random:
            self._side, self._share = self._rng.choice((-1.0, 1.0)), self._rng.uniform(LEAST_TURN, 1.0)
        if rung is SHUFFLE:
            self._side, self._share = self._shuffle_side, self._shuffle_share

    def decide(self, t_s: float, observation: Observation) -> Decision | None:
        """Return the decision for this tick, None if no rung is being climbed.

        ``t_s`` is the time without holds. The clock of ``observation`` also stands while a rung is being climbed.
        """
        rung = self.rung
        if rung is None:
            applied = observation.applied
            if applied is not None and applied.left * applied.right < 0.0:  # a turn on the spot, by the algorithm
                self._last_turn = 1.0 if applied.left > applied.right else -1.0
            return None
        while self._step < 0 or t_s >= self._ends_t_s or self._tilts(observation, rung.steps[self._step]):
            self._step += 1
            if self._step == len(rung.steps):
                self.rung = None
                return None
            step = rung.steps[self._step]
            self._ends_t_s = t_s + step.for_s * (self._share if step.turn else 1.0)
            self._known = observation.anomalies
        step = rung.steps[self._step]
        turn = self._side * step.turn
        phase = Phase.TURN_AWAY if step.turn else Phase.BACK_OFF if step.ahead < 0.0 else Phase.STRIDE
        return Decision(WheelCommand(step.ahead + turn, step.ahead - turn), phase, rung.name)

    def _tilts(self, observation: Observation, step: Step) -> bool:
        """Return whether this step tilts the body: it must not be pushed over.

        A body that was tilted before may go on, but not further up what it has climbed.
        """
        further = Anomaly.NOSE_UP if step.ahead > 0.0 else Anomaly.NOSE_DOWN if step.ahead < 0.0 else None
        return any(
            each is further or (each not in _HARMLESS and each not in self._known) for each in observation.anomalies
        )


class Recovery:
    """Takes the wheels from the algorithm if that makes no progress.

    Call ``judge`` once per tick while the rover is armed, then ``decide``.

    Args:
        settings: when a rover makes no progress, and whether it gives up then.
        rng: for the random turns of the ladder, in all missions of a run.
    """

    def __init__(self, settings: EntrapmentSettings, rng: Random) -> None:
        self._gives_up = settings.give_up
        self._progress = ProgressMonitor(settings)
        self._ladder = Ladder(rng)
        self.restarts = False

    def reset(self) -> None:
        """Begin a mission."""
        self._progress.reset()
        self._ladder.reset()

    def judge(
        self,
        tick: TickInterval,
        conditions: tuple[Condition, ...],
        moved: Moved | None,
        north_m: float,
        east_m: float,
        *,
        anomalous: bool,
    ) -> tuple[Condition, ...]:
        """Judge a tick of a mission, and return its conditions with what was found.

        ``restarts`` is then whether the algorithm must begin again: it does not see what a rung does, and its counter
        would miss whole turns.

        Args:
            tick: the wheel commands since the last tick.
            conditions: of the detector.
            moved: what the motion sensor's new reading shows, None if there is none.
            north_m: where the rover is by dead reckoning, from where the mission began.
            east_m: the same to the east.
            anomalous: whether an anomaly is there now.
        """
        ladder, progress, t_s = self._ladder, self._progress, tick.t_s
        blind = entrapped = False
        if conditions:
            # A compass shows the tilt as well. Without both sensors a detour would push the rover up a trunk until it
            # tips.
            blind = not BLIND.isdisjoint(conditions) and Condition.HEADING_RECKONED not in conditions
            entrapped = Condition.ENTRAPPED in conditions  # the detector's word for full duty that never turns the body
        drives = ladder.rung is None and t_s >= ladder.rest_until_s
        progress.update(tick, moved, north_m, east_m, anomalous=anomalous, blind=blind, drives=drives)
        if entrapped:
            conditions = tuple(each for each in conditions if each is not Condition.ENTRAPPED)
        self.restarts = False
        if not drives:
            if ladder.rung is not BLIND_DETOUR or ladder.begun:
                progress.try_again()  # but a detour alone takes no time from the algorithm
        elif (progress.missing or entrapped) and self._gives_up:
            conditions += (Condition.ENTRAPPED,)
        elif progress.missing or entrapped:
            ladder.climb(t_s)
            self.restarts = True
        else:
            if progress.progressed and ladder.begun:
                ladder.progress()
            if progress.blind:
                progress.begin_blind_run()
                ladder.begin(BLIND_DETOUR)
                self.restarts = True
        if ladder.begun:
            conditions += (Condition.RESTING if t_s < ladder.rest_until_s else Condition.NO_PROGRESS,)
        return conditions

    def decide(self, t_s: float, observation: Observation) -> Decision | None:
        """Return the decision for this tick, None if the algorithm drives; ``t_s`` is the time without holds."""
        return self._ladder.decide(t_s, observation)


# -- progress ----------------------------------------------------------------------------------------------------------

# An entrapped rover repeats its manoeuvres for ever, although each of them ends in time. There are three kinds of
# progress, and each must come within some driven time:
#
# * **A free run**: it drives ahead for some distance without an anomaly. A rover that works its way out of a pocket has
#   one every few seconds. There is none with an anomaly that never clears, with very frequent anomalies, or if
#   something holds the body.
# * **It leaves its place**, by dead reckoning. A rover may go round in a circle, with a free run in each round: on a
#   hillside one climbed to a trunk and slid back for 700 s.
# * **It sees ground.** A rover without sight covers ground by its commands alone, so that neither of the others ever
#   finds that a trunk holds it, or that it goes round in a loop.

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

    ``missing`` is whether there was no free run for too long, or it stayed at one place for too long; ``progressed``
    whether the latest tick completed a free run, and it is not known to stay. ``blind`` is whether it was driven ahead
    without sight for too long.
    """

    def __init__(self, settings: EntrapmentSettings) -> None:
        self._give_up_s, self._free_run_m = settings.give_up_s, settings.free_run_m
        self._anomalies_max, self._anomaly_every_s = settings.anomalies_max, settings.anomaly_every_s
        self._covered_m = settings.covered_m
        self._seen_m: list[float] = []  # in this run
        self.reset()

    def reset(self) -> None:
        """Forget everything: a mission begins at north 0, east 0."""
        self._north_m = self._east_m = self._stayed_s = 0.0
        self._sees_ground = self.progressed = self.missing = self.blind = False
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
            drives: whether the algorithm drives: what the ladder does is not a free run and not a try.
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
        tried = self._tried_s >= self._give_up_s or self._anomalies >= self._anomalies_max
        self.missing = tried or self._stayed_s >= PLACE_S
        self.blind = self._unseen_s >= UNSEEN_S

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
                self._next_anomaly_s = self._tried_s + self._anomaly_every_s - ROUNDING_S
                self._anomalies += 1
        elif forward_m > 0.0:
            self._run_m += forward_m
            if self._run_m < self._free_run_m:
                return
            # It must have moved over the ground in this run, as far as the sensor can see.
            believed_m = sorted(self._seen_m)[: len(self._seen_m) * (ONE_OF - 1) // ONE_OF]
            if not self._sees_ground or sum(believed_m) >= self._covered_m:
                self._begin_tries()
                self.progressed = self._stayed_s < PLACE_S - RUNG_S
