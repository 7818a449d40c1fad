"""What an armed rover does beside its algorithm: self-tests of its wheels, the ladder, rests, blind detours. Pure."""

from __future__ import annotations

from wayfarer.control.tick_record import TickRecord
from wayfarer.detector.sides import SideMonitor
from wayfarer.escape.api import Decision, Observation
from wayfarer.escape.ladder import BLIND_DETOUR, SELF_TEST, THOROUGH_SELF_TEST, Ladder, Rung
from wayfarer.hal import MotionReading
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.entrapment import BlindRunMonitor, EntrapmentMonitor, PlaceMonitor
from wayfarer.safety.mission_limits import Mission
from wayfarer.safety.settings import EntrapmentSettings


class Recovery:
    """Takes the wheels from the algorithm where that makes no progress, or where a side seems not to drive.

    Call ``judge`` once a tick while the rover is armed, then ``decide``.

    Args:
        settings: when a rover makes no progress, and whether it gives up then.
        quality_min: the lowest quality of a motion reading that is used, 0 to 1.
        sides: judges the self-tests.
    """

    def __init__(self, settings: EntrapmentSettings, quality_min: float, sides: SideMonitor) -> None:
        self._gives_up = settings.give_up
        self._entrapment = EntrapmentMonitor(settings, quality_min)
        self._place = PlaceMonitor()
        self._blind_run = BlindRunMonitor(quality_min)
        self._ladder = Ladder()
        self._sides = sides
        self._test: Rung | None = None  # the self-test under way

    def reset(self) -> None:
        """Begin a mission."""
        self._entrapment.reset()
        self._place.reset()
        self._blind_run.reset()
        self._ladder.reset()
        self._test = None

    def judge(self, tick: TickRecord, motion: MotionReading | None, mission: Mission) -> bool:
        """Judge a tick of a mission, and add what it finds to its conditions.

        Returns whether the algorithm must begin again.

        An algorithm does not see what a rung does, and its counter would miss whole turns. A self-test turns the body
        to and fro by less than that.
        """
        ladder, t_s = self._ladder, tick.t_s
        self._test_sides(t_s)
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
        if (self._test is not None or ladder.rung is BLIND_DETOUR) and not ladder.begun:
            return False  # neither is a free run nor a try, and both take no time from the algorithm
        if ladder.rung is not None or ladder.rests(t_s):
            monitor.try_again()
            place.try_again()
        elif monitor.ends(tick, bool(tick.anomalies), motion) or entrapped or place.stays:
            if not self._gives_up:
                if ladder.climb(t_s) is SELF_TEST:
                    self._begin_test(SELF_TEST)
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

    def _test_sides(self, t_s: float) -> None:
        """Begin a self-test that is due, and judge one that is over; after one that shows nothing, a thorough one."""
        if self._ladder.rung is not None:
            return
        if self._test is not None:
            decided, again = self._sides.end_test(t_s), self._test is SELF_TEST
            self._test = None
            if not decided and again:
                self._begin_test(THOROUGH_SELF_TEST)
        elif self._sides.wants_test(t_s) and not self._ladder.rests(t_s):
            self._begin_test(SELF_TEST)

    def _begin_test(self, test: Rung) -> None:
        self._test = test
        self._sides.begin_test()
        if self._ladder.rung is not test:
            self._ladder.begin(test)
