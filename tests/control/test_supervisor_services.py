"""What runs beside the control tick: board, part counters, light and freshness; and a suspended process."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from tests.kit.workshop import (
    AHEAD,
    Contact,
    Handler,
    Light,
    Motors,
    Position,
    Script,
    Workshop,
    assert_wheels_stopped_first,
    breaking,
    drive,
    mending,
    supervisor,
)
from wayfarer.control.modes import Mode
from wayfarer.control.status_light import GREEN, OFF, RED, YELLOW
from wayfarer.control.supervisor import Supervisor
from wayfarer.errors import NotResponding
from wayfarer.escape.api import Decision, Observation
from wayfarer.hal import STOP, Colour, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

# -- the motor board ---------------------------------------------------------------------------------------------


def test_board_fault_stops_the_wheels_within_half_a_second(shop: Workshop) -> None:
    drive(shop, {1.01: lambda _: setattr(shop, "faults", ("motor A: drive fault",))}, for_s=3.0)
    assert {"level": "hold", "cause": "motors_failed"} in shop.named("health")
    assert 1.01 < max(shop.times("handler.decide")) <= 1.51


def halts_between(shop: Workshop, from_s: float, to_s: float) -> int:
    return sum(from_s <= t_s < to_s for t_s in shop.times("motors.halt"))


@pytest.mark.parametrize("at_s", [1.01, 1.06, 1.11, 1.16, 1.21, 1.249, 1.251])
def test_board_that_turns_the_wheels_by_itself_is_a_fault_within_half_a_second(shop: Workshop, at_s: float) -> None:
    """It answers what it was told, until a hold that it does not take."""
    seen: list[object] = []
    script: Script = {
        0.4: lambda it: setattr(shop, "answer", AHEAD),
        at_s: lambda it: it.controller.hold(at_s),
        at_s + 0.5: lambda it: seen.append((it.mode, it.controller.why_disarmed)),
    }
    drive(shop, script, for_s=3.0)
    assert seen == [(Mode.DISARMED, "fault: board_disagrees")]
    assert halts_between(shop, 2.0, 3.0) == pytest.approx(20, abs=1), "the stop is repeated at each tick"


def test_board_that_turns_the_wheels_of_a_disarmed_rover_is_stopped_again_and_again(shop: Workshop) -> None:
    seen: list[object] = []
    script: Script = {
        1.01: lambda it: it.disarm("asked"),
        2.01: lambda it: setattr(shop, "answer", WheelCommand(0.2, 0.0)),
        2.51: lambda it: seen.append(it.controller.conditions),
        4.01: lambda it: setattr(shop, "answer", STOP),
        5.01: lambda it: seen.append(it.controller.conditions),
    }
    drive(shop, script, for_s=6.0)
    assert seen == [(Condition.BOARD_DISAGREES,), ()]
    assert halts_between(shop, 2.51, 4.01) == pytest.approx(30, abs=1)
    assert halts_between(shop, 4.6, 5.9) == 0


def test_stop_that_comes_between_a_command_and_the_board_is_no_fault(shop: Workshop) -> None:
    """A halt reaches the board before the next tick does: for a moment it says less than was applied."""
    seen: list[object] = []

    def halt(it: Supervisor) -> None:
        shop.answer = STOP
        it.controller.hold(1.249)

    drive(
        shop,
        {0.4: lambda it: setattr(shop, "answer", AHEAD), 1.249: halt, 3.0: lambda it: seen.append(it.mode)},
        for_s=4.0,
    )
    assert seen == [Mode.ARMED]


# -- what parts get over by themselves ---------------------------------------------------------------------------


class CountingContact(Contact):
    """A bumper that counts."""

    def __init__(self, shop: Workshop, name: str) -> None:
        super().__init__(shop, name)
        self.error_counts = {"reads retried": 0, "garbage": 0}


def test_error_counts_of_a_part_are_noted_when_they_grow_at_most_once_a_second(shop: Workshop) -> None:
    contact = CountingContact(shop, "contact")

    def fail_often(it: Supervisor) -> None:
        contact.error_counts["reads retried"] += 1
        if it.controller.end is None:
            asyncio.get_running_loop().call_later(0.01, fail_often, it)

    drive(shop, {0.2: fail_often}, for_s=3.5, contact=contact, source="contact")
    noted = shop.named("part_troubles")
    assert [each["part"] for each in noted] == ["contact"] * 3
    assert [each["counts"] for each in noted] == [
        {"reads retried": pytest.approx(count, abs=3)} for count in (80, 180, 280)
    ]


@pytest.mark.parametrize(
    ("call", "event", "causes"),
    [("motors.health", "board_silent", ["board_silent", None, "board_silent"]), ("light.show", "light_failed", [])],
)
def test_board_or_light_that_fails_is_told_once_and_the_rover_drives_on(
    shop: Workshop, call: str, event: str, causes: list[str | None]
) -> None:
    fails = breaking(shop, call, NotResponding("no answer"))
    script: Script = {1.1: fails, 4.1: mending(shop), 6.1: fails}
    assert drive(shop, script, for_s=8.0, light=Light(shop, "light")).reason == "requested"
    assert shop.named(event) == [{"error": "no answer"}] * 2, "once for each time"
    assert [details["cause"] for details in shop.named("health")] == causes
    assert len(shop.times("handler.decide")) == pytest.approx(8.0 * 20, abs=5)
    assert shown(shop, 4.3, 6.0) == {GREEN}, "it is tried again"


def test_board_that_hangs_stops_neither_the_ticks_nor_the_end(shop: Workshop) -> None:
    shop.silent.add("motors.health")
    assert drive(shop, for_s=2.0).reason == "requested"
    assert len(shop.times("handler.decide")) == pytest.approx(40, abs=5)
    assert_wheels_stopped_first(shop)


# -- the status light --------------------------------------------------------------------------------------------


def shown(shop: Workshop, from_s: float, to_s: float) -> set[Colour]:
    return {colour for t_s, colour in shop.colours if from_s <= t_s < to_s}


def test_light_shows_arming_driving_and_fault(shop: Workshop) -> None:
    broken = breaking(shop, "motors.drive", NotResponding("gone"))
    drive(
        shop,
        {0.01: lambda it: None, 4.01: broken},
        for_s=6.0,
        light=Light(shop, "light"),
        safety={"start_delay_s": 2.0, "on_lost_sense": "hold"},
    )
    assert shown(shop, 0.1, 1.9) == {YELLOW, OFF}
    assert shown(shop, 2.2, 4.0) == {GREEN}
    assert shown(shop, 4.3, 6.0) == {RED, OFF}


def test_light_that_hangs_stops_nothing(shop: Workshop) -> None:
    script = {1.1: lambda _: shop.silent.add("light.show")}
    assert drive(shop, script, for_s=2.0, light=Light(shop, "light")).reason == "requested"
    assert shop.times("handler.decide")[-1] > 1.9
    assert "light.close" in shop.done
    assert_wheels_stopped_first(shop)


# -- freshness, for the watchdog ---------------------------------------------------------------------------------


def freshness(shop: Workshop, script: Script, at_s: tuple[float, ...], **rover: Any) -> list[bool]:
    """Return what ``is_fresh`` says at some times of a run."""
    fresh: list[bool] = []
    asking = {t_s: lambda it: fresh.append(it.is_fresh()) for t_s in at_s}
    drive(shop, {**asking, **script}, for_s=max(at_s) + 0.1, **rover)
    return fresh


def test_run_is_not_fresh_before_its_first_tick_and_fresh_while_it_drives(shop: Workshop) -> None:
    assert not supervisor(shop).is_fresh()
    assert freshness(shop, {}, (0.3, 1.0, 9.0)) == [True, True, True]


def test_run_is_not_fresh_while_a_tick_hangs(shop: Workshop) -> None:
    script = {1.01: lambda _: shop.silent.add("motors.drive")}
    fresh: list[bool] = []
    ask = {t_s: lambda it: fresh.append(it.is_fresh()) for t_s in (1.5, 2.2)}
    cancel = {3.0: lambda _: shop.run is not None and shop.run.cancel()}
    with pytest.raises(asyncio.CancelledError):
        drive(shop, {**ask, **script, **cancel}, for_s=9.0)
    assert fresh == [True, False]


@pytest.mark.parametrize("sensor", ["compass", "motion", "contact"])
def test_run_is_fresh_only_while_a_sensor_that_it_needs_neither_fails_nor_hangs(shop: Workshop, sensor: str) -> None:
    read = f"{sensor}.read"
    script = {
        1.01: breaking(shop, read, NotResponding("gone")),
        3.01: mending(shop),
        6.01: lambda _: shop.silent.add(read),
    }
    rover = {"algorithm": "cv-pledge", "contact": Contact(shop, "contact"), "safety": {"on_lost_sense": "hold"}}
    assert freshness(shop, script, (0.9, 2.0, 5.5, 7.0, 10.0), **rover) == [True, False, True, False, False]


def test_armed_rover_that_goes_on_without_a_sensor_is_fresh_and_a_disarmed_one_is_not(shop: Workshop) -> None:
    """systemd would start the daemon again, and the mission would be over; without one, a start may help the sensor."""
    script = {1.01: breaking(shop, "motion.read", NotResponding("gone")), 4.0: lambda it: it.disarm("enough")}
    assert freshness(shop, script, (3.0, 5.0)) == [True, False]


@pytest.mark.parametrize("sensor", ["compass", "motion", "contact"])
@pytest.mark.parametrize(
    "stands",
    [
        lambda it: it.controller._recovery._ladder._rest_now(2.0),
        lambda it: it.controller.hold(2.0),
        lambda it: setattr(it.controller, "motors_failed", True),
    ],
    ids=["rests", "is held", "waits for its motors"],
)
def test_armed_rover_that_stands_for_another_reason_than_its_lost_sensor_is_fresh(
    shop: Workshop, sensor: str, stands: Callable[[Supervisor], object]
) -> None:
    """Each may last longer than systemd's patience, and the mission goes on afterwards."""
    script: Script = {1.01: breaking(shop, f"{sensor}.read", NotResponding("gone")), 2.0: stands}
    rover = {"algorithm": "cv-pledge", "contact": Contact(shop, "contact")}
    assert freshness(shop, script, (6.0, 12.0, 20.0), **rover) == [True, True, True]


