"""Checks with motion: nothing turns without consent, everything stops whatever happens, mistakes name the setting."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import replace
from typing import Any

import pytest

from tests.kit.rover import Rig, Script, push_by_hand
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CheckVerdict, Finding, Inspection, check
from wayfarer.commissioning.checks.api import ok
from wayfarer.commissioning.checks.deadman import WATCH_S
from wayfarer.commissioning.checks.motion import check_motion, judge_push
from wayfarer.commissioning.manual_drive import Push
from wayfarer.errors import NotResponding
from wayfarer.hal import WheelCommand, WheelReading
from wayfarer.simhal.parts import SimWheels

OK, FAIL, SKIPPED = CheckVerdict.OK, CheckVerdict.FAIL, CheckVerdict.SKIPPED
NAMES = ["deadman trips", "left wheels", "right wheels", "notices being stuck", "push"]


@pytest.fixture
def rig(rig: Rig) -> Rig:
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
        async with rig.inspection() as inspection:
            return await check_motion(inspection, someone.ask)

    findings = run_virtually(main())
    assert rig.world.commanded == (0.0, 0.0)
    assert [finding.name for finding in findings] == NAMES
    return {finding.name: finding for finding in findings}


def test_all_is_well_with_a_healthy_rover(rig: Rig) -> None:
    findings = look(rig, person(rig, {}))
    assert {finding.verdict for finding in findings.values()} == {OK}
    assert 0.0 < rig.world.most <= 0.5


def test_no_check_turns_the_wheels_faster_than_the_rover_may(rig: Rig) -> None:
    rig.set(safety={"duty_max": 0.3})
    findings = look(rig, person(rig, {}))
    assert {finding.verdict for finding in findings.values()} == {OK}
    assert rig.world.most == pytest.approx(0.3, abs=0.01)
    assert {round(max(map(abs, command)), 3) for command in rig.motors.commands if any(command)} == {0.2, 0.25, 0.3}


# -- consent -------------------------------------------------------------------------------------------------------


def test_without_a_person_no_wheel_turns_and_every_check_says_why(rig: Rig) -> None:
    findings = run_virtually(check(rig.config, rig.rover, rig.host, rig.kept, ask=None))
    assert rig.world.most == 0.0
    assert rig.motors.commands == []
    motion = [finding for finding in findings if finding.name in NAMES]
    assert [finding.verdict for finding in motion] == [SKIPPED] * 5
    assert all("it needs a person" in finding.text for finding in motion)


def test_what_is_known_of_the_motors_pins_is_told_as_a_warning(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def told() -> list[Finding]:
        findings = run_virtually(check(rig.config, rig.rover, rig.host, rig.kept, ask=None))
        return [finding for finding in findings if finding.name == "motor pins"]

    assert told() == []
    monkeypatch.setattr(rig.motors, "note", "wheels may turn at boot", raising=False)
    assert [finding[1:3] for finding in told()] == [(CheckVerdict.WARN, "wheels may turn at boot")]


@pytest.mark.parametrize(("dead", "asked"), [(False, True), (True, False)])
def test_without_a_yes_or_an_answer_of_the_board_no_wheel_turns(rig: Rig, dead: bool, asked: bool) -> None:
    rig.motors.dead = dead
    someone = person(rig, {"on blocks": False})
    findings = look(rig, someone)
    assert rig.world.most == 0.0
    assert rig.motors.commands == []
    assert [findings[name].verdict for name in NAMES[:4]] == [SKIPPED] * 4
    assert any("blocks" in text for text in someone.told) is asked


# -- stopping ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [1, 5, 12, 25, 35, 45, 55, 60])
def test_a_board_that_fails_in_the_middle_is_stopped_and_turns_no_wheel_again(rig: Rig, at: int) -> None:
    rig.motors.fails_at = at
    findings = look(rig, person(rig, {}))
    verdicts = [findings[name].verdict for name in NAMES[:4]]
    broken = verdicts.index(FAIL)
    assert set(verdicts[:broken]) <= {OK}
    assert set(verdicts[broken + 1 :]) <= {SKIPPED}
    assert len(rig.motors.commands) == at


@pytest.mark.parametrize("at", [1, 12, 25, 60])
def test_any_other_error_stops_the_wheels_as_well(rig: Rig, at: int) -> None:
    rig.motors.fails_at, rig.motors.error = at, ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        look(rig, person(rig, {}))
    assert rig.world.commanded == (0.0, 0.0)


@pytest.mark.parametrize("after_s", [0.1, 0.6, 0.95, 1.3, 2.1, 3.2])
def test_a_cancellation_stops_the_wheels(rig: Rig, after_s: float) -> None:
    rig.cancel(check_motion(rig.inspection(), person(rig, {}).ask), after_s)
    assert rig.world.most > 0.0


def test_an_impatient_second_cancellation_does_not_cut_the_stop_short(rig: Rig) -> None:
    rig.motors.stop_takes_s = 1.0  # as over a bus that hangs
    rig.cancel(check_motion(rig.inspection(), person(rig, {}).ask), 0.3, 0.01)
    assert rig.world.most > 0.0


def test_an_inspection_opens_each_part_once(rig: Rig) -> None:
    opened: list[float] = []
    open_board = rig.motors.open

    async def count() -> None:
        opened.append(asyncio.get_running_loop().time())
        await open_board()

    rig.motors.open = count  # type: ignore[method-assign]
    run_virtually(check(rig.config, rig.rover, rig.host, rig.kept, person(rig, {}).ask))
    assert len(opened) == 1


def test_leaving_an_inspection_stops_the_wheels(rig: Rig) -> None:
    async def leave(inspection: Inspection) -> Finding:
        await inspection.open("motors")
        await rig.motors.drive(WheelCommand(0.1, 0.1))
        return ok("left", "")

    rig.look(leave)


def test_a_motion_sensor_that_fails_stops_the_wheels(rig: Rig) -> None:
    rig.motion.dead = True
    findings = look(rig, person(rig, {}))
    assert findings["notices being stuck"].verdict is FAIL
    assert findings["push"].verdict is FAIL


# -- the deadman ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("board", "answers", "verdict", "told"),
    [
        ({"trips": False}, {}, FAIL, "0.4 s of silence"),
        ({"deadman_s": None}, {}, SKIPPED, "has none"),
        ({"tells": False}, {"Did they turn for": True}, OK, "were seen to stop"),
        ({"tells": False}, {"Did they turn for": False}, FAIL, "did not stop"),
        ({"tells": False}, {"count the seconds": False}, SKIPPED, "nobody watched"),
        ({"tells": False, "deadman_s": 2.35}, {}, OK, "were seen to stop"),  # 5 s of silence at most
        ({"tells": False, "deadman_s": 2.4}, {}, SKIPPED, "a deadman of 2.4 s"),
        ({"deadman_s": 5.0}, {}, SKIPPED, "a deadman of 5 s"),
    ],
)
def test_deadman_is_asked_for_or_watched_and_wheels_turn_for_it_only_where_somebody_can_tell(
    rig: Rig, board: dict[str, Any], answers: dict[str, bool], verdict: CheckVerdict, told: str
) -> None:
    for key, value in board.items():
        setattr(rig.motors, key, value)
    finding = look(rig, person(rig, answers))["deadman trips"]
    assert (finding.verdict, told in finding.text) == (verdict, True)
    assert (WheelCommand(0.2, 0.2) in rig.motors.commands) is (verdict is not SKIPPED)


def test_wheels_that_never_started_prove_no_deadman(rig: Rig) -> None:
    async def nothing(command: WheelCommand) -> WheelCommand:
        return command

    rig.motors.drive = nothing  # type: ignore[method-assign]
    finding = look(rig, person(rig, {}))["deadman trips"]
    assert (finding.verdict, finding.text) == (FAIL, "the wheels did not start; likely no motor power")


def test_a_deadman_that_does_not_trip_is_not_waited_for_longer_than_an_eye_needs(rig: Rig) -> None:
    rig.motors.tells = rig.motors.trips = False
    times_s: list[float] = []

    async def note() -> None:
        times_s.append(asyncio.get_running_loop().time())

    look(rig, person(rig, {}, {"count the seconds": note, "Did they turn for": note}))
    assert times_s[1] - times_s[0] == pytest.approx(0.5 + 0.25 + 0.15 + WATCH_S)


@pytest.mark.parametrize(
    ("tells", "deadman_s", "told"), [(True, 0.25, "1.0 s"), (False, 0.25, "3.4 s"), (False, 9.0, "1.0 s")]
)
def test_person_is_told_for_how_long_the_wheels_may_turn(rig: Rig, tells: bool, deadman_s: float, told: str) -> None:
    rig.motors.tells, rig.motors.deadman_s = tells, deadman_s
    someone = person(rig, {})
    look(rig, someone)
    said = "; ".join(someone.told)
    assert f"for up to {told}" in said
    assert ("about 0.8 s if all is well, 3.4 s at most" in said) is (told == "3.4 s")
    assert ("about 0.8 s, and not for 3.4 s" in said) is (told == "3.4 s")


# -- the sides -----------------------------------------------------------------------------------------------------


def test_each_side_is_turned_alone_ahead_and_back(rig: Rig) -> None:
    look(rig, person(rig, {}))
    turns = list(dict.fromkeys(rig.motors.commands))
    assert turns[1:5] == [(0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)]


class Wired(SimWheels):
    """Wheels whose encoders are wired as a test says."""

    wired: Callable[[float, float], tuple[float | None, float | None]]

    async def read(self) -> WheelReading:
        reading = await super().read()
        left_m, right_m = self.wired(reading.left_m or 0.0, reading.right_m or 0.0)
        return reading._replace(left_m=left_m, right_m=right_m)


@pytest.mark.parametrize(
    ("wired", "found", "remedy"),
    [
        (lambda left, right: (left, right), None, ""),
        (lambda *_: (None, None), None, ""),
        (lambda _, right: (0.0, right), "their encoder counted nothing; a loose wire", "check the encoder's wires"),
        (lambda left, right: (right, left), "the right encoder counted; left and right are swapped", "change left"),
        (lambda left, right: (-left, right), "their encoder counted down", "change reverse_left under [parts.wheels]"),
    ],
)
def test_encoder_that_is_wired_otherwise_than_the_file_says_names_the_setting(
    rig: Rig, wired: Any, found: str | None, remedy: str
) -> None:
    rig.rover = replace(rig.rover, wheels=(wheels := Wired(rig.world)))
    wheels.wired = wired
    finding = look(rig, person(rig, {}))["left wheels"]
    assert finding.verdict is (FAIL if found else OK)
    assert (found or "turn forwards and backwards") in finding.text
    assert remedy in finding.remedy


def test_wheels_sensor_that_does_not_answer_hides_nothing_of_the_motors(rig: Rig) -> None:
    rig.rover = replace(rig.rover, wheels=(wheels := Wired(rig.world)))

    def gone(*_: float) -> tuple[float, float]:
        raise NotResponding("encoders: not there")

    wheels.wired = gone
    assert look(rig, person(rig, {}))["left wheels"].verdict is OK


@pytest.mark.parametrize(
    ("answers", "side", "found", "remedy"),
    [
        (
            {"Did the right wheels turn, only they, and forwards": False},
            "right", "turn backwards instead of forwards", "change reverse_right under [parts.motors]",
        ),
        (
            {"Did the left wheels turn, only they, and forwards": False, "left wheels turn, but backwards": False},
            "left", "the right wheels turned instead", "change left under [parts.motors]",
        ),
        (
            {"Did the left": False, "Did the right wheels turn instead": False},
            "left", "did not turn as commanded", "the motor's two wires",
        ),
        ({"left wheels turn again": False}, "left", "turn forwards, but not backwards", "swap the plugs"),
    ],
)  # fmt: skip
def test_what_was_seen_of_a_side_names_the_setting_or_the_wires(
    rig: Rig, answers: dict[str, bool], side: str, found: str, remedy: str
) -> None:
    findings = look(rig, person(rig, answers))
    finding, other = findings[f"{side} wheels"], findings["right wheels" if side == "left" else "left wheels"]
    assert (finding.verdict, finding.text.partition("; ")[0], other.verdict) == (FAIL, found, OK)
    assert remedy in finding.remedy


# -- the motion sensor ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("on_blocks", "quality", "verdict"), [(False, 0.8, FAIL), (True, 0.0, SKIPPED)])
def test_a_sensor_that_sees_the_wheels_or_nothing_does_not_notice_being_stuck(
    rig: Rig, on_blocks: bool, quality: float, verdict: CheckVerdict
) -> None:
    rig.motion.on_blocks, rig.motion.quality = on_blocks, quality
    assert look(rig, person(rig, {}))["notices being stuck"].verdict is verdict


@pytest.mark.parametrize(
    ("ahead", "aside", "verdict", "cause"),
    [
        (1.0, 0.1, OK, ""),
        (-1.0, 0.0, FAIL, "the other way round"),
        (0.0, 1.0, FAIL, "a quarter turn"),
        (0.1, -1.0, FAIL, "a quarter turn"),
        (0.2, 0.0, FAIL, "hardly pushed"),
    ],
)
def test_a_push_tells_how_the_sensor_is_mounted(
    rig: Rig, ahead: float, aside: float, verdict: CheckVerdict, cause: str
) -> None:
    rig.motion.ahead, rig.motion.aside = ahead, aside
    finding = look(rig, person(rig, {"on blocks": False}))["push"]
    assert finding.verdict is verdict
    assert cause in finding.text
    assert verdict is OK or "[parts.motion]" in finding.remedy
    assert rig.world.most == 0.0


def test_what_moved_before_the_push_does_not_count(rig: Rig) -> None:
    async def roll_back() -> None:
        rig.world.reverse_m += 3.0

    rig.motion.on_blocks = False
    findings = look(rig, person(rig, {"on blocks": False}, {"on blocks": roll_back}))
    assert findings["push"].verdict is OK


def test_a_rover_that_was_not_pushed_is_not_judged(rig: Rig) -> None:
    assert look(rig, person(rig, {"push it half a metre": False}))["push"].verdict is SKIPPED


def test_a_blind_sensor_fails_the_push() -> None:
    assert judge_push(Push(0.5, 0.0, 0.9)).verdict is FAIL


def test_a_rover_without_motion_sensor_has_nothing_to_push(rig: Rig) -> None:
    rig.rover = replace(rig.rover, motion=None)
    findings = look(rig, person(rig, {}))
    assert findings["push"].verdict is findings["notices being stuck"].verdict is SKIPPED


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
    findings = run_virtually(check(rig.config, rig.rover, host, rig.kept, person(rig, {}).ask))
    assert {"/dev/i2c-1", "disk", "compass", "heading at rest", "light", *NAMES} <= {each.name for each in findings}
    assert sorted(closed) == ["compass", "contact", "motion", "motors"]
