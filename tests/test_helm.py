"""The control tick: disarmed until told, the goal heading, limits, faults, and the wheels it commands."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from random import Random
from typing import Any

import pytest

from wayfarer.conditions import Condition, Level
from wayfarer.config import RoverConfig
from wayfarer.detector import Detector
from wayfarer.errors import DriverError, NotResponding
from wayfarer.escape.api import Decision, EscapeHandler, Observation, Phase, Vehicle
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, CompassReading, MotorHealth, PositionFix, WheelCommand
from wayfarer.helm import Helm, Mode
from wayfarer.latest import Cells
from wayfarer.records import TickRecord
from wayfarer.safety import SafetySettings

TICK_S = 0.05
AHEAD = WheelCommand(0.5, 0.5)
VEHICLE = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=1.0)


class Motors:
    """Remembers each command; ``error`` is raised instead while it is set."""

    name = "bench motors"

    def __init__(self) -> None:
        self.commands: list[WheelCommand] = []
        self.error: DriverError | None = None

    async def drive(self, command: WheelCommand) -> WheelCommand:
        if self.error is not None:
            raise self.error
        self.commands.append(command)
        return command

    async def open(self) -> None: ...

    async def close(self) -> None: ...

    async def stop(self) -> None: ...

    async def health(self) -> MotorHealth:
        return MotorHealth(None, ())


class Log:
    """Keeps all records."""

    def __init__(self) -> None:
        self.ticks: list[TickRecord] = []
        self.events: list[tuple[str, dict[str, Any]]] = []

    def tick(self, record: TickRecord) -> None:
        self.ticks.append(record)

    def event(self, name: str, t_s: float, **details: object) -> None:
        self.events.append((name, details))

    def position(self, fix: PositionFix | None) -> None: ...

    def close(self, reason: str, text: str) -> None: ...

    def named(self, name: str) -> list[dict[str, Any]]:
        return [details for event, details in self.events if event == name]


class Wanting:
    """A handler that always wants the same wheels."""

    def __init__(self) -> None:
        self.wheels = AHEAD
        self.seen: list[Observation] = []

    def decide(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        return Decision(self.wheels, Phase.FOLLOW, "follow")

    def reset(self) -> None:
        self.seen.clear()

    def memory(self) -> Mapping[str, float | str]:
        return {"counter_deg": 0.0, "episodes": 0}


class Bench:
    """A helm with parts of which the test has the other end; the compass speaks each tick unless told otherwise."""

    def __init__(self, handler: EscapeHandler | None = None, **safety: float) -> None:
        limits = SafetySettings(**{"start_delay_s": 0.0, "settle_s": 0.2, "slew_per_s": 1000.0} | safety)
        self.config = RoverConfig(name="bench", vehicle=VEHICLE, safety=limits)
        self.motors, self.cells, self.log = Motors(), Cells(), Log()
        self.handler = Wanting()
        detector = Detector(self.config.detector, VEHICLE.max_speed_m_s, watches_motion=False)
        self.helm = Helm(self.motors, self.cells, self.config, detector, handler or self.handler, self.log)
        self.t_s = 100.0

    async def tick(
        self, ticks: int = 1, *, heading_deg: float = 0.0, compass: bool = True, dt_s: float = TICK_S
    ) -> None:
        for _ in range(ticks):
            self.t_s += dt_s
            if compass:
                self.cells.compass.write(CompassReading(self.t_s, heading_deg, 0.0, 0.0, None))
            await self.helm.tick(self.t_s)

    async def armed(self, goal_heading_deg: float | None = 0.0) -> Bench:
        """This bench, driving."""
        await self.tick()
        self.helm.arm(self.t_s, goal_heading_deg)
        await self.tick()
        assert self.helm.mode is Mode.ARMED
        assert self.wheels == AHEAD
        return self

    @property
    def wheels(self) -> WheelCommand:
        return self.motors.commands[-1]

    @property
    def health(self) -> tuple[Level, Condition | None]:
        return self.log.ticks[-1].level, self.log.ticks[-1].cause


# -- arming ------------------------------------------------------------------------------------------------------


async def test_starts_disarmed_and_never_moves_before_arm() -> None:
    bench = Bench()
    await bench.tick(200)
    assert bench.helm.mode is Mode.DISARMED
    assert set(bench.motors.commands) == {STOP}
    assert bench.handler.seen == [], "nothing is decided while disarmed"


async def test_start_delay_passes_before_the_wheels_turn() -> None:
    bench = Bench(start_delay_s=5.0)
    await bench.tick()
    bench.helm.arm(bench.t_s, 0.0)
    await bench.tick(99)
    assert bench.helm.mode is Mode.ARMING
    assert set(bench.motors.commands) == {STOP}
    await bench.tick(2)
    assert (bench.helm.mode, bench.wheels) == (Mode.ARMED, AHEAD)


async def test_goal_heading_is_captured_at_the_end_of_the_delay() -> None:
    bench = Bench(start_delay_s=2.0)
    await bench.tick()
    bench.helm.arm(bench.t_s, None)
    await bench.tick(39, heading_deg=40.0)
    await bench.tick(10, heading_deg=75.0)
    assert bench.log.named("armed")[0]["goal_heading_deg"] == pytest.approx(75.0)
    assert bench.handler.seen[-1].goal_heading_deg == pytest.approx(75.0)


async def test_arming_is_refused_when_the_heading_does_not_settle() -> None:
    bench = Bench()
    await bench.tick()
    bench.helm.arm(bench.t_s, None)
    for tick in range(60):
        await bench.tick(heading_deg=tick * 10.0 % 360.0)
    assert bench.helm.mode is Mode.DISARMED
    assert bench.log.named("disarmed") == [{"reason": "not armed: the heading did not settle"}]
    assert set(bench.motors.commands) == {STOP}


async def test_arming_is_refused_without_a_compass_and_says_why() -> None:
    bench = Bench()
    bench.helm.arm(bench.t_s, 0.0)
    await bench.tick(60, compass=False)
    assert bench.log.named("disarmed") == [{"reason": "not armed: compass_stale"}]
    assert set(bench.motors.commands) == {STOP}


async def test_fault_that_lasts_into_arming_refuses_it_or_is_forgotten_never_both_armed_and_latched() -> None:
    """Armed while the compass is still lost; then it comes back within arming's patience."""
    bench = Bench(settle_s=1.0)
    await bench.tick()
    await bench.tick(120, compass=False)
    assert bench.health == (Level.FAULT, Condition.COMPASS_LOST)
    bench.helm.arm(bench.t_s, 0.0)
    await bench.tick(3, compass=False)
    await bench.tick(40)
    assert (bench.helm.mode, bench.wheels) in [(Mode.ARMED, AHEAD), (Mode.DISARMED, STOP)]


