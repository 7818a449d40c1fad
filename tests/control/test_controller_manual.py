"""A person drives: what turns the wheels then, what stops them, and what becomes of a mission."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.control.bench import BY_HAND, TICK_S, Bench
from wayfarer.control.modes import Mode
from wayfarer.control.tick import BoardReport
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, CompassReading, MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.manual import LEASE_S, ManualSample

ROUNDING_S = 1e-6


class Driver:
    """A person at a bench: presses from the first tick on, once everything was let go."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.seq = bench, 0

    def send(self, forward: float, turn: float = 0.0, *, age_s: float = 0.0) -> str:
        """Send a sample; return why it was refused."""
        self.seq += 1
        now_s = self.bench.t_s
        return self.bench.controller.manual.take(now_s, ManualSample(self.seq, forward, turn, now_s - age_s))

    async def drive(self, forward: float, turn: float = 0.0, ticks: int = 1) -> None:
        for _ in range(ticks):
            assert self.send(forward, turn) == ""
            await self.bench.tick()


async def driven(bench: Bench | None = None, forward: float = 1.0) -> Driver:
    """A rover that a person drives."""
    bench = bench or Bench()
    await bench.tick()
    bench.controller.begin_manual(bench.t_s, 7, "keys")
    driver = Driver(bench)
    await driver.drive(0.0)
    await driver.drive(forward, ticks=2)
    return driver


@pytest.mark.parametrize(
    ("forward", "turn", "wheels"),
    [(1.0, 0.0, (0.8, 0.8)), (-0.5, 0.0, (-0.4, -0.4)), (0.0, 1.0, (0.39, -0.39)), (0.5, -0.5, (0.2, 0.6))],
)
async def test_full_deflection_is_the_speed_and_the_turn_rate_of_the_rover_file(
    forward: float, turn: float, wheels: tuple[float, float]
) -> None:
    driver = await driven()
    await driver.drive(forward, turn, ticks=2)
    assert driver.bench.wheels == pytest.approx(wheels, abs=0.01)


async def test_duty_grows_no_faster_than_the_gate_allows_and_ends_at_once() -> None:
    driver = await driven(Bench(slew_per_s=2.0), forward=0.0)
    await driver.drive(1.0)
    assert driver.bench.wheels == pytest.approx((0.1, 0.1))
    await driver.drive(0.0)
    assert driver.bench.wheels == STOP


async def test_stick_that_is_held_from_the_beginning_drives_only_once_it_was_let_go() -> None:
    bench = Bench()
    await bench.tick()
    bench.controller.begin_manual(bench.t_s, 7, "gamepad")
    driver = Driver(bench)
    await driver.drive(1.0, ticks=5)
    assert (bench.wheels, bench.controller.manual.why) == (STOP, "let go of keys and stick first")
    await driver.drive(0.0)
    await driver.drive(1.0)
    assert bench.wheels != STOP


async def test_hand_that_let_go_and_pressed_again_within_one_tick_drives_from_the_next_sample_on() -> None:
    bench = Bench()
    await bench.tick()
    bench.controller.begin_manual(bench.t_s, 7, "page")
    driver = Driver(bench)
    for forward in (1.0, 0.0, 0.5):  # a finger that touches, and is dragged before the next tick
        assert driver.send(forward) == ""
    await driver.drive(1.0)
    assert bench.wheels == STOP
    await driver.drive(1.0)
    assert bench.wheels != STOP


async def test_hand_that_let_go_and_pressed_again_while_the_gate_held_does_not_drive() -> None:
    driver = await driven()
    driver.send(1.0)
    driver.send(0.0)
    driver.send(1.0)
    await driver.bench.tick(dt_s=0.4)  # late: the gate holds
    await driver.drive(1.0, ticks=5)
    assert driver.bench.wheels == STOP
    await driver.drive(0.0)
    await driver.drive(1.0)
    assert driver.bench.wheels != STOP


async def test_lost_compass_keeps_nobody_from_driving_but_a_rover_on_its_roof_does() -> None:
    driver = await driven()
    for _ in range(200):
        assert driver.send(1.0) == ""
        await driver.bench.tick(compass=False)
    assert Condition.COMPASS_LOST in driver.bench.controller.conditions
    assert (driver.bench.health[0], driver.bench.wheels) == (Level.DEGRADE, WheelCommand(0.8, 0.8))
    for _ in range(60):
        driver.send(1.0)
        bench = driver.bench
        bench.t_s += TICK_S
        bench.inbox.put_compass(CompassReading(bench.t_s, 0.0, 0.0, 175.0, None))
        await bench.loop.tick(bench.t_s)
    assert (bench.controller.mode, bench.wheels) == (Mode.DISARMED, STOP)
    assert bench.controller.why_disarmed == "fault: overturned"
    await bench.tick(200)
    assert bench.health == (Level.FAULT, Condition.OVERTURNED), "it stays until a person arms it, or drives again"


