"""Checks with motion: nothing turns without consent, everything stops whatever happens, mistakes name the setting."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.commissioning.checks.rigs import Rig, Script, push_by_hand, run
from wayfarer.commissioning.checks import CheckVerdict, Finding, check
from wayfarer.commissioning.checks.motion import WATCH_S, check_motion, judge_push
from wayfarer.commissioning.checks.standalone import StandaloneInspection
from wayfarer.commissioning.manual_drive import Push
from wayfarer.hal import WheelCommand

NAMES = ["deadman trips", "left wheels", "right wheels", "notices being stuck", "push"]


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    rig = Rig(tmp_path)
    rig.motion.on_blocks = True
    return rig


def person(
    rig: Rig,
    answers: dict[str, bool],
    does: dict[str, Callable[[], Awaitable[None]]] | None = None,
    push_m: float = 0.5,
) -> Script:
    """Someone who puts the rover on the ground before pushing it."""

    async def push() -> None:
        rig.motion.on_blocks = False
        await push_by_hand(rig.world, push_m)

    return Script(rig.world, answers, {"push it half a metre": push, **(does or {})})


def look(rig: Rig, someone: Script) -> dict[str, Finding]:
    async def main() -> list[Finding]:
        async with StandaloneInspection(rig.config, rig.rover, rig.host) as inspection:
            return await check_motion(inspection, someone.ask)

    findings = run(main())
    assert rig.world.commanded == (0.0, 0.0)
    assert [finding.name for finding in findings] == NAMES
    return {finding.name: finding for finding in findings}


def test_all_is_well_with_a_healthy_rover(rig: Rig) -> None:
    findings = look(rig, person(rig, {}))
    assert {finding.verdict for finding in findings.values()} == {CheckVerdict.OK}
    assert 0.0 < rig.world.most <= 0.5


def test_no_check_turns_the_wheels_faster_than_the_rover_may(rig: Rig) -> None:
    limited = replace(rig.config.safety, duty_max=0.3)
    rig.config = rig.config.model_copy(update={"safety": limited})
    findings = look(rig, person(rig, {}))
    assert {finding.verdict for finding in findings.values()} == {CheckVerdict.OK}
    assert rig.world.most == pytest.approx(0.3, abs=0.01)
    assert {round(max(map(abs, command)), 3) for command in rig.motors.commands if any(command)} == {0.2, 0.25, 0.3}


# -- consent -------------------------------------------------------------------------------------------------------


def test_without_a_person_no_wheel_turns_and_every_check_says_why(rig: Rig) -> None:
    findings = run(check(rig.config, rig.rover, rig.host, ask=None))
    assert rig.world.most == 0.0
    assert rig.motors.commands == []
    motion = [finding for finding in findings if finding.name in NAMES]
    assert [finding.verdict for finding in motion] == [CheckVerdict.SKIPPED] * 5
    assert all("nobody to ask" in finding.found for finding in motion)


def test_without_a_yes_no_wheel_turns(rig: Rig) -> None:
    findings = look(rig, person(rig, {"on blocks": False}))
    assert rig.world.most == 0.0
    assert rig.motors.commands == []
    assert [findings[name].verdict for name in NAMES[:4]] == [CheckVerdict.SKIPPED] * 4


def test_a_silent_board_is_not_asked_to_turn_wheels(rig: Rig) -> None:
    rig.motors.dead = True
    someone = person(rig, {})
    findings = look(rig, someone)
    assert [findings[name].verdict for name in NAMES[:4]] == [CheckVerdict.SKIPPED] * 4
    assert not any("blocks" in text for text in someone.told)


# -- stopping ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [1, 5, 12, 25, 35, 45, 55, 60])
def test_a_board_that_fails_in_the_middle_is_stopped_and_turns_no_wheel_again(rig: Rig, at: int) -> None:
    rig.motors.fails_at = at
    findings = look(rig, person(rig, {}))
    verdicts = [findings[name].verdict for name in NAMES[:4]]
    broken = verdicts.index(CheckVerdict.FAIL)
    assert set(verdicts[:broken]) <= {CheckVerdict.OK}
    assert set(verdicts[broken + 1 :]) <= {CheckVerdict.SKIPPED}
    assert len(rig.motors.commands) == at


@pytest.mark.parametrize("at", [1, 12, 25, 60])
def test_any_other_error_stops_the_wheels_as_well(rig: Rig, at: int) -> None:
    rig.motors.fails_at, rig.motors.error = at, ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        look(rig, person(rig, {}))
    assert rig.world.commanded == (0.0, 0.0)


@pytest.mark.parametrize("after_s", [0.1, 0.6, 0.95, 1.3, 2.1, 3.2])
def test_a_cancellation_stops_the_wheels(rig: Rig, after_s: float) -> None:
    async def main() -> None:
        inspection = StandaloneInspection(rig.config, rig.rover, rig.host)
        task = asyncio.ensure_future(check_motion(inspection, person(rig, {}).ask))
        await asyncio.sleep(after_s)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run(main())
    assert rig.world.most > 0.0
    assert rig.world.commanded == (0.0, 0.0)


def test_an_impatient_second_cancellation_does_not_cut_the_stop_short(rig: Rig) -> None:
    rig.motors.stop_takes_s = 1.0  # as over a bus that hangs

    async def main() -> None:
        inspection = StandaloneInspection(rig.config, rig.rover, rig.host)
        task = asyncio.ensure_future(check_motion(inspection, person(rig, {}).ask))
        await asyncio.sleep(0.3)
        for _ in range(2):
            assert not task.done()
            task.cancel()
            await asyncio.sleep(0.01)
        with pytest.raises(asyncio.CancelledError):
            await task

    run(main())
    assert rig.world.most > 0.0
    assert rig.world.commanded == (0.0, 0.0)


def test_an_inspection_opens_each_part_once(rig: Rig) -> None:
    opened: list[float] = []
    open_board = rig.motors.open

    async def count() -> None:
        opened.append(asyncio.get_running_loop().time())
        await open_board()

    rig.motors.open = count  # type: ignore[method-assign]
    run(check(rig.config, rig.rover, rig.host, person(rig, {}).ask))
    assert len(opened) == 1


def test_leaving_an_inspection_stops_the_wheels(rig: Rig) -> None:
    async def main() -> None:
        async with StandaloneInspection(rig.config, rig.rover, rig.host) as inspection:
            await inspection.open("motors")
            await rig.motors.drive(WheelCommand(0.1, 0.1))

    run(main())
    assert rig.world.commanded == (0.0, 0.0)


def test_a_motion_sensor_that_fails_stops_the_wheels(rig: Rig) -> None:
    rig.motion.dead = True
    findings = look(rig, person(rig, {}))
    assert findings["notices being stuck"].verdict is CheckVerdict.FAIL
    assert findings["push"].verdict is CheckVerdict.FAIL


# -- the deadman ---------------------------------------------------------------------------------------------------


def test_a_deadman_that_does_not_trip_fails(rig: Rig) -> None:
    rig.motors.trips = False
    finding = look(rig, person(rig, {}))["deadman trips"]
    assert finding.verdict is CheckVerdict.FAIL
    assert "0.4 s of silence" in finding.found


def test_wheels_that_never_started_prove_no_deadman(rig: Rig) -> None:
    async def nothing(command: WheelCommand) -> WheelCommand:
        return command

    rig.motors.drive = nothing  # type: ignore[method-assign]
    finding = look(rig, person(rig, {}))["deadman trips"]
    assert (finding.verdict, finding.found) == (CheckVerdict.FAIL, "the wheels did not start")


def test_a_board_without_deadman_has_none_to_trip(rig: Rig) -> None:
    rig.motors.deadman_s = None
    assert look(rig, person(rig, {}))["deadman trips"].verdict is CheckVerdict.SKIPPED


@pytest.mark.parametrize(("seen", "verdict"), [(True, CheckVerdict.OK), (False, CheckVerdict.FAIL)])
def test_a_board_that_cannot_be_asked_is_watched_by_the_person(rig: Rig, seen: bool, verdict: CheckVerdict) -> None:
    rig.motors.tells = False
    someone = person(rig, {"Did they turn for": seen})
    assert look(rig, someone)["deadman trips"].verdict is verdict
    assert any("about 0.8 s, and not for 3.4 s" in text for text in someone.told)


def test_wheels_that_nobody_counts_are_not_started_for_it(rig: Rig) -> None:
    rig.motors.tells = False
    assert look(rig, person(rig, {"count the seconds": False}))["deadman trips"].verdict is CheckVerdict.SKIPPED
    assert WheelCommand(0.2, 0.2) not in rig.motors.commands


def test_a_deadman_that_does_not_trip_is_not_waited_for_longer_than_an_eye_needs(rig: Rig) -> None:
    rig.motors.tells = rig.motors.trips = False
    times_s: list[float] = []

    async def note() -> None:
        times_s.append(asyncio.get_running_loop().time())

    look(rig, person(rig, {}, {"count the seconds": note, "Did they turn for": note}))
    assert times_s[1] - times_s[0] == pytest.approx(0.5 + 0.25 + 0.15 + WATCH_S)


@pytest.mark.parametrize(("deadman_s", "turns"), [(2.35, True), (2.4, False), (12.7, False)])
def test_wheels_turn_without_commands_for_five_seconds_at_most(rig: Rig, deadman_s: float, turns: bool) -> None:
    rig.motors.tells, rig.motors.deadman_s = False, deadman_s
    finding = look(rig, person(rig, {}))["deadman trips"]
    assert (finding.verdict is CheckVerdict.OK) is turns
    assert (WheelCommand(0.2, 0.2) in rig.motors.commands) is turns
    assert turns or ("deadman of" in finding.found and finding.verdict is CheckVerdict.SKIPPED)


def test_long_deadman_of_a_board_that_tells_is_not_waited_for_either(rig: Rig) -> None:
    rig.motors.deadman_s = 5.0
    assert look(rig, person(rig, {}))["deadman trips"].verdict is CheckVerdict.SKIPPED


@pytest.mark.parametrize(
    ("tells", "deadman_s", "told"), [(True, 0.25, "1.0 s"), (False, 0.25, "3.4 s"), (False, 9.0, "1.0 s")]
)
def test_consent_is_to_wheels_that_turn_for_so_many_seconds(rig: Rig, tells: bool, deadman_s: float, told: str) -> None:
    rig.motors.tells, rig.motors.deadman_s = tells, deadman_s
    someone = person(rig, {})
    look(rig, someone)
    assert f"for up to {told}" in next(text for text in someone.told if "on blocks" in text)


def test_who_counts_knows_what_to_expect(rig: Rig) -> None:
    rig.motors.tells = False
    someone = person(rig, {})
    look(rig, someone)
    assert any("about 0.8 s if all is well, 3.4 s at most" in text for text in someone.told)


# -- the sides -----------------------------------------------------------------------------------------------------


def test_each_side_is_turned_alone_ahead_and_back(rig: Rig) -> None:
    look(rig, person(rig, {}))
    turns = list(dict.fromkeys(rig.motors.commands))
    assert turns[1:5] == [(0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)]


def test_a_reversed_side_names_its_setting(rig: Rig) -> None:
    finding = look(rig, person(rig, {"Did the right wheels turn, only they, and ahead": False}))["right wheels"]
    assert finding.verdict is CheckVerdict.FAIL
    assert "reverse_right under [parts.motors]" in finding.remedy


def test_swapped_sides_name_their_setting(rig: Rig) -> None:
    answers = {"Did the left wheels turn, only they, and ahead": False, "left wheels turn, but back": False}
    finding = look(rig, person(rig, answers))["left wheels"]
    assert finding.found == "the right wheels turned instead"
    assert "change left under [parts.motors]" in finding.remedy


def test_a_side_that_does_not_turn_is_a_matter_of_power_and_wires(rig: Rig) -> None:
    finding = look(rig, person(rig, {"Did the left": False, "Did the right wheels turn instead": False}))["left wheels"]
    assert (finding.verdict, finding.found) == (CheckVerdict.FAIL, "did not turn as told")


def test_a_side_that_turns_one_way_only_fails(rig: Rig) -> None:
    finding = look(rig, person(rig, {"left wheels turn again": False}))["left wheels"]
    assert (finding.verdict, finding.found) == (CheckVerdict.FAIL, "turn ahead, but not back")


# -- the motion sensor ---------------------------------------------------------------------------------------------


def test_a_sensor_that_sees_the_wheels_does_not_notice_being_stuck(rig: Rig) -> None:
    rig.motion.on_blocks = False  # the simulated ground does move
    assert look(rig, person(rig, {}))["notices being stuck"].verdict is CheckVerdict.FAIL


def test_a_blind_sensor_proves_nothing_on_blocks(rig: Rig) -> None:
    rig.motion.quality = 0.0
    assert look(rig, person(rig, {}))["notices being stuck"].verdict is CheckVerdict.SKIPPED


@pytest.mark.parametrize(
    ("ahead", "aside", "verdict", "cause"),
    [
        (1.0, 0.1, CheckVerdict.OK, ""),
        (-1.0, 0.0, CheckVerdict.FAIL, "the other way round"),
        (0.0, 1.0, CheckVerdict.FAIL, "a quarter turn"),
        (0.1, -1.0, CheckVerdict.FAIL, "a quarter turn"),
        (0.2, 0.0, CheckVerdict.FAIL, "hardly pushed"),
    ],
)
def test_a_push_tells_how_the_sensor_is_mounted(
    rig: Rig, ahead: float, aside: float, verdict: CheckVerdict, cause: str
) -> None:
    rig.motion.ahead, rig.motion.aside = ahead, aside
    finding = look(rig, person(rig, {"on blocks": False}))["push"]
    assert finding.verdict is verdict
    assert cause in finding.cause
    assert verdict is CheckVerdict.OK or "[parts.motion]" in finding.remedy
    assert rig.world.most == 0.0


def test_what_moved_before_the_push_does_not_count(rig: Rig) -> None:
    async def roll_back() -> None:
        rig.world.reverse_m += 3.0

    rig.motion.on_blocks = False
    findings = look(rig, person(rig, {"on blocks": False}, {"on blocks": roll_back}))
    assert findings["push"].verdict is CheckVerdict.OK


def test_a_rover_that_was_not_pushed_is_not_judged(rig: Rig) -> None:
    assert look(rig, person(rig, {"push it half a metre": False}))["push"].verdict is CheckVerdict.SKIPPED


def test_a_blind_sensor_fails_the_push() -> None:
    assert judge_push(Push(0.5, 0.0, 0.9)).verdict is CheckVerdict.FAIL


def test_a_rover_without_motion_sensor_has_nothing_to_push(rig: Rig) -> None:
    rig.rover = replace(rig.rover, motion=None)
    findings = look(rig, person(rig, {}))
    assert findings["push"].verdict is findings["notices being stuck"].verdict is CheckVerdict.SKIPPED


# -- the whole -----------------------------------------------------------------------------------------------------


def test_the_command_looks_at_everything_and_closes_every_part(rig: Rig) -> None:
    closed: list[str] = []

    def note(name: str) -> Callable[[], Coroutine[Any, Any, None]]:
        async def close() -> None:
            closed.append(name)

        return close

    for name, part in rig.rover.parts.items():
        part.close = note(name)  # type: ignore[method-assign]
    host = replace(rig.host, devices=("/dev/i2c-1", "/dev/spidev0.1"))
    findings = run(check(rig.config, rig.rover, host, person(rig, {}).ask))
    assert {"/dev/i2c-1", "disk", "compass", "heading at rest", "light", *NAMES} <= {each.name for each in findings}
    assert sorted(closed) == ["compass", "contact", "motion", "motors"]