async def test_disarm_stops_at_the_next_tick_until_armed_anew() -> None:
    bench = await Bench().armed()
    bench.helm.disarm(bench.t_s, "asked")
    await bench.tick(20)
    assert set(bench.motors.commands[-20:]) == {STOP}
    bench.helm.arm(bench.t_s, 0.0)
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_arming_anew_begins_afresh() -> None:
    """What the handler learnt before a long stop, or was in the middle of, is of another mission."""

    def forest_pledge() -> EscapeHandler:
        return CATALOGUE["forest-pledge"].make(bench_config.escape, VEHICLE, Random(1))

    bench_config = Bench().config
    first, second = Bench(forest_pledge()), Bench(forest_pledge())
    for bench in (first, second):
        await bench.tick()
        bench.helm.arm(bench.t_s, 0.0)
        await bench.tick(heading_deg=2.0)
    second.helm.disarm(second.t_s, "asked")
    await second.tick(1200)
    second.helm.arm(second.t_s, 0.0)
    await second.tick(heading_deg=2.0)
    assert second.wheels == pytest.approx(first.wheels)


# -- limits ------------------------------------------------------------------------------------------------------


async def test_mission_time_ends_the_run_with_its_reason() -> None:
    bench = await Bench(mission_time_s=3.0).armed()
    await bench.tick(59)
    assert bench.helm.end is None
    await bench.tick(2)
    assert bench.helm.end is not None
    assert bench.helm.end.reason == "mission_time"
    assert "3 s" in bench.helm.end.text


async def test_mission_distance_ends_the_run_and_counts_reversing() -> None:
    bench = await Bench(mission_distance_m=1.0).armed()
    await bench.tick(19)
    bench.handler.wheels = WheelCommand(-0.5, -0.5)
    await bench.tick(19)
    assert bench.helm.end is None
    await bench.tick(4)
    assert bench.helm.end is not None
    assert bench.helm.end.reason == "mission_distance"


