"""A motor board is opened again while a mission waits for it; whatever else happens meanwhile wins."""

from __future__ import annotations

import asyncio
from itertools import pairwise

import pytest

from tests.control.test_supervisor import Armer
from tests.kit.workshop import Motors, Script, Workshop, assert_wheels_stopped_first, breaking, drive, mending
from wayfarer.control.board_watch import REOPEN_AFTER_MAX_S, REOPEN_AFTER_S
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP

SILENT = NotResponding("no acknowledgement")
POLL_S = 0.25  # the board is asked so often
WARNING_S = 1.0


def silent(shop: Workshop) -> object:
    """The board acknowledges nothing."""
    return shop.broken.update({f"motors.{what}": SILENT for what in ("drive", "open", "health")})


def decided_between(shop: Workshop, from_s: float, to_s: float) -> bool:
    return any(from_s <= t_s < to_s for t_s in shop.times("handler.decide"))


def opened_s(shop: Workshop) -> float:
    """When the log says that the board was opened again: the only time."""
    assert len(shop.named("motors_opened")) == 1
    return next(t_s for t_s in shop.times("motors.open") if t_s > 0.5)


def test_board_that_was_silent_for_a_moment_is_opened_again_and_the_mission_goes_on(shop: Workshop) -> None:
    assert drive(shop, {1.01: lambda _: silent(shop), 1.5: mending(shop)}, for_s=10.0).reason == "requested"
    at_s = opened_s(shop)
    assert REOPEN_AFTER_S <= at_s - 1.01 <= REOPEN_AFTER_S + 2 * POLL_S
    assert not decided_between(shop, 1.1, at_s + WARNING_S)
    assert decided_between(shop, at_s + WARNING_S, at_s + WARNING_S + 0.2)
    assert not shop.named("disarmed")
    assert_wheels_stopped_first(shop)


def test_pauses_grow_up_to_the_longest_and_each_failed_try_is_told(shop: Workshop) -> None:
    drive(shop, {1.01: lambda _: silent(shop)}, for_s=400.0)
    tries = shop.times("motors.open")[1:]
    pauses = [later - earlier for earlier, later in pairwise([1.01, *tries])]
    wanted = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, *[REOPEN_AFTER_MAX_S] * 5]
    assert pauses == pytest.approx(wanted, abs=2 * POLL_S)
    assert [each["retry_in_s"] for each in shop.named("motors_not_opened")] == [*wanted[1:], REOPEN_AFTER_MAX_S]
    assert not decided_between(shop, 1.1, 400.0)


def test_board_that_fails_again_soon_waits_longer_and_one_that_was_steady_does_not(shop: Workshop) -> None:
    script: Script = {
        1.01: lambda _: silent(shop), 1.5: mending(shop),
        8.01: lambda _: silent(shop), 8.5: mending(shop),
        90.01: lambda _: silent(shop), 90.5: mending(shop),
    }  # fmt: skip
    drive(shop, script, for_s=100.0)
    first, second, third = shop.times("motors.open")[1:]
    assert [first - 1.01, second - 8.01, third - 90.01] == pytest.approx([1.0, 2.0, 1.0], abs=2 * POLL_S)
    assert len(shop.named("motors_opened")) == 3
    assert decided_between(shop, 99.0, 100.0)


def test_board_that_answers_but_takes_no_command_stays_lost(shop: Workshop) -> None:
    """Each tick sends a stop; while one of them fails, what opening proved is worth nothing."""
    drive(shop, {1.01: breaking(shop, "motors.drive", SILENT)}, for_s=40.0)
    assert len(shop.times("motors.open")) > 3
    assert not shop.named("motors_opened")
    assert not decided_between(shop, 1.1, 40.0)


def test_board_whose_deadman_does_not_arm_never_drives_again(shop: Workshop) -> None:
    script: Script = {
        1.01: breaking(shop, "motors.drive", SILENT),
        1.5: mending(shop),
        1.6: breaking(shop, "motors.open", NotResponding("the failsafe does not arm")),
    }
    drive(shop, script, for_s=300.0)
    assert not decided_between(shop, 1.1, 300.0)


def test_board_with_a_fault_is_opened_again_once_the_fault_has_gone(shop: Workshop) -> None:
    script: Script = {
        1.01: lambda _: setattr(shop, "faults", ("motor A: drive fault",)),
        6.0: lambda _: setattr(shop, "faults", ()),
    }
    drive(shop, script, for_s=20.0)
    assert len(shop.named("motors_opened")) == 1
    assert not decided_between(shop, 1.6, 6.0 + WARNING_S)
    assert decided_between(shop, 19.0, 20.0)


def test_nothing_is_opened_again_among_people_or_while_disarmed(shop: Workshop) -> None:
    drive(shop, {1.01: lambda _: silent(shop), 1.5: mending(shop)}, for_s=10.0, safety={"on_lost_sense": "hold"})
    assert shop.named("disarmed") == [{"reason": "fault: motors_failed"}]
    assert len(shop.times("motors.open")) == 1
    other = Workshop()
    drive(other, {0.5: lambda it: it.disarm("asked"), 1.01: lambda _: silent(other), 1.5: mending(other)}, for_s=10.0)
    assert len(other.times("motors.open")) == 1


