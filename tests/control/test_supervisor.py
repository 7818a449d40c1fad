"""The supervisor in virtual time: sensors, arming, board and light beside the controller, each with its troubles."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from itertools import pairwise
from typing import Any, ClassVar

import pytest

from tests.workshop import (
    AHEAD,
    PARTS,
    Contact,
    Handler,
    Light,
    Motors,
    Part,
    Position,
    Script,
    Workshop,
    assert_wheels_stopped_first,
    breaking,
    drive,
    mending,
    supervisor,
)
from wayfarer.control.controller import Mode
from wayfarer.control.sensors import RETRY_PAUSE_MAX_S, RETRY_PAUSE_S
from wayfarer.control.status_light import BLUE, GREEN, OFF, RED, YELLOW
from wayfarer.control.supervisor import Supervisor
from wayfarer.errors import DriverError, MissingPart, NotArmed, NotResponding, WayfarerError
from wayfarer.escape.api import Decision, Observation
from wayfarer.hal import (
    STOP,
    Colour,
    WheelCommand,
)
from wayfarer.safety.conditions import Condition
from wayfarer.safety.mission_limits import RunEnd
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

# -- a run as it should be ---------------------------------------------------------------------------------------


def test_run_opens_the_motors_first_drives_and_closes_them_last() -> None:
    shop = Workshop()
    end = drive(shop)
    assert end == RunEnd("requested", "enough")
    assert shop.done[1:4] == ["motors.open", "compass.open", "motion.open"]
    assert [what for what in shop.done if what.endswith(".close")] == [
        "motion.close",
        "compass.close",
        "motors.close",
        "log.close",
    ]
    assert shop.outcome == [("requested", "enough")]
    assert_wheels_stopped_first(shop)


def test_sensors_and_ticks_keep_their_own_rates() -> None:
    shop = Workshop()
    drive(shop, for_s=10.0, position=Position(shop, "position"))
    done = {"log.tick": 198, "compass.read": 198, "position.read": 10, "log.position": 10}
    assert {what: sum(t_s < 9.88 for t_s in shop.times(what)) for what in done} == done


def test_unarmed_run_never_moves() -> None:
    shop = Workshop()
    wheels = []
    script: dict[float, Callable[[Supervisor], object]] = {0.01: lambda it: it.disarm("not yet")}
    script |= {0.1 * n: lambda it: wheels.append((it.mode, shop.wheels)) for n in range(1, 9)}
    drive(shop, script)
    assert set(wheels) == {(Mode.DISARMED, STOP)}


def test_contact_sensor_is_read_only_where_it_is_needed() -> None:
    for algorithm, source, expected in [("pledge", "motion", 0), ("cv-pledge", "motion", 1), ("pledge", "contact", 1)]:
        shop = Workshop()
        drive(shop, contact=Contact(shop, "contact"), algorithm=algorithm, source=source)
        assert bool(shop.times("contact.read")) == expected


async def test_run_on_the_stock_loop_is_the_same() -> None:
    shop = Workshop()
    under_test = supervisor(shop)
    await under_test.arm(0.0)
    asyncio.get_running_loop().call_later(0.12, under_test.finish, "requested", "enough")
    assert (await under_test.run()).reason == "requested"
    assert "handler.decide" in shop.done
    assert_wheels_stopped_first(shop)


# -- missing and failing parts -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rover", "text"),
    [
        ({"algorithm": "cv-pledge"}, "algorithm 'cv-pledge' needs a contact sensor, and rover 'bench' has none"),
        ({"source": "contact"}, "anomaly_source = 'contact' needs a contact sensor, and rover 'bench' has none"),
        ({"motion": None}, "anomaly_source = 'motion' needs a motion sensor, and rover 'bench' has none"),
    ],
)
def test_missing_part_is_refused_before_anything_is_opened(rover: dict[str, Any], text: str) -> None:
    shop = Workshop()
    with pytest.raises(MissingPart, match=text):
        supervisor(shop, **rover)
    assert shop.trace == []


@pytest.mark.parametrize("part", sorted(PARTS))
def test_part_that_does_not_open_ends_the_run_with_its_error(part: str) -> None:
    shop = Workshop()
    shop.broken[f"{part}.open"] = NotResponding(f"{part}: no answer")
    with pytest.raises(NotResponding, match=f"{part}: no answer"):
        drive(shop)
    assert "motors.drive" not in shop.done
    assert_wheels_stopped_first(shop)
    assert shop.outcome[0][0] == "failed"
    assert f"{part}: no answer" in shop.outcome[0][1]


@pytest.mark.parametrize("part", ["light", "position"])
def test_run_begins_without_a_light_or_a_receiver_that_does_not_open(part: str) -> None:
    shop = Workshop()
    shop.broken[f"{part}.open"] = NotResponding(f"{part}: no answer")
    kind: Callable[[Workshop, str], Part] = {"light": Light, "position": Position}[part]
    rover: dict[str, Any] = {part: kind(shop, part)}
    assert drive(shop, **rover).reason == "requested"
    assert {"part": part, "error": f"{part}: no answer"} in shop.named("part_failed")
    assert "motors.drive" in shop.done


@pytest.mark.parametrize("sensor", ["compass", "motion"])
def test_one_missed_answer_is_asked_again_soon_and_nothing_stops(sensor: str) -> None:
    shop = Workshop()
    missed = NotResponding("once")
    end = drive(shop, {0.49: breaking(shop, f"{sensor}.read", missed), 0.51: mending(shop)}, for_s=2.0)
    assert end.reason == "requested"
    assert shop.done.count(f"{sensor}.open") == 1
    failed = shop.named("sensor_failed")
    assert failed == [{"sensor": sensor, "error": "once", "retry_in_s": RETRY_PAUSE_S}]
    assert shop.named("health") == [], "nor at the start: the first tick waits for the first readings"


def test_sensor_that_keeps_failing_is_reopened_with_growing_pauses_while_the_others_go_on() -> None:
    shop = Workshop()
    drive(shop, {0.97: breaking(shop, "compass.read", NotResponding("gone"))}, for_s=12.0)
    pauses_s = [details["retry_in_s"] for details in shop.named("sensor_failed")]
    assert pauses_s[:7] == [RETRY_PAUSE_S * 2**n for n in range(6)] + [RETRY_PAUSE_MAX_S]
    asked_s = [t_s for t_s in shop.times("compass.read") if t_s > 0.97]
    gaps_s = [after - before for before, after in pairwise(asked_s)]
    assert gaps_s == pytest.approx(pauses_s[: len(gaps_s)])
    # The first failure is only asked again; from the second on the part is closed and opened.
    assert shop.done.count("compass.open") - 1 == len(pauses_s) - 2
    assert len(shop.times("motion.read")) == pytest.approx(240, abs=1)


def test_sensor_that_does_not_open_again_is_tried_again() -> None:
    shop = Workshop()

    def unplug(_: Supervisor) -> None:
        shop.broken |= {"motion.read": NotResponding("gone"), "motion.open": NotResponding("still gone")}

    assert drive(shop, {0.5: unplug, 3.0: mending(shop)}, for_s=8.0).reason == "requested"
    assert "still gone" in [details["error"] for details in shop.named("sensor_failed")]
    assert shop.times("motion.read")[-1] > 7.9


def test_wheels_are_held_while_the_compass_is_silent_and_go_on_afterwards() -> None:
    shop = Workshop()
    wheels: dict[float, WheelCommand] = {}

    def look(t_s: float) -> Callable[[Supervisor], object]:
        return lambda _: wheels.update({t_s: shop.wheels})

    script = {1.01: breaking(shop, "compass.read", NotResponding("gone")), 3.0: mending(shop)}
    drive(shop, script | {t_s: look(t_s) for t_s in (0.99, 1.26, 1.42, 2.9, 5.5)}, for_s=6.0)
    assert wheels == {0.99: AHEAD, 1.26: AHEAD, 1.42: STOP, 2.9: STOP, 5.5: AHEAD}


def test_wheels_are_held_all_the_time_while_the_motion_sensor_is_gone() -> None:
    """Each attempt to reopen it fails anew; that must not count as a sign of life."""
    shop = Workshop()
    drive(shop, {1.01: breaking(shop, "motion.read", NotResponding("gone"))}, for_s=20.0)
    assert 1.01 < max(shop.times("handler.decide")) < 1.7


def test_sensor_that_hangs_stops_the_wheels_and_not_the_others() -> None:
    shop = Workshop()
    end = drive(shop, {1.0: lambda _: shop.silent.add("compass.read")}, for_s=3.0)
    assert end.reason == "requested"
    assert [details["cause"] for details in shop.named("health")][-1] == "compass_stale"
    assert shop.times("motion.read")[-1] > 2.9
    assert_wheels_stopped_first(shop)


def test_motors_that_do_not_answer_disarm_and_the_run_goes_on() -> None:
    shop = Workshop()
    modes = []
    script = {
        0.5: breaking(shop, "motors.drive", DriverError("no acknowledgement")),
        0.9: lambda it: modes.append(it.mode),
    }
    assert drive(shop, script).reason == "requested"
    assert modes == [Mode.DISARMED]
    assert_wheels_stopped_first(shop)


# -- arming ------------------------------------------------------------------------------------------------------


class Armer:
    """Arms from a script, after a check; ``refusals`` are the errors that came of it."""

    def __init__(self, check: Callable[[], Awaitable[None]] | None = None) -> None:
        self.check = check
        self.refusals: list[WayfarerError] = []

    async def _arm(self, it: Supervisor) -> None:
        try:
            await it.arm(0.0, self.check)
        except WayfarerError as error:
            self.refusals.append(error)

    def __call__(self, it: Supervisor) -> None:
        self.task = asyncio.ensure_future(self._arm(it))


def test_arming_opens_the_motors_anew_before_the_wheels_may_turn() -> None:
    """A board that lost its power for a moment has forgotten its deadman."""
    shop, arm = Workshop(), Armer()
    drive(shop, {0.31: lambda it: it.disarm("asked"), 0.51: arm})
    assert arm.refusals == []
    assert shop.times("motors.open") == pytest.approx([0.0, 0.51])
    decided = shop.times("handler.decide")
    assert [t_s for t_s in decided if 0.36 < t_s < 0.51] == []
    assert decided[-1] > 0.9


def test_motor_board_that_does_not_open_refuses_to_arm_and_nothing_has_changed() -> None:
    shop, arm = Workshop(), Armer()
    modes: list[tuple[Mode, str]] = []
    script: dict[float, Callable[[Supervisor], object]] = {
        0.31: lambda it: it.disarm("asked"),
        0.4: breaking(shop, "motors.open", NotResponding("board: no answer; switch it on")),
        0.51: arm,
        0.9: lambda it: modes.append((it.mode, it.controller.why_disarmed)),
    }
    assert drive(shop, script).reason == "requested"
    assert [str(refusal) for refusal in arm.refusals] == ["board: no answer; switch it on"]
    assert modes == [(Mode.DISARMED, "asked")]
    assert len(shop.named("arming")) == 1, "only that at the start of the run"
    assert max(shop.times("handler.decide")) < 0.4


def test_motors_that_failed_are_opened_anew_by_arming_and_drive_again() -> None:
    shop, arm = Workshop(), Armer()
    script: dict[float, Callable[[Supervisor], object]] = {
        0.5: breaking(shop, "motors.drive", NotResponding("no acknowledgement")),
        0.9: mending(shop),
        1.5: arm,
    }
    assert drive(shop, script, for_s=2.0).reason == "requested"
    assert [details["error"] for details in shop.named("motors_failed")] == ["no acknowledgement"]
    assert shop.times("motors.open") == pytest.approx([0.0, 1.5])
    decided = shop.times("handler.decide")
    assert [t_s for t_s in decided if 0.56 < t_s < 1.5] == []
    assert decided[-1] > 1.9


def test_check_that_speaks_against_arming_is_made_before_the_motors_are_touched() -> None:
    async def refuse() -> None:
        raise NotArmed("the compass is not calibrated")

    shop, arm = Workshop(), Armer(refuse)
    drive(shop, {0.31: lambda it: it.disarm("asked"), 0.51: arm})
    assert [str(refusal) for refusal in arm.refusals] == ["the compass is not calibrated"]
    assert shop.done.count("motors.open") == 1
    assert max(shop.times("handler.decide")) < 0.36


@pytest.mark.parametrize("act", [lambda it: it.disarm("stop!"), lambda it: it.finish("requested", "stop!")])
def test_rover_that_is_disarmed_while_it_is_checked_is_not_armed_afterwards(
    act: Callable[[Supervisor], object],
) -> None:
    """Whoever says stop last must be right."""

    async def takes_long() -> None:
        await asyncio.sleep(0.17)

    shop, arm = Workshop(), Armer(takes_long)
    drive(shop, {0.31: lambda it: it.disarm("asked"), 0.51: arm, 0.67: act})
    assert [type(refusal) for refusal in arm.refusals] == [NotArmed]
    assert max(shop.times("handler.decide")) < 0.36
    assert len(shop.named("arming")) == 1, "only that at the start of the run"


# -- the motor board ---------------------------------------------------------------------------------------------


def test_board_is_asked_at_its_own_rate() -> None:
    shop = Workshop()
    drive(shop, for_s=10.0)
    assert len(shop.times("motors.health")) == pytest.approx(40, abs=1)


def test_board_that_falls_silent_is_told_once_and_the_rover_drives_on() -> None:
    shop = Workshop()
    gone = NotResponding("board: no answer")
    script: dict[float, Callable[[Supervisor], object]] = {
        1.1: breaking(shop, "motors.health", gone),
        4.1: mending(shop),
        6.1: breaking(shop, "motors.health", gone),
    }
    assert drive(shop, script, for_s=8.0).reason == "requested"
    assert shop.named("board_silent") == [{"error": "board: no answer"}] * 2, "once for each time"
    causes = [details["cause"] for details in shop.named("health")]
    assert causes[-3:] == ["board_silent", None, "board_silent"]
    assert len(shop.times("handler.decide")) == pytest.approx(8.0 * 20, abs=5)


def test_board_fault_stops_the_wheels_within_half_a_second() -> None:
    shop = Workshop()
    drive(shop, {1.01: lambda _: setattr(shop, "faults", ("motor A: drive fault",))}, for_s=3.0)
    assert shop.named("disarmed") == [{"reason": "fault: board_fault"}]
    assert 1.01 < max(shop.times("handler.decide")) <= 1.51


def halts_between(shop: Workshop, from_s: float, to_s: float) -> int:
    return sum(from_s <= t_s < to_s for t_s in shop.times("motors.halt"))


@pytest.mark.parametrize("at_s", [1.01, 1.06, 1.11, 1.16, 1.21, 1.249, 1.251])
def test_board_that_turns_the_wheels_by_itself_is_a_fault_within_half_a_second(at_s: float) -> None:
    """It answers what it was told, until a hold that it does not take."""
    shop, seen = Workshop(), []
    script: Script = {
        0.4: lambda it: setattr(shop, "answer", AHEAD),
        at_s: lambda it: it.controller.hold(at_s, held=True),
        at_s + 0.5: lambda it: seen.append((it.mode, it.controller.why_disarmed)),
    }
    drive(shop, script, for_s=3.0)
    assert seen == [(Mode.DISARMED, "fault: board_disagrees")]
    assert halts_between(shop, 2.0, 3.0) == pytest.approx(20, abs=1), "the stop is repeated at each tick"


def test_board_that_turns_the_wheels_of_a_disarmed_rover_is_stopped_again_and_again() -> None:
    shop, seen = Workshop(), []
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


def test_stop_that_comes_between_a_command_and_the_board_is_no_fault() -> None:
    """A halt reaches the board before the next tick does: for a moment it says less than was applied."""
    shop, seen = Workshop(), []

    def halt(it: Supervisor) -> None:
        shop.answer = STOP
        it.controller.hold(1.249, held=True)

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
        self.troubles = {"reads retried": 0, "garbage": 0}


def test_troubles_of_a_part_are_noted_when_they_grow_at_most_once_a_second() -> None:
    shop = Workshop()
    contact = CountingContact(shop, "contact")

    def fail_often(it: Supervisor) -> None:
        contact.troubles["reads retried"] += 1
        if it.controller.end is None:
            asyncio.get_running_loop().call_later(0.01, fail_often, it)

    drive(shop, {0.2: fail_often}, for_s=3.5, contact=contact, source="contact")
    noted = shop.named("part_troubles")
    assert [each["part"] for each in noted] == ["contact"] * 3
    assert [each["counts"] for each in noted] == [
        {"reads retried": pytest.approx(count, abs=3)} for count in (80, 180, 280)
    ]


def test_board_that_hangs_stops_neither_the_ticks_nor_the_end() -> None:
    shop = Workshop()
    shop.silent.add("motors.health")
    assert drive(shop, for_s=2.0).reason == "requested"
    assert len(shop.times("handler.decide")) == pytest.approx(40, abs=5)
    assert_wheels_stopped_first(shop)


# -- the status light --------------------------------------------------------------------------------------------


def shown(shop: Workshop, from_s: float, to_s: float) -> set[Colour]:
    return {colour for t_s, colour in shop.colours if from_s <= t_s < to_s}


def test_light_shows_arming_driving_and_fault() -> None:
    shop = Workshop()
    broken = breaking(shop, "motors.drive", NotResponding("gone"))
    drive(shop, {0.01: lambda it: None, 4.01: broken}, for_s=6.0, light=Light(shop, "light"), start_delay_s=2.0)
    assert shown(shop, 0.1, 1.9) == {YELLOW, OFF}
    assert shown(shop, 2.2, 4.0) == {GREEN}
    assert shown(shop, 4.3, 6.0) == {RED, OFF}


def test_light_shows_a_rover_that_is_disarmed() -> None:
    shop = Workshop()
    drive(shop, {0.5: lambda it: it.disarm("asked")}, for_s=2.0, light=Light(shop, "light"))
    assert shown(shop, 0.8, 2.0) == {BLUE}


def test_light_that_fails_stops_nothing_and_is_told_once() -> None:
    shop = Workshop()
    gone = NotResponding("light: no answer")
    script: dict[float, Callable[[Supervisor], object]] = {
        1.1: breaking(shop, "light.show", gone),
        3.1: mending(shop),
        5.1: breaking(shop, "light.show", gone),
    }
    assert drive(shop, script, for_s=6.0, light=Light(shop, "light")).reason == "requested"
    assert shop.named("light_failed") == [{"error": "light: no answer"}] * 2, "once for each time"
    assert len(shop.times("handler.decide")) == pytest.approx(6.0 * 20, abs=5)
    assert shown(shop, 3.3, 5.0) == {GREEN}, "it is tried again"


def test_light_that_hangs_stops_nothing() -> None:
    shop = Workshop()
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


def test_run_is_not_fresh_before_its_first_tick_and_fresh_while_it_drives() -> None:
    shop = Workshop()
    assert not supervisor(shop).is_fresh()
    assert freshness(shop, {}, (0.3, 1.0, 9.0)) == [True, True, True]


def test_run_is_not_fresh_while_a_tick_hangs() -> None:
    shop = Workshop()
    script = {1.01: lambda _: shop.silent.add("motors.drive")}
    fresh: list[bool] = []
    ask = {t_s: lambda it: fresh.append(it.is_fresh()) for t_s in (1.5, 2.2)}
    cancel = {3.0: lambda _: shop.run is not None and shop.run.cancel()}
    with pytest.raises(asyncio.CancelledError):
        drive(shop, {**ask, **script, **cancel}, for_s=9.0)
    assert fresh == [True, False]


@pytest.mark.parametrize("sensor", ["compass", "motion", "contact"])
def test_run_is_not_fresh_while_a_sensor_that_it_needs_is_silent(sensor: str) -> None:
    shop = Workshop()
    script = {1.01: lambda _: shop.silent.add(f"{sensor}.read")}
    rover = {"algorithm": "cv-pledge", "contact": Contact(shop, "contact")}
    assert freshness(shop, script, (0.9, 2.0, 5.0), **rover) == [True, False, False]


@pytest.mark.parametrize("sensor", ["compass", "motion", "contact"])
def test_run_is_fresh_again_when_the_sensor_is_back(sensor: str) -> None:
    shop = Workshop()
    script = {1.01: breaking(shop, f"{sensor}.read", NotResponding("gone")), 3.01: mending(shop)}
    rover = {"algorithm": "cv-pledge", "contact": Contact(shop, "contact")}
    assert freshness(shop, script, (0.9, 2.0, 5.5), **rover) == [True, False, True]


def test_run_is_fresh_without_a_position_a_light_or_a_battery() -> None:
    shop = Workshop()
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
    monkeypatch.setattr("tests.workshop.Motors", RecordingMotors)
    monkeypatch.setattr("tests.workshop.Handler", SuspendedHandler)
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
