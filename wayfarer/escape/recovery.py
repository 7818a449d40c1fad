"""What an armed rover does that makes no progress with its algorithm, instead of giving up: the ladder, rests, detours.

Each *rung* is a short series of wheel commands that the algorithms do not have: the other side, full duty, rocking, a
long way back, a random turn (recovery behaviours: Nav2's default tree, Ardumower Sunray), a shuffle to the side. After
each rung the algorithm has its turn again. After the last one the rover rests, so that motors and board cool, and then
begins again; each rest is longer than the one before. A rover that makes progress begins with the first rung the next
time.

Pure: time comes in as ``t_s``, chance from a separate generator with a fixed seed, so that a log replays.
"""

from __future__ import annotations

from random import Random
from typing import Final, NamedTuple

from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.hal import WheelCommand
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.progress import ProgressMonitor
from wayfarer.safety.settings import EntrapmentSettings
from wayfarer.safety.tick_interval import Moved, TickInterval


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
# shuffles between two rests go to one side, and those after the rest to the other one.
SHUFFLE: Final = Rung(
    "ladder.shuffle",
    (Step(0.3, 0.0, 0.8), Step(0.25, 0.8, 0.0), Step(0.3, 0.0, -0.8), Step(0.25, -0.8, 0.0)) * 6,
    random=True,
)
# No step is longer than 3 s, for which motors may be held (fault catalogue, faults 29 and 58). The duties are shares of
# what the gate allows. The times are chosen by us: at 1 m/s and 180 degrees a second they are some body lengths,
# and turns of a quarter to three quarters.
RUNGS: Final = (
    Rung("ladder.other_side", (Step(0.6, -0.6, 0.0), Step(1.0, 0.0, 0.8), Step(0.8, 0.6, 0.0))),
    Rung("ladder.full_duty", (Step(1.5, -1.0, 0.0), Step(1.5, 0.0, 1.0), Step(1.0, 1.0, 0.0))),
    Rung("ladder.rock", (*(Step(0.5, 1.0, 0.0), Step(0.5, -1.0, 0.0)) * 4, Step(1.0, 0.0, 1.0))),
    Rung("ladder.long_back", (Step(3.0, -1.0, 0.0), Step(1.0, 0.0, 1.0))),
    Rung("ladder.random_turn", (Step(1.0, -0.8, 0.0), Step(2.5, 0.0, 1.0), Step(1.5, 0.8, 0.0)), random=True),
    *(SHUFFLE,) * 3,
)
# A step of a random walk, for a rover that was driven long without sight. It is no step on the ladder: there may be
# nothing in the way. Times and duties as above.
BLIND_DETOUR: Final = Rung(
    "ladder.blind_detour", (Step(1.0, -0.8, 0.0), Step(2.5, 0.0, 1.0), Step(2.5, 0.8, 0.0)), random=True
)
REST_S: Final = 30.0  # the first; each further one is twice as long
REST_MAX_S: Final = 600.0
LEAST_TURN: Final = 0.3  # of a random rung's turn
SEED: Final = 1

_HARMLESS: Final = (Anomaly.IMMOBILISED, Anomaly.TOUCHED)  # to push against something is what a rung is for


class Ladder:
    """Climbs one rung after the other; ``begun`` is whether a rung was climbed since the last progress.

    ``rung`` is the one that is being climbed, None if the algorithm drives.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything: a new mission begins."""
        self._rng = Random(SEED)
        self._last_turn = self._shuffle_side = 1.0
        self._rest_until_s = 0.0
        self.progress()

    def progress(self) -> None:
        """Begin with the first rung and the shortest rest the next time."""
        self.begun = False
        self._next = 0
        self._rest_s = REST_S
        self.rung: Rung | None = None

    def rests(self, t_s: float) -> bool:
        """Return whether the rover rests now."""
        return t_s < self._rest_until_s

    def climb(self, t_s: float) -> None:
        """Begin the next rung; after the last one, rest from now on, and then begin the first."""
        if self._next == len(RUNGS):
            self._rest_now(t_s)
            return
        self.begun = True
        self._next += 1
        self.begin(RUNGS[self._next - 1])

    def begin(self, rung: Rung) -> None:
        """Begin a rung now; it is no step on the ladder."""
        self.rung = rung
        self._step, self._ends_t_s = -1, 0.0
        self._side, self._share = -self._last_turn, 1.0
        if rung.random:
            self._side, self._share = self._rng.choice((-1.0, 1.0)), self._rng.uniform(LEAST_TURN, 1.0)
        if rung is SHUFFLE:
            self._side = self._shuffle_side

    def _rest_now(self, t_s: float) -> None:
        self.begun = True
        self._next = 0
        self._shuffle_side = -self._shuffle_side
        self._rest_until_s = t_s + self._rest_s
        self._rest_s = min(2.0 * self._rest_s, REST_MAX_S)

    def decide(self, t_s: float, observation: Observation) -> Decision | None:
        """Return the decision for this tick, None if no rung is being climbed.

        ``t_s`` is the time without holds. The clock of ``observation`` also stands while a rung is being climbed.
        """
        rung = self.rung
        if rung is None:
            self._note_turn(observation.applied)
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

    def _note_turn(self, applied: WheelCommand | None) -> None:
        """Remember the side of the algorithm's last turn on the spot."""
        if applied is not None and applied.left * applied.right < 0.0:
            self._last_turn = 1.0 if applied.left > applied.right else -1.0


class Recovery:
    """Takes the wheels from the algorithm if that makes no progress.

    Call ``judge`` once a tick while the rover is armed, then ``decide``.

    Args:
        settings: when a rover makes no progress, and whether it gives up then.
    """

    def __init__(self, settings: EntrapmentSettings) -> None:
        self._gives_up = settings.give_up
        self._progress = ProgressMonitor(settings)
        self._ladder = Ladder()
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
        # A compass shows the tilt as well. Without both senses a detour would push the rover up a trunk until it tips.
        blind = not BLIND.isdisjoint(conditions) and Condition.HEADING_RECKONED not in conditions
        drives = ladder.rung is None and not ladder.rests(t_s)
        progress.update(tick, moved, north_m, east_m, anomalous=anomalous, blind=blind, drives=drives)
        # The detector's word for full duty that never turns the body:
        entrapped = Condition.ENTRAPPED in conditions
        if entrapped:
            conditions = tuple(each for each in conditions if each is not Condition.ENTRAPPED)
        self.restarts = False
        if not drives:
            if ladder.rung is not BLIND_DETOUR or ladder.begun:
                progress.try_again()  # but a detour alone takes no time from the algorithm
        elif (progress.stuck or entrapped) and self._gives_up:
            conditions += (Condition.ENTRAPPED,)
        elif progress.stuck or entrapped:
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
            conditions += (Condition.RESTING if ladder.rests(t_s) else Condition.NO_PROGRESS,)
        return conditions

    def decide(self, t_s: float, observation: Observation) -> Decision | None:
        """Return the decision for this tick, None if the algorithm drives; ``t_s`` is the time without holds."""
        return self._ladder.decide(t_s, observation)