def test_wait_for_the_board_is_no_reason_for_systemd_to_end_the_mission(shop: Workshop) -> None:
    fresh: list[bool] = []
    script: Script = {
        1.01: lambda _: (silent(shop), shop.broken.update({"motion.read": SILENT})),
        20.0: lambda it: fresh.append(it.is_fresh()),
    }
    drive(shop, script, for_s=21.0)
    assert fresh == [True]


# -- what happens while the board is being opened --------------------------------------------------------------------


class SlowMotors(Motors):
    """Motors that take ``open_s`` to open, but for the first time."""

    open_s = 2.0

    async def open(self) -> None:
        await super().open()
        if asyncio.get_running_loop().time() > 0.5:
            await asyncio.sleep(self.open_s)
            self.shop.note("motors.slowly_opened")


FAILS_AT_S, MENDED_AT_S, OPENING_AT_S = 1.01, 1.5, 3.0  # it is opened from about 2.2 to 4.2 s


def slowly(shop: Workshop, script: Script, for_s: float = 10.0) -> list[float]:
    """Drive with slow motors that fail and answer again; return when opening them was done."""
    begins: Script = {FAILS_AT_S: lambda _: silent(shop), MENDED_AT_S: mending(shop)}
    drive(shop, {**begins, **script}, for_s=for_s, motors=SlowMotors(shop, "motors"))
    begun_s = shop.times("motors.open")[1]
    assert begun_s < OPENING_AT_S < begun_s + SlowMotors.open_s
    return shop.times("motors.slowly_opened")


def test_slow_board_is_opened_and_the_mission_goes_on(shop: Workshop) -> None:
    (done_s,) = slowly(shop, {})
    assert not decided_between(shop, 1.1, done_s + WARNING_S)
    assert decided_between(shop, 9.0, 10.0)


def test_disarming_meanwhile_wins(shop: Workshop) -> None:
    assert len(slowly(shop, {OPENING_AT_S: lambda it: it.disarm("a person goes there")})) == 1
    assert shop.named("disarmed") == [{"reason": "a person goes there"}]
    assert not shop.named("motors_opened")
    assert not decided_between(shop, 1.1, 10.0)
    assert shop.wheels == STOP


def test_hold_meanwhile_wins(shop: Workshop) -> None:
    slowly(shop, {OPENING_AT_S: lambda it: it.controller.hold(OPENING_AT_S)})
    assert len(shop.named("motors_opened")) == 1
    assert not decided_between(shop, 1.1, 10.0)


def test_end_of_the_run_meanwhile_wins_and_waits_for_nothing(shop: Workshop) -> None:
    assert slowly(shop, {OPENING_AT_S: lambda it: it.finish("requested", "enough")}) == []
    assert shop.trace[-1][0] < OPENING_AT_S + 0.1
    assert_wheels_stopped_first(shop)


def test_cancellation_meanwhile_stops_the_wheels_first(shop: Workshop) -> None:
    with pytest.raises(asyncio.CancelledError):
        slowly(shop, {OPENING_AT_S: lambda _: shop.run is not None and shop.run.cancel()})
    assert shop.trace[-1][0] < OPENING_AT_S + 0.1
    assert_wheels_stopped_first(shop)


def test_failure_of_a_command_meanwhile_makes_what_was_proved_worthless(shop: Workshop) -> None:
    done_s = slowly(shop, {OPENING_AT_S: breaking(shop, "motors.drive", SILENT), OPENING_AT_S + 0.2: mending(shop)})
    assert len(done_s) == 2, "it is opened once more"
    assert len(shop.named("motors_opened")) == 1
    assert not decided_between(shop, 1.1, done_s[1] + WARNING_S)


def test_board_that_fails_in_the_next_mission_is_not_taken_for_opened(shop: Workshop) -> None:
    """The opening of the last mission ends while the next one waits: it has proved nothing about that failure."""
    arm = Armer()
    script: Script = {
        2.5: lambda it: it.disarm("a person goes there"),
        2.6: lambda it: setattr(it._rover.motors, "open_s", 0.0),
        2.7: arm,
        OPENING_AT_S: lambda _: silent(shop),
        OPENING_AT_S + 0.1: mending(shop),
    }
    armed_s, late_s, opened_s = slowly(shop, script, for_s=20.0)
    assert not arm.refusals
    assert decided_between(shop, armed_s, OPENING_AT_S), "the next mission began"
    assert OPENING_AT_S + 0.1 < late_s < opened_s
    assert not decided_between(shop, OPENING_AT_S + 0.1, opened_s + WARNING_S)
    assert decided_between(shop, 19.0, 20.0)


def test_command_to_stop_the_run_while_the_board_fails_ends_it_at_once(shop: Workshop) -> None:
    script: Script = {1.01: lambda _: silent(shop), 1.06: lambda it: it.finish("requested", "enough")}
    assert drive(shop, script, for_s=10.0).reason == "requested"
    assert shop.trace[-1][0] < 1.5
    assert shop.wheels == STOP
    assert_wheels_stopped_first(shop)
