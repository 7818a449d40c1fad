"""Giving up if nothing helps, and never if a rover still works its way out (fault catalogue, fault 57)."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.bench import Bench
from tests.detector.rover import moved
from wayfarer.angles import displacement_m
from wayfarer.control.modes import Mode
from wayfarer.escape.recovery import PLACE_M, PLACE_S, REST_S, RUNGS, SEEN_M, UNSEEN_S, ProgressMonitor
from wayfarer.hal import STOP, CompassReading, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.settings import EntrapmentSettings
from wayfarer.safety.tick_interval import Moved, TickInterval

TICK_S = 0.05
SETTINGS = EntrapmentSettings()
AHEAD = WheelCommand(0.7, 0.7)
TURN = WheelCommand(0.5, -0.5)
BACK = WheelCommand(-0.4, -0.4)
SPEEDS_M_S = {AHEAD: 1.0, TURN: 0.0, BACK: -0.6, STOP: 0.0}


def judge(progress: ProgressMonitor, interval: TickInterval, seen: Moved | None, anomalous: bool) -> bool:
    """Judge a tick of a rover that is at another place in each; return whether it is stuck."""
    north_m = 2.0 * PLACE_M * (interval.t_s // TICK_S)
    progress.update(interval, seen, north_m, 0.0, anomalous=anomalous, blind=False, drives=True)
    return progress.missing


class Drive:
    """A rover that drives; ``grip`` is the share of what is commanded that the ground moves, None without a sensor.

    The sensor speaks each ``ticks_a_reading``. Each ``garbage_every`` ticks it says
    ``garbage_m``, None if that is rejected.
    """

    def __init__(
        self, grip: float | None = 1.0, *, known: bool = True, speed: float = 1.0, ticks_a_reading: int = 1
    ) -> None:
        self.progress = ProgressMonitor(SETTINGS)
        self.grip, self.known, self.speed, self.ticks_a_reading = grip, known, speed, ticks_a_reading
        self.garbage_m: float | None = None
        self.garbage_every = 0
        self.t_s = self.unread_m = 0.0
        self.ticks = 0

    def tick(self, wheels: WheelCommand, *, anomalous: bool = False) -> bool:
        self.t_s += TICK_S
        self.ticks += 1
        forward_m = self.speed * SPEEDS_M_S[wheels] * TICK_S
        self.unread_m += forward_m
        reading = None
        if self.garbage_every and self.ticks % self.garbage_every == 0:
            reading = moved(self.unread_m, self.garbage_m)
        elif self.grip is not None and self.ticks % self.ticks_a_reading == 0:
            reading = moved(self.unread_m, self.unread_m * self.grip if self.known else None)
        if reading is not None:
            self.unread_m = 0.0
        return judge(self.progress, TickInterval(self.t_s, wheels, TICK_S, TICK_S, forward_m), reading, anomalous)

    def go(self, wheels: WheelCommand, for_s: float, *, anomalous: bool = False) -> bool:
        """Drive so until it is over, or for so long; return whether the rover gave up."""
        return any(self.tick(wheels, anomalous=anomalous) for _ in range(round(for_s / TICK_S)))

    def caught(self, rounds: int, push_s: float = 0.4) -> bool:
        """Push into what holds, back off, turn, again and again; return whether the rover gave up."""
        return any(
            self.go(AHEAD, push_s) or self.tick(AHEAD, anomalous=True) or self.go(BACK, 0.3) or self.go(TURN, 1.0)
            for _ in range(rounds)
        )


@pytest.mark.parametrize("every", [1, 2, 3])
def test_storm_of_anomalies_ends_at_the_rate_limit(every: int) -> None:
    drive = Drive()
    gave_up = [drive.tick(AHEAD, anomalous=tick % every == 0) for tick in range(1200)]
    bound_s = SETTINGS.anomalies_max * (SETTINGS.anomaly_every_s + every * TICK_S)
    assert gave_up.index(True) * TICK_S <= bound_s < SETTINGS.give_up_s


@pytest.mark.parametrize("grip", [1.0, 0.0, None])
def test_anomaly_that_never_clears_ends_within_the_bound(grip: float | None) -> None:
    drive = Drive(grip)
    assert drive.go(AHEAD, SETTINGS.anomalies_max * SETTINGS.anomaly_every_s + TICK_S, anomalous=True)


@pytest.mark.parametrize("garbage_m", [0.0, 0.03, 0.1, 1e9, None])
@pytest.mark.parametrize(
    ("speed", "ticks_a_reading", "push_s", "garbage_every"),
    [(1.0, 1, 0.4, 10), (1.0, 2, 0.4, 10), (1.0, 2, 1.0, 10), (0.42, 1, 0.7, 10), (0.3, 2, 0.9, 10), (0.3, 2, 0.9, 8)],
    ids=["fast", "sim", "sim, long pushes", "forestrover", "minirover", "minirover, one in four"],
)
def test_body_that_never_moves_is_given_up_though_its_anomaly_clears_each_time(
    speed: float, ticks_a_reading: int, push_s: float, garbage_every: int, garbage_m: float | None
) -> None:
    """Garbage about twice a second, whenever it began: none (0.0), of any size, or rejected (None)."""
    for ticks in range(garbage_every):
        drive = Drive(grip=0.0, speed=speed, ticks_a_reading=ticks_a_reading)
        drive.ticks, drive.garbage_every = ticks, garbage_every
        drive.garbage_m = garbage_m
        assert drive.caught(100, push_s)
        assert drive.t_s <= SETTINGS.give_up_s + 2.0


def test_body_that_rocks_in_place_is_given_up() -> None:
    drive = Drive(grip=-0.5)
    drive.garbage_m, drive.garbage_every = 0.025, 2
    assert drive.caught(100)


@pytest.mark.parametrize("grip", [0.07, 1.0, None])
def test_pocket_with_some_room_is_never_given_up(grip: float | None) -> None:
    assert not Drive(grip).caught(1000)


@pytest.mark.parametrize("known", [False, True])
def test_ground_that_cannot_be_seen_is_unknown_and_not_still(known: bool) -> None:
    assert Drive(grip=0.0, known=known).caught(1000) is known


def test_turning_for_ever_is_given_up_and_standing_for_ever_is_not() -> None:
    assert not Drive().go(STOP, 10 * SETTINGS.give_up_s, anomalous=True), "what stands does not grind"
    drive = Drive()
    assert drive.go(TURN, 10 * SETTINGS.give_up_s)
    assert drive.t_s == pytest.approx(SETTINGS.give_up_s, abs=2 * TICK_S)


def test_free_run_forgets_the_place() -> None:
    drive = Drive()
    for _ in range(5):
        assert not drive.go(AHEAD, (SETTINGS.anomalies_max - 1) * SETTINGS.anomaly_every_s - TICK_S, anomalous=True)
        assert not drive.go(AHEAD, 0.5)


@given(
    st.lists(st.tuples(st.sampled_from([AHEAD, TURN, BACK, STOP]), st.booleans(), st.floats(-1e3, 1e3)), max_size=300)
)
def test_it_never_gives_up_before_enough_was_tried(ticks: list[tuple[WheelCommand, bool, float]]) -> None:
    progress = ProgressMonitor(replace(SETTINGS, anomalies_max=4, give_up_s=5.0))
    tried_s = 0.0
    for wheels, anomalous, seen_m in ticks:
        tried_s += TICK_S * (wheels != STOP)
        interval = TickInterval(tried_s, wheels, TICK_S, TICK_S, SPEEDS_M_S[wheels] * TICK_S)
        if judge(progress, interval, moved(interval.forward_m, seen_m), anomalous):
            assert tried_s >= 3 * SETTINGS.anomaly_every_s - 1e-6


async def nose_up(bench: Bench, seconds: float) -> None:
    """Stand with the nose up, held fast; the roll has noise, as that of a compass that is not frozen."""
    for n in range(round(seconds / TICK_S)):
        bench.t_s += TICK_S
        bench.inbox.put_compass(CompassReading(bench.t_s, 0.0, 30.0, 0.1 * (n % 2), None))
        await bench.loop.tick(bench.t_s)


async def nose_up_until_it_gives_up() -> Bench:
    bench = await Bench(give_up=True).armed()
    await nose_up(bench, SETTINGS.give_up_s)
    return bench


async def test_controller_of_an_entrapped_rover_that_is_to_give_up_latches_a_fault_and_says_so() -> None:
    bench = await nose_up_until_it_gives_up()
    assert (bench.controller.mode, bench.wheels) == (Mode.DISARMED, STOP)
    assert bench.health == (Level.FAULT, Condition.ENTRAPPED)
    assert bench.log.named("disarmed") == [{"reason": "fault: entrapped"}]


async def test_arming_again_forgets_the_place() -> None:
    bench = await nose_up_until_it_gives_up()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(100)
    assert bench.controller.mode is Mode.ARMED


async def test_rover_without_progress_climbs_the_ladder_rests_warns_and_climbs_it_again() -> None:
    bench = await Bench().armed()
    await nose_up(bench, 170.0)
    whys = [tick.decision.why for tick in bench.log.ticks if tick.decision.why.startswith("ladder.")]
    assert list(dict.fromkeys(whys)) == list(dict.fromkeys(rung.name for rung in RUNGS))
    found = [each["cause"] for each in bench.log.named("health")]
    causes = [cause for cause, _ in groupby(each for each in found if each != "cannot_turn")]
    assert causes[:4] == ["no_progress", "resting", "resume_warning", "no_progress"]
    rested = [tick for tick in bench.log.ticks if Condition.RESTING in tick.conditions]
    first_rest = [tick for tick in rested if tick.t_s < rested[0].t_s + 1.5 * REST_S]
    assert first_rest[-1].t_s - rested[0].t_s == pytest.approx(REST_S, abs=2 * TICK_S)
    assert {tick.applied for tick in rested} == {STOP}
    assert bench.controller.mode is Mode.ARMED
    assert any(tick.applied != STOP for tick in bench.log.ticks[-20:])


async def test_algorithm_begins_again_after_a_rung_that_it_did_not_see() -> None:
    """A rung may turn the body by more than half a turn between two of its decisions: its counter would be wrong."""
    bench = await Bench().armed()
    before = bench.handler.seen[-1]
    await nose_up(bench, 13.0)
    first = next(tick.t_s for tick in bench.log.ticks if tick.decision.why == RUNGS[0].name)
    await nose_up(bench, 6.0)
    assert first < bench.t_s - 6.0
    assert bench.handler.seen[0].t_s > before.t_s, "its clock stands while it does not drive"


async def test_free_run_ends_the_ladder() -> None:
    bench = await Bench().armed()
    await nose_up(bench, SETTINGS.give_up_s + 12.0)
    assert Condition.NO_PROGRESS in bench.controller.conditions
    await bench.tick(200)
    assert Condition.NO_PROGRESS not in bench.controller.conditions


async def test_hold_stops_the_wheels_on_the_ladder_too() -> None:
    bench = await Bench().armed()
    while bench.log.ticks[-1].decision.why != RUNGS[0].name:
        await nose_up(bench, TICK_S)
    bench.controller.hold(bench.t_s)
    await nose_up(bench, 0.05)
    assert bench.wheels == STOP
    bench.controller.disarm(bench.t_s, "enough")
    bench.controller.resume(bench.t_s)
    await nose_up(bench, 5.0)
    assert bench.wheels == STOP


# -- one place --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("away_m", "stuck"), [(0.9 * PLACE_M, True), (1.1 * PLACE_M, False)])
@pytest.mark.parametrize("towards_deg", [0.0, 45.0, 90.0, 200.0])
def test_rover_that_goes_round_with_free_runs_must_leave_its_place(
    away_m: float, stuck: bool, towards_deg: float
) -> None:
    progress, found = ProgressMonitor(SETTINGS), False
    for tick in range(round(1.1 * PLACE_S / TICK_S)):
        north_m, east_m = displacement_m(towards_deg, away_m * (tick // 200 % 2))
        each = TickInterval(tick * TICK_S, AHEAD, TICK_S, TICK_S, 0.05)
        progress.update(each, moved(0.05, 0.05), north_m, east_m, anomalous=False, blind=False, drives=True)
        found |= progress.missing
    assert found is stuck


def test_what_the_ladder_does_is_neither_a_free_run_nor_a_try_but_it_may_leave_the_place() -> None:
    progress = ProgressMonitor(SETTINGS)
    for tick in range(round(2.0 * PLACE_S / TICK_S)):
        each = TickInterval(tick * TICK_S, AHEAD, TICK_S, TICK_S, 0.05)
        north_m = 0.05 * tick
        progress.update(each, moved(0.05, 0.05), north_m, 0.0, anomalous=True, blind=False, drives=False)
        assert (progress.missing, progress.progressed) == (False, False)


# -- without sight ----------------------------------------------------------------------------------------------------

STEP_M = 0.05


def interval(forward_m: float) -> TickInterval:
    """A tick in which the rover was driven this far."""
    return TickInterval(0.0, AHEAD if forward_m > 0.0 else BACK, TICK_S, TICK_S, forward_m)


def look(progress: ProgressMonitor, interval: TickInterval, seen: Moved | None, *, blind: bool) -> None:
    """Judge a tick of a rover that stays where it is."""
    progress.update(interval, seen, 0.0, 0.0, anomalous=False, blind=blind, drives=True)


def blind_run(for_s: float, forward_m: float = STEP_M) -> ProgressMonitor:
    progress = ProgressMonitor(SETTINGS)
    for _ in range(round(for_s / TICK_S)):
        look(progress, interval(forward_m), None, blind=True)
    return progress


def test_run_without_sight_is_long_after_its_time() -> None:
    assert not blind_run(UNSEEN_S - 1.0).blind
    assert blind_run(UNSEEN_S + 1.0).blind


def test_reversing_without_sight_is_no_run() -> None:
    assert not blind_run(2.0 * UNSEEN_S, -STEP_M).blind


def test_metre_that_is_seen_ends_a_run_without_sight() -> None:
    progress = blind_run(UNSEEN_S + 1.0)
    for _ in range(round(SEEN_M / STEP_M) + 1):
        look(progress, interval(STEP_M), moved(STEP_M, STEP_M), blind=False)
    assert not progress.blind


@pytest.mark.parametrize("back_is_seen", [False, True])
def test_backing_off_and_coming_back_in_sight_does_not_end_a_run_without_sight(back_is_seen: bool) -> None:
    progress = blind_run(UNSEEN_S + 1.0)
    for _ in range(100):
        for step_m in (-STEP_M, -STEP_M, -STEP_M, STEP_M, STEP_M, STEP_M):
            blind = step_m < 0.0 and not back_is_seen
            look(progress, interval(step_m), moved(step_m, step_m), blind=blind)
    assert progress.blind
