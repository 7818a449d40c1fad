"""What an armed rover does beside its algorithm: the ladder, rests, blind detours. Pure."""

from __future__ import annotations

from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Decision, Observation
from wayfarer.escape.ladder import BLIND_DETOUR, Ladder
from wayfarer.hal import MotionReading
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.entrapment import BlindRunMonitor, EntrapmentMonitor, PlaceMonitor
from wayfarer.safety.mission_limits import Mission
from wayfarer.safety.settings import EntrapmentSettings


class Recovery:
    """Takes the wheels from the algorithm if that makes no progress.

    Call ``judge`` once a tick while the rover is armed, then ``decide``.

    Args:
        settings: when a rover makes no progress, and whether it gives up then.
        quality_min: the lowest quality of a motion reading that is used, 0 to 1.
    """

    def __init__(self, settings: EntrapmentSettings, quality_min: float) -> None:
        self._gives_up = settings.give_up
        self._entrapment = EntrapmentMonitor(settings, quality_min)
        self._place = PlaceMonitor()
        self._blind_run = BlindRunMonitor(quality_min)
        self._ladder = Ladder()

    def reset(self) -> None:
        """Begin a mission."""
        self._entrapment.reset()
        self._place.reset()
        self._blind_run.reset()
        self._ladder.reset()

    def judge(self, tick: TickRecord, motion: MotionReading | None, mission: Mission) -> bool:
        """Judge a tick of a mission, and add what it finds to its conditions.

        Returns whether the algorithm must begin again.

        An algorithm does not see what a rung does, and its counter would miss whole turns.
        """
        ladder, t_s = self._ladder, tick.t_s
        self._place.update(tick, mission.north_m, mission.east_m)
        # A compass shows the tilt as well. Without both senses a detour would push the rover up a trunk until it tips.
        blind = not BLIND.isdisjoint(tick.conditions) and Condition.HEADING_RECKONED not in tick.conditions
        self._blind_run.update(tick, motion, blind=blind)
        # The detector's word for full duty that never turns the body:
        entrapped = Condition.ENTRAPPED in tick.conditions
        if entrapped:
            tick.conditions = tuple(each for each in tick.conditions if each is not Condition.ENTRAPPED)
        climbed = self._climb(tick, motion, entrapped=entrapped) or self._detour(t_s)
        if ladder.begun:
            tick.conditions += (Condition.RESTING if ladder.rests(t_s) else Condition.NO_PROGRESS,)
        return climbed

    def decide(self, t_s: float, observation: Observation) -> Decision | None:
        """Return the decision for this tick, None where the algorithm drives; ``t_s`` is the time without holds."""
        return self._ladder.decide(t_s, observation)

    def _climb(self, tick: TickRecord, motion: MotionReading | None, *, entrapped: bool) -> bool:
        """Climb the ladder where the algorithm makes no progress; give up where a person chose that."""
        ladder, monitor, place, t_s = self._ladder, self._entrapment, self._place, tick.t_s
        if ladder.rung is BLIND_DETOUR and not ladder.begun:
            return False  # it is neither a free run nor a try, and takes no time from the algorithm
        if ladder.rung is not None or ladder.rests(t_s):
            monitor.try_again()
            place.try_again()
        elif monitor.ends(tick, bool(tick.anomalies), motion) or entrapped or place.stays:
            if not self._gives_up:
                ladder.climb(t_s)
                return True
            tick.conditions += (Condition.ENTRAPPED,)
        elif monitor.progressed and place.left and ladder.begun:
            ladder.progress()
        return False

    def _detour(self, t_s: float) -> bool:
        """Begin a detour where the rover was driven without sight for too long; return whether it did."""
        ladder = self._ladder
        if not self._blind_run.long or ladder.rung is not None or ladder.rests(t_s):
            return False
        self._blind_run.reset()
        ladder.begin(BLIND_DETOUR)
        return True