async def test_limits_count_from_arming_and_not_while_disarmed() -> None:
    bench = Bench(mission_time_s=1.0)
    await bench.tick(100)
    assert bench.helm.end is None
    await bench.armed()
    bench.helm.disarm(bench.t_s, "asked")
    await bench.tick(100)
    assert bench.helm.end is None


async def test_first_reason_to_end_stands() -> None:
    helm = Bench().helm
    helm.finish("escaped", "out")
    helm.finish("tipped", "over")
    assert helm.end is not None
    assert helm.end.reason == "escaped"


# -- the tick ----------------------------------------------------------------------------------------------------


async def test_travelled_distance_is_what_was_commanded_both_ways_and_not_while_pivoting() -> None:
    bench = await Bench().armed()
    travelled_m = bench.handler.seen[-1].travelled_m
    for wheels in (AHEAD, WheelCommand(-0.5, -0.5), WheelCommand(0.5, -0.5)):
        bench.handler.wheels = wheels
        await bench.tick(10)
    await bench.tick()
    assert bench.handler.seen[-1].travelled_m - travelled_m == pytest.approx(2 * 10 * 0.5 * TICK_S + 0.5 * TICK_S)


async def test_each_tick_leaves_one_record_of_what_was_really_applied() -> None:
    bench = await Bench(duty_max=0.5).armed()
    bench.handler.wheels = WheelCommand(0.9, 0.9)
    await bench.tick(5)
    assert len(bench.log.ticks) == 7
    record = bench.log.ticks[-1]
    assert record.decision.wheels == (0.9, 0.9)
    assert record.applied == (0.5, 0.5)
    assert record.observation is bench.handler.seen[-1]
    assert record.memory()["episodes"] == 0


async def test_late_tick_holds_the_wheels_for_one_tick() -> None:
    bench = await Bench(tick_late_s=0.2).armed()
    await bench.tick(dt_s=0.25)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.TICK_LATE))
    await bench.tick()
    assert (bench.wheels, bench.health) == (AHEAD, (Level.WELL, None))


async def test_tick_just_within_the_limit_does_not_hold() -> None:
    bench = await Bench(tick_late_s=0.2).armed()
    await bench.tick(dt_s=0.19)
    assert bench.wheels == AHEAD


async def test_stale_compass_holds_the_wheels_and_they_resume() -> None:
    bench = await Bench().armed()
    await bench.tick(10, compass=False)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.COMPASS_STALE))
    assert bench.helm.mode is Mode.ARMED
    await bench.tick()
    assert bench.wheels == AHEAD
    assert [details["level"] for details in bench.log.named("health")][-2:] == ["hold", "well"]


async def test_lost_compass_is_a_fault_that_disarms() -> None:
    bench = await Bench().armed()
    await bench.tick(120, compass=False)
    assert bench.helm.mode is Mode.DISARMED
    assert bench.log.named("disarmed") == [{"reason": "fault: compass_lost"}]
    await bench.tick(50)
    assert bench.wheels == STOP
    bench.helm.arm(bench.t_s, 0.0)
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_motors_that_do_not_answer_latch_a_fault_and_disarm() -> None:
    bench = await Bench().armed()
    bench.motors.error = NotResponding("bench motors: no answer")
    await bench.tick()
    assert bench.log.ticks[-1].applied == STOP
    assert bench.log.named("motors_failed") == [{"error": "bench motors: no answer"}]
    bench.motors.error = None
    await bench.tick(20)
    assert set(bench.motors.commands[-20:]) == {STOP}
    assert (bench.helm.mode, bench.health) == (Mode.DISARMED, (Level.FAULT, Condition.MOTORS_FAILED))
    bench.helm.arm(bench.t_s, 0.0)
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_motors_that_stay_silent_are_told_once() -> None:
    bench = await Bench().armed()
    bench.motors.error = NotResponding("bench motors: no answer")
    await bench.tick(40)
    assert len(bench.log.named("disarmed")) == 1
    assert len(bench.log.named("health")) <= 2


async def test_decision_that_is_no_number_stops_latches_and_disarms() -> None:
    bench = await Bench().armed()
    bench.handler.wheels = WheelCommand(nan, 0.5)
    await bench.tick()
    assert bench.wheels == STOP
    assert (bench.helm.mode, bench.health) == (Mode.DISARMED, (Level.FAULT, Condition.DECISION_INVALID))


async def test_health_is_logged_when_it_changes_and_not_each_tick() -> None:
    bench = await Bench().armed()
    await bench.tick(50, compass=False)
    assert [details["cause"] for details in bench.log.named("health")] == ["compass_stale"]
