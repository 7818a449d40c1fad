"""Each part answers or not, and what each answer means; no wheel turns."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest

from tests.commissioning.checks.rigs import T_WALL, Rig, run
from wayfarer.commissioning.checks import (
    ARMING,
    CheckVerdict,
    Finding,
    Inspection,
    board,
    calibrated,
    parts,
    passed,
    run_checks,
)
from wayfarer.commissioning.checks.standalone import StandaloneInspection
from wayfarer.config.calibration_file import (
    Calibration,
    CompassEntry,
    FlowEntry,
    MotorsEntry,
    TurningEntry,
    TurnResponse,
    save,
    stamp,
)
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.hal import CompassReading, ContactReading, MotorHealth, Side
from wayfarer.safety.gate import SafetySettings
from wayfarer.safety.motor_board import BoardSettings


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    assert rig.world.most == 0.0, "a wheel turned without consent"


def look(rig: Rig, check: Callable[[Inspection], Awaitable[Finding]]) -> Finding:
    async def main() -> Finding:
        async with StandaloneInspection(rig.config, rig.rover, rig.host) as inspection:
            return await check(inspection)

    return run(main())


def with_safety(rig: Rig, **changes: object) -> None:
    rig.config = rig.config.model_copy(update={"safety": replace(SafetySettings(), **changes)})  # type: ignore[arg-type]


def turning_entry(rig: Rig, *from_duties: float | None, duty_max: float = 1.0) -> TurningEntry:
    clockwise, anticlockwise = (
        None if duty is None else TurnResponse(stood_at_duty=0.0, from_duty=duty, deg_s_per_duty=250.0)
        for duty in from_duties
    )
    return TurningEntry(
        **stamp(rig.motors.name, T_WALL), ground="short grass", duty_max=duty_max,
        clockwise=clockwise, anticlockwise=anticlockwise, arc=None, speed=None,
    )  # fmt: skip


def whole_calibration(rig: Rig) -> Calibration:
    return Calibration(
        compass=CompassEntry(**stamp(rig.compass.name, T_WALL), level=3, residual_deg=2.0),
        flow=FlowEntry(**stamp(rig.motion.name, T_WALL), scale=1.1),
        motors=MotorsEntry(**stamp(rig.motors.name, T_WALL), shift_half_deg=1.0, shift_full_deg=3.0, passed=True),
        turning=turning_entry(rig, 0.3, 0.3),
    )


# -- compass, motion, contact, helpers -----------------------------------------------------------------------------


def test_a_compass_that_answers_is_well(rig: Rig) -> None:
    finding = look(rig, parts.compass)
    assert finding.verdict is CheckVerdict.OK
    assert "heading" in finding.found


def test_a_tilted_compass_is_a_warning(rig: Rig) -> None:
    rig.compass.tilt_deg = -90.0
    finding = look(rig, parts.compass)
    assert finding.verdict is CheckVerdict.WARN
    assert "[parts.compass]" in finding.remedy


@pytest.mark.parametrize(
    ("error", "remedy"),
    [
        (NotResponding("no answer"), "`i2cdetect -y 1`"),
        (WrongPart("0x60", "CMPS14", "CMPS12"), "[parts.compass]"),
        (BadReading("bearing 4000"), "shorten"),
    ],
)
def test_a_compass_that_does_not_open_fails_with_the_remedy_for_its_error(
    rig: Rig, error: Exception, remedy: str
) -> None:
    rig.compass.dead, rig.compass.error = True, error
    finding = look(rig, parts.compass)
    assert (finding.verdict, finding.found) == (CheckVerdict.FAIL, str(error))
    assert remedy in finding.remedy


def test_a_silent_motion_sensor_may_be_at_the_other_chip_select(rig: Rig) -> None:
    rig.motion.dead = True
    assert "/dev/spidev0.0" in look(rig, parts.motion).remedy


def test_a_silent_part_on_a_bus_that_is_not_enabled_gives_the_step_that_enables_it(rig: Rig) -> None:
    rig.compass.dead = True
    rig.host = replace(rig.host, devices=("/dev/spidev0.1", "/dev/i2c-1"))
    (rig.host.root / "dev/i2c-1").unlink()
    assert look(rig, parts.compass).remedy == "sudo raspi-config nonint do_i2c 0 && sudo reboot"


def test_a_silent_part_behind_a_forbidden_bus_gives_the_group(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.compass.dead = True
    rig.host = replace(rig.host, devices=("/dev/i2c-1",))
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert "usermod -aG i2c" in look(rig, parts.compass).remedy


def test_no_reading_yet_is_no_answer(rig: Rig) -> None:
    class Daemon(StandaloneInspection):
        async def compass(self) -> CompassReading | None:  # type: ignore[override]
            return None

    async def main() -> Finding:
        return await parts.compass(Daemon(rig.config, rig.rover, rig.host))

    finding = run(main())
    assert finding.verdict is CheckVerdict.FAIL
    assert "no reading yet" in finding.found


def test_the_motion_sensor_must_see_the_ground(rig: Rig) -> None:
    assert look(rig, parts.motion).verdict is CheckVerdict.OK
    rig.motion.quality = 0.1
    assert look(rig, parts.motion).verdict is CheckVerdict.WARN
    rig.motion.dead = True
    assert look(rig, parts.motion).verdict is CheckVerdict.FAIL


@pytest.mark.parametrize(
    ("part", "check", "instead"), [("motion", parts.motion, "contact"), ("contact", parts.contact, "motion")]
)
def test_a_sense_that_is_not_there_is_missed_only_where_obstacles_are_to_be_noticed_by_it(
    rig: Rig,
    part: Literal["motion", "contact"],
    check: Callable[[Inspection], Awaitable[Finding]],
    instead: Literal["motion", "contact"],
) -> None:
    rig.rover = replace(rig.rover, **{part: None})  # type: ignore[arg-type]
    rig.config = rig.config.with_anomaly_source(instead)
    assert look(rig, check).verdict is CheckVerdict.SKIPPED
    rig.config = rig.config.with_anomaly_source(part)
    finding = look(rig, check)
    assert finding.verdict is CheckVerdict.FAIL
    assert finding.remedy == f'add [parts.{part}] or set anomaly_source = "{instead}"'


def test_a_pressed_bumper_is_a_warning(rig: Rig) -> None:
    assert look(rig, parts.contact).verdict is CheckVerdict.OK
    rig.contact.sides = (Side.LEFT, Side.REAR)
    finding = look(rig, parts.contact)
    assert (finding.verdict, finding.found) == (CheckVerdict.WARN, "pressed at left, rear")


def test_a_part_that_can_be_done_without_is_only_a_warning(rig: Rig) -> None:
    assert (
        run(parts.helper("light", StandaloneInspection(rig.config, rig.rover, rig.host))).verdict
        is CheckVerdict.SKIPPED
    )
    rig.rover = replace(rig.rover, light=rig.compass)  # type: ignore[arg-type]  # any part that opens, or not
    assert run(parts.helper("light", StandaloneInspection(rig.config, rig.rover, rig.host))).verdict is CheckVerdict.OK
    rig.compass.dead = True
    assert (
        run(parts.helper("light", StandaloneInspection(rig.config, rig.rover, rig.host))).verdict is CheckVerdict.WARN
    )


def test_a_bumper_that_the_run_does_not_use_does_not_keep_the_rover_from_driving(rig: Rig) -> None:
    class Daemon(StandaloneInspection):
        async def contact(self) -> ContactReading | None:
            return None

    async def main() -> Finding:
        return await parts.contact(Daemon(rig.config, rig.rover, rig.host))

    assert run(main()).verdict is CheckVerdict.SKIPPED


# -- motor board ---------------------------------------------------------------------------------------------------


def test_an_armed_deadman_is_well(rig: Rig) -> None:
    finding = look(rig, board.motor_board)
    assert finding.verdict is CheckVerdict.OK
    assert "0.25 s" in finding.found


@pytest.mark.parametrize(("allowed", "verdict"), [(False, CheckVerdict.FAIL), (True, CheckVerdict.WARN)])
def test_a_board_without_deadman_must_be_allowed(rig: Rig, allowed: bool, verdict: CheckVerdict) -> None:
    rig.motors.deadman_s = None
    with_safety(rig, allow_no_deadman=allowed)
    assert look(rig, board.motor_board).verdict is verdict


def test_a_silent_board_is_one_failure(rig: Rig) -> None:
    rig.motors.dead = True
    assert look(rig, board.motor_board).verdict is CheckVerdict.FAIL
    assert look(rig, board.battery).verdict is CheckVerdict.SKIPPED
    assert look(rig, board.motor_faults).verdict is CheckVerdict.SKIPPED


@pytest.mark.parametrize(
    ("volts", "low_v", "verdict"),
    [
        (11.0, 10.5, CheckVerdict.OK),
        (10.4, 10.5, CheckVerdict.FAIL),
        (3.0, None, CheckVerdict.OK),
        (None, 10.5, CheckVerdict.SKIPPED),
    ],
)
def test_the_battery_is_judged_by_the_rovers_own_limit(
    rig: Rig, volts: float | None, low_v: float | None, verdict: CheckVerdict
) -> None:
    rig.motors.health_now = MotorHealth(volts, ())
    rig.config = rig.config.model_copy(update={"board": BoardSettings(battery_low_v=low_v)})
    assert look(rig, board.battery).verdict is verdict


def test_a_fault_of_the_board_fails(rig: Rig) -> None:
    assert look(rig, board.motor_faults).verdict is CheckVerdict.OK
    rig.motors.health_now = MotorHealth(12.0, ("motor A: drive fault",))
    finding = look(rig, board.motor_faults)
    assert (finding.verdict, finding.found) == (CheckVerdict.FAIL, "motor A: drive fault")


# -- calibration ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("level", "verdict"),
    [(3, CheckVerdict.OK), (2, CheckVerdict.OK), (1, CheckVerdict.FAIL), (None, CheckVerdict.SKIPPED)],
)
def test_the_compass_must_be_calibrated_to_the_level_asked_for(
    rig: Rig, level: int | None, verdict: CheckVerdict
) -> None:
    rig.compass.level = level
    assert look(rig, calibrated.compass_level).verdict is verdict


def test_a_heading_that_swings_at_rest_fails(rig: Rig) -> None:
    with_safety(rig, settle_spread_deg=6.0)
    assert look(rig, calibrated.heading_at_rest).verdict is CheckVerdict.OK
    swing_deg = iter(range(0, 1000, 3))
    rig.compass.bias_deg = lambda: float(next(swing_deg))
    finding = look(rig, calibrated.heading_at_rest)
    assert finding.verdict is CheckVerdict.FAIL
    assert "keys" in finding.remedy


@pytest.mark.parametrize("kind", ["compass", "flow", "motors", "turning"])
def test_each_entry_of_the_calibration_file_must_be_there_sound_and_of_this_part(rig: Rig, kind: str) -> None:
    def finding() -> Finding:
        return run(calibrated.calibrated(kind, StandaloneInspection(rig.config, rig.rover, rig.host)))

    path, whole = rig.host.calibration_file, whole_calibration(rig)
    assert finding().verdict is (CheckVerdict.SKIPPED if kind == "turning" else CheckVerdict.WARN)
    save(path, whole)
    assert finding().verdict is CheckVerdict.OK
    save(path, replace(whole, **{kind: replace(getattr(whole, kind), part="another part")}))
    assert (finding().verdict, "another part" in finding().found) == (CheckVerdict.FAIL, True)
    save(path, replace(whole, **{kind: replace(getattr(whole, kind), t_wall=T_WALL - 200 * 86_400.0)}))
    assert finding().verdict is CheckVerdict.WARN
    path.write_text("{", encoding="utf-8")
    assert (finding().verdict, str(path) in finding().found) == (CheckVerdict.FAIL, True)


def test_motors_that_turn_the_heading_keep_the_rover_from_driving(rig: Rig) -> None:
    entry = MotorsEntry(**stamp(rig.motors.name, T_WALL), shift_half_deg=4.0, shift_full_deg=17.0, passed=False)
    save(rig.host.calibration_file, Calibration(motors=entry))
    finding = run(calibrated.calibrated("motors", StandaloneInspection(rig.config, rig.rover, rig.host)))
    assert (finding.verdict, "17°" in finding.found) == (CheckVerdict.FAIL, True)


def test_a_compass_with_a_large_residual_is_a_warning(rig: Rig) -> None:
    entry = CompassEntry(**stamp(rig.compass.name, T_WALL), level=3, residual_deg=12.0)
    save(rig.host.calibration_file, Calibration(compass=entry))
    finding = run(calibrated.calibrated("compass", StandaloneInspection(rig.config, rig.rover, rig.host)))
    assert finding.verdict is CheckVerdict.WARN


def test_turning_that_was_never_measured_is_a_note_with_the_command(rig: Rig) -> None:
    finding = run(calibrated.calibrated("turning", StandaloneInspection(rig.config, rig.rover, rig.host)))
    assert (finding.verdict, "wayfarer calibrate turning" in finding.found) == (CheckVerdict.SKIPPED, True)


@pytest.mark.parametrize(
    ("from_duties", "duty_max", "verdict"),
    [
        ((0.0, 0.0), 1.0, CheckVerdict.OK),
        ((0.79, 0.79), 1.0, CheckVerdict.OK),
        ((0.81, 0.81), 1.0, CheckVerdict.WARN),
        ((0.45, 0.45), 0.5, CheckVerdict.WARN),
        ((None, 0.3), 1.0, CheckVerdict.WARN),
        ((None, None), 1.0, CheckVerdict.WARN),
    ],
)
def test_rover_that_hardly_turns_on_the_spot_is_a_warning_with_what_to_do(
    rig: Rig, from_duties: tuple[float | None, ...], duty_max: float, verdict: CheckVerdict
) -> None:
    turning = turning_entry(rig, *from_duties, duty_max=duty_max)
    save(rig.host.calibration_file, Calibration(turning=turning))
    finding = run(calibrated.calibrated("turning", StandaloneInspection(rig.config, rig.rover, rig.host)))
    assert finding.verdict is verdict
    if verdict is CheckVerdict.WARN:
        assert "on short grass" in finding.found
        assert "lighter" in finding.remedy


def test_rover_that_hardly_begins_to_turn_is_a_warning_although_it_goes_on_easily(rig: Rig) -> None:
    easy = TurnResponse(stood_at_duty=0.0, from_duty=0.2, deg_s_per_duty=250.0)
    turning = replace(turning_entry(rig, 0.2, 0.2), anticlockwise=replace(easy, stood_at_duty=0.85))
    save(rig.host.calibration_file, Calibration(turning=turning))
    finding = run(calibrated.calibrated("turning", StandaloneInspection(rig.config, rig.rover, rig.host)))
    assert (finding.verdict, "0.85" in finding.found) == (CheckVerdict.WARN, True)


# -- together ------------------------------------------------------------------------------------------------------


def test_a_healthy_rover_may_be_armed_within_a_second(rig: Rig) -> None:
    save(rig.host.calibration_file, whole_calibration(rig))

    async def main() -> tuple[list[Finding], float]:
        inspection = StandaloneInspection(rig.config, rig.rover, rig.host)
        findings = await run_checks(inspection, ARMING)
        return findings, asyncio.get_running_loop().time()

    findings, took_s = run(main())
    assert passed(findings)
    assert {each.name for each in findings if each.verdict is not CheckVerdict.OK} == {
        "computer power",
        "deadman proved",
    }
    assert took_s < 1.0
    assert len({finding.name for finding in findings}) == len(ARMING)


def test_every_failure_says_why_and_what_to_do_in_one_line(rig: Rig) -> None:
    rig.compass.dead = rig.motors.dead = rig.motion.dead = True
    rig.host = replace(rig.host, t_wall=0.0)

    async def main() -> list[Finding]:
        return await run_checks(StandaloneInspection(rig.config, rig.rover, rig.host), ARMING)

    findings = run(main())
    assert not passed(findings)
    for finding in findings:
        troubled = finding.verdict in (CheckVerdict.FAIL, CheckVerdict.WARN)
        assert bool(finding.cause) is bool(finding.remedy) is troubled, finding
        assert all("\n" not in text for text in finding)