async def test_late_tick_stops_the_wheels_until_the_person_lets_go() -> None:
    driver = await driven()
    driver.send(1.0)
    await driver.bench.tick(dt_s=0.4)
    assert driver.bench.wheels == STOP
    await driver.drive(1.0, ticks=5)
    assert driver.bench.wheels == STOP, "a blocked loop does not start the rover again"
    await driver.drive(0.0)
    await driver.drive(1.0)
    assert driver.bench.wheels != STOP


async def test_motor_board_that_fails_is_waited_for_and_the_person_must_let_go() -> None:
    driver = await driven()
    bench = driver.bench
    bench.motors.error = NotResponding("board: no answer")
    await driver.drive(1.0, ticks=3)
    bench.motors.error = None
    await driver.drive(1.0, ticks=3)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.MOTORS_FAILED))
    assert bench.controller.waits_for_motors
    bench.controller.motors_opened(bench.t_s)
    await driver.drive(1.0, ticks=3)
    assert bench.wheels == STOP
    await driver.drive(0.0)
    await driver.drive(1.0)
    assert bench.wheels != STOP


async def test_who_takes_over_a_mission_that_waits_for_its_board_waits_as_well() -> None:
    """Taking over does not open it, and nobody knows what its wheels would do."""
    bench = await Bench().armed()
    bench.motors.error = NotResponding("board: no answer")
    await bench.tick()
    bench.motors.error = None
    bench.controller.begin_manual(bench.t_s, 7, "keys")
    driver = Driver(bench)
    for _ in range(3):
        await driver.drive(0.0)
        await driver.drive(1.0, ticks=3)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.MOTORS_FAILED))
    bench.controller.motors_opened(bench.t_s)
    await driver.drive(0.0)
    await driver.drive(1.0)
    assert bench.wheels != STOP


async def test_what_a_person_let_happen_is_no_fault_of_the_mission_that_waited() -> None:
    """Here something turns the body against its wheels, and the person sees it."""
    bench = await Bench().armed()
    bench.controller.begin_manual(bench.t_s, 7, "keys")
    driver = Driver(bench)
    await driver.drive(0.0)
    for number in range(60):
        assert driver.send(0.0, 1.0) == ""
        await bench.tick(heading_deg=-2.0 * number % 360.0)
    assert Condition.DRIVE_REVERSED in bench.controller.conditions
    bench.controller.end_manual(bench.t_s, "the test says so")
    await bench.tick(5, heading_deg=242.0)
    assert (bench.controller.mode, bench.health) == (Mode.ARMED, (Level.HOLD, Condition.OPERATOR_HOLD))


async def test_board_fault_and_wheels_that_turn_unasked_stop_a_person_too() -> None:
    driver = await driven()
    await driver.bench.board_says(12.0, "motor A: drive fault", for_s=0.2)
    assert driver.bench.health == (Level.HOLD, Condition.MOTORS_FAILED)
    driver = await driven()
    for _ in range(2):
        report = BoardReport(driver.bench.t_s, MotorHealth(12.0, ()), WheelCommand(0.1, -0.9))
        driver.bench.inbox.put_board(report)
        await driver.drive(1.0)
    assert driver.bench.controller.why_disarmed == "fault: board_disagrees"
    assert driver.bench.motors.halts


@pytest.mark.parametrize("by", ["silence", "hold", "end"])
async def test_mission_waits_with_its_clocks_and_is_held_afterwards(by: str) -> None:
    bench = await Bench(mission_time_s=30.0, mission_distance_m=20.0).armed()
    mission, controller = bench.controller.mission, bench.controller
    await bench.tick(20)
    decided_s = bench.handler.seen[-1].t_s
    driver = await driven(bench)
    assert controller.mode is Mode.MANUAL
    await driver.drive(1.0, ticks=1200)  # a minute, 48 m: beyond both limits of the mission
    if by == "silence":
        await bench.tick(round(LEASE_S / TICK_S) + 2)
    else:
        controller.end_manual(bench.t_s, by)
        await bench.tick()
    assert (controller.mode, bench.wheels, bench.health[1]) == (Mode.ARMED, STOP, Condition.OPERATOR_HOLD)
    assert bench.end is None
    controller.resume(bench.t_s)
    await bench.tick(3)
    assert controller.mission is mission
    assert bench.wheels != STOP
    assert bench.handler.seen[0].t_s == pytest.approx(decided_s, abs=0.2)
    assert bench.log.named("manual_ended")[0]["mode"] == "armed"