def test_run_is_fresh_without_a_position_a_light_or_a_battery(shop: Workshop) -> None:
    shop.broken = {what: NotResponding("gone") for what in ("position.read", "light.show", "motors.health")}
    parts = {"position": Position(shop, "position"), "light": Light(shop, "light")}
    assert freshness(shop, {}, (1.0, 4.0), **parts) == [True, True]


class RecordingMotors(Motors):
    """Motors that keep what they were told and when."""

    told: ClassVar[list[tuple[float, WheelCommand]]] = []

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self.told.append((asyncio.get_running_loop().time(), command))
        return await super().drive(command)


class SuspendedHandler(Handler):
    """A handler amid whose decision the process is suspended for three seconds, once."""

    suspended_at_s = 0.0

    def decide(self, observation: Observation) -> Decision:
        loop = asyncio.get_running_loop()
        if self.suspended_at_s == 0.0 and loop.time() > 0.5:
            assert isinstance(loop, VirtualLoop)
            SuspendedHandler.suspended_at_s = loop.time()
            loop.stall(3.0)
        return super().decide(observation)


def test_decision_amid_which_the_process_was_suspended_turns_no_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.kit.workshop.Motors", RecordingMotors)
    monkeypatch.setattr("tests.kit.workshop.Handler", SuspendedHandler)
    monkeypatch.setattr(RecordingMotors, "told", [])
    monkeypatch.setattr(SuspendedHandler, "suspended_at_s", 0.0)
    drive(Workshop(), for_s=6.0)
    woken_s = SuspendedHandler.suspended_at_s + 3.0
    before = [command for t_s, command in RecordingMotors.told if t_s < woken_s]
    warned = [command for t_s, command in RecordingMotors.told if woken_s <= t_s < woken_s + 1.0]
    after = [command for t_s, command in RecordingMotors.told if t_s > woken_s + 1.2]
    assert before[-1] == AHEAD
    assert set(warned) == {STOP}
    assert after[0] == AHEAD
