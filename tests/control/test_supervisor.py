"""The supervisor in virtual time: sensors and arming, and their failures."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import Any

import pytest

from tests.kit.workshop import (
    AHEAD,
    PARTS,
    Contact,
    Light,
    Motors,
    Part,
    Position,
    Script,
    Wheels,
    Workshop,
    assert_wheels_stopped_first,
    breaking,
    drive,
    mending,
    supervisor,
)
from tests.virtual import asked, virtual
from wayfarer.control.modes import Mode
from wayfarer.control.run_log import RunLog
from wayfarer.control.sensors import RETRY_PAUSE_MAX_S, RETRY_PAUSE_S, SensorTask, keep_sampling
from wayfarer.control.supervisor import CheckMotors, Supervisor, first_cause
from wayfarer.control.tick import Inbox
from wayfarer.errors import DriverError, MissingPart, NotArmed, NotResponding, PowerLost, WayfarerError
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.mission import RunEnd

# -- a run as it should be ---------------------------------------------------------------------------------------


def test_run_opens_the_motors_first_drives_and_closes_them_last(shop: Workshop) -> None:
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


def test_sensors_ticks_and_questions_to_the_board_keep_their_own_rates(shop: Workshop) -> None:
    drive(shop, for_s=10.0, position=Position(shop, "position"))
    done = {"log.tick": 198, "compass.read": 198, "position.read": 10, "log.position": 10, "motors.health": 40}
    assert {what: sum(t_s < 9.88 for t_s in shop.times(what)) for what in done} == done


def test_unarmed_run_never_moves(shop: Workshop) -> None:
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


async def test_run_on_the_stock_loop_is_the_same(shop: Workshop) -> None:
    under_test = supervisor(shop)
    await under_test.arm(asked(), 0.0)
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
        ({"source": "motion+wheels"}, "anomaly_source = 'motion[+]wheels' needs a wheels sensor, and rover 'bench'"),
    ],
)
def test_missing_part_is_refused_before_anything_is_opened(shop: Workshop, rover: dict[str, Any], text: str) -> None:
    with pytest.raises(MissingPart, match=text):
        supervisor(shop, **rover)
    assert shop.trace == []


@pytest.mark.parametrize("source", ["motion", "contact", "wheels", "yaw", "motion+yaw"])
def test_motion_sensor_is_read_if_it_is_asked_or_a_bumper_is(shop: Workshop, source: str) -> None:
    drive(shop, for_s=0.3, source=source, contact=Contact(shop, "contact"), wheels=Wheels(shop, "wheels"))
    assert ("motion.read" in shop.done) is (not {"motion", "contact"}.isdisjoint(source.split("+")))
    assert ("contact.read" in shop.done) is (source == "contact")
    assert "wheels.read" in shop.done, "for the log, and to measure the way"


@pytest.mark.parametrize("part", sorted(PARTS))
def test_part_that_does_not_open_ends_the_run_with_its_error(shop: Workshop, part: str) -> None:
    shop.broken[f"{part}.open"] = NotResponding(f"{part}: no answer")
    with pytest.raises(NotResponding, match=f"{part}: no answer"):
        drive(shop)
    assert "motors.drive" not in shop.done
    assert_wheels_stopped_first(shop)
    assert shop.outcome[0][0] == "failed"
    assert f"{part}: no answer" in shop.outcome[0][1]


@pytest.mark.parametrize("part", ["light", "position"])
def test_run_begins_without_a_light_or_a_receiver_that_does_not_open(shop: Workshop, part: str) -> None:
    shop.broken[f"{part}.open"] = NotResponding(f"{part}: no answer")
    kind: Callable[[Workshop, str], Part] = {"light": Light, "position": Position}[part]
    rover: dict[str, Any] = {part: kind(shop, part)}
    assert drive(shop, **rover).reason == "requested"
    assert {"part": part, "error": f"{part}: no answer"} in shop.named("part_failed")
    assert "motors.drive" in shop.done


@pytest.mark.parametrize("sensor", ["compass", "motion"])
def test_run_that_a_person_may_drive_begins_without_a_sensor_and_reads_it_only_once_it_is_open(
    shop: Workshop, sensor: str
) -> None:
    """A rover whose compass is dead after a power cut must still be brought back."""
    shop.broken[f"{sensor}.open"] = NotResponding("gone")
    by_hand: list[str] = []

    async def drives(supervisor: Supervisor) -> None:
        await supervisor.begin_manual(asked(), 7, "keys")
        by_hand.append(supervisor.mode.value)

    tasks: list[asyncio.Task[None]] = []
    script: Script = {
        1.0: lambda it: it.disarm("only a person drives"),
        2.0: lambda it: tasks.append(asyncio.create_task(drives(it))),
        3.0: lambda it: by_hand.append(f"fresh: {it.is_fresh()}, read: {f'{sensor}.read' in shop.done}"),
        4.0: mending(shop),
    }
    assert drive(shop, script, for_s=8.0, manual={"allowed": True}).reason == "requested"
    assert by_hand == ["manual", "fresh: True, read: False"]
    assert shop.named("part_failed") == [{"part": sensor, "error": "gone"}]
    assert f"{sensor}.read" in shop.done


def test_run_that_a_person_may_drive_does_not_begin_without_its_motors(shop: Workshop) -> None:
    shop.broken["motors.open"] = NotResponding("motors: no answer")
    with pytest.raises(NotResponding, match="motors: no answer"):
        drive(shop, manual={"allowed": True})


@pytest.mark.parametrize("sensor", ["compass", "motion"])
def test_one_missed_answer_is_asked_again_soon_and_nothing_stops(shop: Workshop, sensor: str) -> None:
    missed = NotResponding("once")
    end = drive(shop, {0.49: breaking(shop, f"{sensor}.read", missed), 0.51: mending(shop)}, for_s=2.0)
    assert end.reason == "requested"
    assert shop.done.count(f"{sensor}.open") == 1
    failed = shop.named("sensor_failed")
    assert failed == [{"sensor": sensor, "error": "once", "retry_in_s": RETRY_PAUSE_S}]
    assert shop.named("health") == [], "nor at the start: the first tick waits for the first readings"


def test_sensor_that_keeps_failing_is_reopened_with_growing_pauses_while_the_others_go_on(shop: Workshop) -> None:
    drive(shop, {0.97: breaking(shop, "compass.read", NotResponding("gone"))}, for_s=12.0)
    pauses_s = [details["retry_in_s"] for details in shop.named("sensor_failed")]
    assert pauses_s[:7] == [RETRY_PAUSE_S * 2**n for n in range(6)] + [RETRY_PAUSE_MAX_S]
    asked_s = [t_s for t_s in shop.times("compass.read") if t_s > 0.97]
    gaps_s = [after - before for before, after in pairwise(asked_s)]
    assert gaps_s == pytest.approx(pauses_s[: len(gaps_s)])
    # The first failure is only asked again; from the second on the part is closed and opened.
    assert shop.done.count("compass.open") - 1 == len(pauses_s) - 2
    assert len(shop.times("motion.read")) == pytest.approx(240, abs=1)


@virtual
async def test_sensor_that_is_silent_for_an_hour_is_still_asked(shop: Workshop) -> None:
    """The pause was once a power of two of the failures, too large for a number after half an hour: the run ended."""
    asked_s: list[float] = []

    async def read() -> None:
        asked_s.append(asyncio.get_running_loop().time())
        raise NotResponding("gone")

    row = SensorTask("compass", Part(shop, "compass"), 20.0, read, lambda _: None)
    with suppress(TimeoutError):
        async with asyncio.timeout(3600.0):
            await keep_sampling(row, Inbox(), RunLog())
    assert len(asked_s) > 1100
    assert asked_s[-1] - asked_s[-2] == pytest.approx(RETRY_PAUSE_MAX_S)


def test_sensor_that_does_not_open_again_is_tried_again(shop: Workshop) -> None:

    def unplug(_: Supervisor) -> None:
        shop.broken |= {"motion.read": NotResponding("gone"), "motion.open": NotResponding("still gone")}

    assert drive(shop, {0.5: unplug, 3.0: mending(shop)}, for_s=8.0).reason == "requested"
    assert "still gone" in [details["error"] for details in shop.named("sensor_failed")]
    assert shop.times("motion.read")[-1] > 7.9


@pytest.mark.parametrize("on_lost_sense", ["continue", "hold"])
def test_rover_goes_on_without_its_motion_sensor_unless_it_is_told_to_hold(shop: Workshop, on_lost_sense: str) -> None:
    """Each attempt to reopen it fails again; that must not count as a sign of life."""
    gone = {1.01: breaking(shop, "motion.read", NotResponding("gone"))}
    drive(shop, gone, for_s=20.0, safety={"on_lost_sense": on_lost_sense})
    causes = [details["cause"] for details in shop.named("health")]
    assert causes[-1] == "motion_stale"
    last_s = 1.5 if on_lost_sense == "hold" else 20.0
    assert max(shop.times("handler.decide")) == pytest.approx(last_s, abs=0.2)


def test_sensor_that_hangs_stops_the_wheels_and_not_the_others(shop: Workshop) -> None:
    end = drive(shop, {1.0: lambda _: shop.silent.add("compass.read")}, for_s=3.0)
    assert end.reason == "requested"
    assert [details["cause"] for details in shop.named("health")][-1] == "compass_stale"
    assert shop.times("motion.read")[-1] > 2.9
    assert_wheels_stopped_first(shop)


# -- arming ------------------------------------------------------------------------------------------------------


class Armer:
    """Arms from a script, after a check; ``refusals`` are the errors that came of it."""

    def __init__(self, check: CheckMotors | None = None) -> None:
        self.check = check
        self.refusals: list[WayfarerError] = []

    async def _arm(self, it: Supervisor) -> None:
        try:
            await it.arm(asked(), 0.0, self.check)
        except WayfarerError as error:
            self.refusals.append(error)

    def __call__(self, it: Supervisor) -> None:
        self.task = asyncio.ensure_future(self._arm(it))


def test_arming_opens_the_motors_again_before_the_wheels_may_turn(shop: Workshop) -> None:
    """A board that lost its power for a moment has forgotten its deadman."""
    arm = Armer()
    drive(shop, {0.31: lambda it: it.disarm("asked"), 0.51: arm})
    assert arm.refusals == []
    assert shop.times("motors.open") == pytest.approx([0.0, 0.51])
    decided = shop.times("handler.decide")
    assert [t_s for t_s in decided if 0.36 < t_s < 0.51] == []
    assert decided[-1] > 0.9


def test_motor_board_that_does_not_open_refuses_to_arm_and_nothing_has_changed(shop: Workshop) -> None:
    arm = Armer()
    modes: list[tuple[Mode, str]] = []
    script: Script = {
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


@pytest.mark.parametrize("where", ["handler.decide", "motors.drive", "log.tick"])
def test_tick_without_memory_holds_the_wheels_and_the_mission_goes_on(shop: Workshop, where: str) -> None:
    """It ended the run, and the rover stood in the forest, disarmed; another program may have given its memory back."""
    wheels: list[WheelCommand] = []
    script: Script = {
        0.51: breaking(shop, where, MemoryError()),
        0.91: mending(shop),
        0.95: lambda _: wheels.append(shop.wheels),
        1.4: lambda _: wheels.append(shop.wheels),
        4.0: lambda _: wheels.append(shop.wheels),
    }
    assert drive(shop, script, for_s=5.0).reason == "requested"
    assert wheels == [STOP, STOP, AHEAD]
    (told,) = shop.named("motors_failed")
    assert told == {"error": "no memory was left for a control tick", "lost": "tick"}
    assert len(shop.named("motors_opened")) == 1, "nobody knows what the board had been told"


@pytest.mark.parametrize("disarmed", [False, True])
def test_memory_that_stays_away_or_a_disarmed_rover_ends_the_run_with_its_wheels_stopped(
    shop: Workshop, disarmed: bool
) -> None:
    script: Script = {0.5: breaking(shop, "handler.decide" if not disarmed else "log.tick", MemoryError())}
    if disarmed:
        script = {0.4: lambda it: it.disarm("enough"), **script}
    with pytest.raises(ExceptionGroup) as raised:
        drive(shop, script, for_s=60.0)
    assert isinstance(first_cause(raised.value), MemoryError)
    assert_wheels_stopped_first(shop)
    assert (len(shop.named("motors_failed")) == 0) is disarmed
    assert shop.trace[-1][0] < (0.6 if disarmed else 15.0)
    assert shop.outcome[0][1].startswith("MemoryError")


def test_motors_that_failed_are_opened_again_by_arming_and_drive_again(shop: Workshop) -> None:
    arm = Armer()
    script: Script = {
        0.5: breaking(shop, "motors.drive", NotResponding("no acknowledgement")),
        0.9: mending(shop),
        1.0: lambda it: it.disarm("a person goes there"),
        1.5: arm,
    }
    assert drive(shop, script, for_s=2.0).reason == "requested"
    assert [details["error"] for details in shop.named("motors_failed")] == ["no acknowledgement"]
    assert shop.times("motors.open") == pytest.approx([0.0, 1.5])
    decided = shop.times("handler.decide")
    assert [t_s for t_s in decided if 0.56 < t_s < 1.5] == []
    assert decided[-1] > 1.9
    assert_wheels_stopped_first(shop)


def test_check_that_speaks_against_arming_comes_after_the_motors_are_open_and_no_wheel_turns(shop: Workshop) -> None:
    async def refuse(failed: DriverError | None) -> None:
        assert (failed, shop.done.count("motors.open")) == (None, 2), "that of the start of the run, and that of now"
        raise NotArmed("the compass is not calibrated")

    arm = Armer(refuse)
    drive(shop, {0.31: lambda it: it.disarm("asked"), 0.51: arm})
    assert [str(refusal) for refusal in arm.refusals] == ["the compass is not calibrated"]
    assert shop.done.count("motors.open") == 2
    assert max(shop.times("handler.decide")) < 0.36


@pytest.mark.parametrize("act", [lambda it: it.disarm("stop!"), lambda it: it.finish("requested", "stop!")])
def test_rover_that_is_disarmed_while_it_is_checked_is_not_armed_afterwards(
    shop: Workshop,
    act: Callable[[Supervisor], object],
) -> None:
    """Whoever says stop last must be right."""

    async def takes_long(_: object) -> None:
        await asyncio.sleep(0.17)

    arm = Armer(takes_long)
    drive(shop, {0.31: lambda it: it.disarm("asked"), 0.51: arm, 0.67: act})
    assert [type(refusal) for refusal in arm.refusals] == [NotArmed]
    assert max(shop.times("handler.decide")) < 0.36
    assert len(shop.named("arming")) == 1, "only that at the start of the run"


def test_mission_that_has_begun_while_a_person_waited_is_stopped_as_that_person_takes_over(shop: Workshop) -> None:
    wheels: list[WheelCommand] = []

    async def takes_over(run: Supervisor) -> None:
        await run.begin_manual(asked(), 7, "page", lambda _: asyncio.sleep(0.32))
        wheels.append(shop.wheels)

    tasks: list[asyncio.Task[None]] = []
    script: Script = {
        0.31: lambda it: it.disarm("asked"),
        0.51: lambda it: tasks.append(asyncio.ensure_future(it.arm(asked(), 0.0, lambda _: asyncio.sleep(0.1)))),
        0.56: lambda it: tasks.append(asyncio.ensure_future(takes_over(it))),
        0.87: lambda _: wheels.append(shop.wheels),
    }
    drive(shop, script, manual={"allowed": True})
    assert wheels == [AHEAD, STOP]


@pytest.mark.parametrize("takes_over", [False, True])
def test_board_that_fails_while_it_is_opened_starts_no_wheel(shop: Workshop, takes_over: bool) -> None:
    """What opening has proved may be out of date: it may have lost its power, and its deadman, just afterwards."""

    class SlowMotors(Motors):
        async def open(self) -> None:
            await super().open()
            if asyncio.get_running_loop().time() > 0.4:
                await asyncio.sleep(0.2)

    refusals: list[str] = []

    async def start(run: Supervisor) -> None:
        try:
            await (run.begin_manual(asked(), 7, "page") if takes_over else run.arm(asked(), 0.0))
        except NotArmed as error:
            refusals.append(str(error))

    tasks: list[asyncio.Task[None]] = []
    script: Script = {
        0.31: lambda it: it.disarm("asked"),
        0.5: lambda it: tasks.append(asyncio.ensure_future(start(it))),
        0.56: breaking(shop, "motors.drive", PowerLost("motors")),
        0.64: mending(shop),
    }
    drive(shop, script, for_s=3.0, motors=SlowMotors(shop, "motors"))
    assert refusals == ["not started: the motor board failed while it was being opened: check its wires, ask again"]
    assert max(shop.times("handler.decide")) < 0.4