@pytest.mark.parametrize("lost", ["before a person drives", "while a person drives"])
async def test_mission_without_a_compass_goes_on_after_a_person_has_driven(lost: str) -> None:
    """The heading that is reckoned from the commands is not forgotten: else the rover would have a fault for ever."""
    bench = await Bench().armed()
    if lost == "before a person drives":
        await bench.tick(200, compass=False)
        assert bench.health == (Level.DEGRADE, Condition.HEADING_RECKONED)
    bench.controller.begin_manual(bench.t_s, 7, "keys")
    driver = Driver(bench)
    for number in range(200):
        assert driver.send(0.5 if number % 40 else 0.0) == ""
        await bench.tick(compass=False)
    bench.controller.end_manual(bench.t_s, "the test says so")
    await bench.tick(40, compass=False)
    assert bench.health == (Level.HOLD, Condition.OPERATOR_HOLD)
    bench.controller.resume(bench.t_s)
    await bench.tick(200, compass=False)
    assert bench.controller.mode is Mode.ARMED
    assert (bench.wheels != STOP, bench.health[1]) == (True, Condition.HEADING_RECKONED)


async def test_disarming_ends_it_with_the_mission() -> None:
    driver = await driven(await Bench().armed())
    driver.bench.controller.disarm(driver.bench.t_s, "asked for")
    await driver.bench.tick()
    assert (driver.bench.controller.mode, driver.bench.wheels) == (Mode.DISARMED, STOP)
    assert driver.bench.controller.mission is None
    bench = driver.bench
    for _ in range(200):
        await bench.tick(compass=False)
    assert bench.health == (Level.FAULT, Condition.COMPASS_LOST), "the levels are those of a mission again"


async def test_client_that_has_gone_leaves_the_rover_as_it_was() -> None:
    driver = await driven()
    await driver.bench.tick(round((LEASE_S + 0.1) / TICK_S))
    assert driver.bench.controller.mode is Mode.DISARMED
    assert driver.bench.log.named("manual_ended") == [
        {"reason": "nothing was heard from keys for 2 s", "mode": "disarmed"}
    ]


@pytest.mark.parametrize("value", [nan, 1.01, -1.01, float("inf")])
async def test_sample_that_is_no_share_is_refused(value: float) -> None:
    driver = await driven()
    assert "must be numbers" in driver.send(value)
    assert "must be numbers" in driver.send(0.0, value)


# -- the deadman over any link ---------------------------------------------------------------------------------------


class Sent(NamedTuple):
    """A sample of the person, taken a period after the one before: what is pressed, and when its copies arrive."""

    pressed: bool
    delays_s: list[float]  # none: it is lost; several: a relay repeats it


LINKS = st.lists(st.builds(Sent, st.booleans(), st.lists(st.floats(0.0, 0.6), max_size=3)), min_size=1, max_size=40)


@given(LINKS, st.lists(st.sampled_from([TICK_S, TICK_S, TICK_S, 0.31]), min_size=1, max_size=60), st.floats(0.02, 0.2))
@settings(max_examples=60, deadline=None)
async def test_wheels_turn_only_on_a_young_sample_however_the_link_loses_delays_repeats_and_reorders(
    link: list[Sent], periods_s: list[float], every_s: float
) -> None:
    """Lost, late, repeated and reordered samples, a client that is killed, a loop that is blocked now and then."""
    bench = Bench()
    await bench.tick()
    controller = bench.controller
    controller.begin_manual(bench.t_s, 7, "page")
    began_s = bench.t_s
    arriving = sorted(
        (began_s + seq * every_s + delay_s, ManualSample(seq, float(sent.pressed), 0.0, began_s + seq * every_s))
        for seq, sent in enumerate(link)
        for delay_s in sent.delays_s
    )
    pressed_s = max((began_s + seq * every_s for seq, sent in enumerate(link) if sent.pressed), default=began_s)
    taken: list[ManualSample] = []
    for period_s in [*periods_s, *[TICK_S] * 40]:
        until_s = bench.t_s + period_s
        while arriving and arriving[0][0] <= until_s:
            at_s, sample = arriving.pop(0)
            if not controller.manual.take(at_s, sample):
                taken.append(sample)
        await bench.tick(dt_s=period_s)
        if bench.wheels != STOP:
            newest = taken[-1]
            assert newest.forward == 1.0
            assert bench.t_s - newest.sent_s <= BY_HAND.deadman_s + ROUNDING_S
            assert bench.t_s <= pressed_s + BY_HAND.deadman_s + ROUNDING_S, "long after the person let go"
    assert [sample.seq for sample in taken] == sorted({sample.seq for sample in taken})
    assert bench.wheels == STOP
    assert controller.mode is Mode.DISARMED or bench.t_s - taken[-1].sent_s <= LEASE_S + TICK_S
