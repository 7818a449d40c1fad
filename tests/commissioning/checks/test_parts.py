"""Each part answers or not, and what each answer means; no wheel turns."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import pytest

from tests.kit.rover import T_WALL, Rig
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import (
    ARMING,
    Check,
    CheckVerdict,
    Finding,
    calibrated,
    parts,
    passed,
    run_checks,
)
from wayfarer.config.calibration_file import (
    Calibration,
    CompassEntry,
    FlowEntry,
    MotorsEntry,
    save,
    stamp,
)
from wayfarer.drivers.gpsd import Fixes
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.hal import MotorHealth, NoFix, PositionFix, Side
from wayfarer.simhal.parts import SimWheels

OK, WARN, FAIL, SKIPPED = CheckVerdict.OK, CheckVerdict.WARN, CheckVerdict.FAIL, CheckVerdict.SKIPPED


@pytest.fixture(autouse=True)
def no_wheel_turns(rig: Rig) -> Iterator[None]:
    yield
    assert rig.world.most == 0.0, "a wheel turned without consent"


def whole_calibration(rig: Rig) -> Calibration:
    return Calibration(
        compass=CompassEntry(**stamp(rig.compass.name, T_WALL), level=3, residual_deg=2.0),
        flow=FlowEntry(**stamp(rig.motion.name, T_WALL), scale=1.1),
        motors=MotorsEntry(**stamp(rig.motors.name, T_WALL), shift_half_deg=1.0, shift_full_deg=3.0, passed=True),
    )


# -- parts and motor board -----------------------------------------------------------------------------------------


def gone(error: Exception) -> dict[str, Any]:
    return {"compass": {"dead": True, "error": error}}


def health(volts: float | None, *faults: str) -> dict[str, Any]:
    return {"motors": {"health_now": MotorHealth(volts, faults)}}


@pytest.mark.parametrize(
    ("check", "state", "verdict", "told"),
    [
        (parts.compass, {}, OK, "heading 1°"),
        (parts.compass, {"compass": {"tilt_deg": -90.0}}, WARN, "[parts.compass]"),
        (parts.compass, gone(NotResponding("no answer")), FAIL, "`i2cdetect -y 1`"),
        (parts.compass, gone(WrongPart("0x60", "CMPS14", "CMPS12")), FAIL, "[parts.compass]"),
        (parts.compass, gone(BadReading("bearing 4000")), FAIL, "shorten"),
        (parts.motion, {}, OK, "quality 0.80 of 1"),
        (parts.motion, {"motion": {"quality": 0.1}}, WARN, "clean the lens"),
        (parts.motion, {"motion": {"dead": True}}, FAIL, "/dev/spidev0.0"),  # it may be at the other chip select
        (parts.contact, {}, OK, "nothing is pressed"),
        (parts.contact, {"contact": {"sides": (Side.LEFT, Side.REAR)}}, WARN, "pressed at left, rear"),
        (parts.motor_board, {}, OK, "0.25 s"),
        (parts.motor_board, {"motors": {"deadman_s": None}}, FAIL, "allow_no_deadman"),
        (parts.motor_board, {"motors": {"deadman_s": None}, "safety": {"allow_no_deadman": True}}, WARN, "allows it"),
        (parts.motor_board, {"motors": {"dead": True}}, FAIL, "no answer"),
        (parts.battery, {"motors": {"dead": True}}, SKIPPED, "does not answer"),  # one failure is enough
        (parts.motor_faults, {"motors": {"dead": True}}, SKIPPED, "does not answer"),
        (parts.battery, health(11.0) | {"board": {"battery_low_v": 10.5}}, OK, "11.0 V, the limit is 10.5 V"),
        (parts.battery, health(10.4) | {"board": {"battery_low_v": 10.5}}, FAIL, "charge it"),
        (parts.battery, health(3.0), OK, "not judged"),
        (parts.battery, health(None) | {"board": {"battery_low_v": 10.5}}, SKIPPED, "does not measure it"),
        (parts.motor_faults, {}, OK, "none"),
        (parts.motor_faults, health(12.0, "motor A: drive fault"), FAIL, "motor A: drive fault"),
        (calibrated.compass_level, {"compass": {"level": 3}}, OK, "level 3 of 3"),
        (calibrated.compass_level, {"compass": {"level": 2}}, OK, "level 2 of 3"),
        (calibrated.compass_level, {"compass": {"level": 1}}, FAIL, "at least 2 is needed"),
        (calibrated.compass_level, {"compass": {"level": None}}, SKIPPED, "does not report it"),
        (calibrated.compass_level, {"compass": {"dead": True}}, SKIPPED, "does not answer"),
        (calibrated.heading_at_rest, {"compass": {"dead": True}}, SKIPPED, "does not answer"),
    ],
)
def test_state_of_a_part_and_what_is_found(
    rig: Rig, check: Check, state: dict[str, dict[str, Any]], verdict: CheckVerdict, told: str
) -> None:
    for name, changes in state.items():
        if name in {"safety", "board"}:
            rig.set(**{name: changes})
            continue
        for key, value in changes.items():
            setattr(getattr(rig, name), key, value)
    finding = rig.look(check)
    assert finding.verdict is verdict
    assert told in f"{finding.text}; {finding.remedy}"


def test_silent_part_on_a_bus_that_cannot_be_used_gives_the_step_that_helps(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.compass.dead = True
    rig.host = replace(rig.host, devices=("/dev/spidev0.1", "/dev/i2c-1"))
    with monkeypatch.context() as forbidden:
        forbidden.setattr(os, "access", lambda path, mode: False)
        assert "usermod -aG i2c" in rig.look(parts.compass).remedy
    (rig.host.root / "dev/i2c-1").unlink()
    assert rig.look(parts.compass).remedy == "sudo raspi-config nonint do_i2c 0 && sudo reboot"


@pytest.mark.parametrize(
    ("part", "check", "instead"), [("motion", parts.motion, "contact"), ("contact", parts.contact, "motion")]
)
def test_a_sense_that_is_not_there_is_missed_only_where_obstacles_are_to_be_noticed_by_it(
    rig: Rig, part: Literal["motion", "contact"], check: Check, instead: Literal["motion", "contact"]
) -> None:
    rig.rover = replace(rig.rover, **{part: None})  # type: ignore[arg-type]
    rig.config = rig.config.with_anomaly_source(instead)
    assert rig.look(check).verdict is SKIPPED
    rig.config = rig.config.with_anomaly_source(part)
    finding = rig.look(check)
    assert finding.verdict is FAIL
    assert finding.remedy == f'add [parts.{part}] or set anomaly_source = "{instead}"'


def test_sensor_of_the_wheels_says_what_it_measures(rig: Rig) -> None:
    assert rig.look(parts.wheels).verdict is SKIPPED
    for sensor, measures in (
        (SimWheels(rig.world), "the way of the rims and current"),
        (SimWheels(rig.world, current=False), "the way of the rims"),
        (SimWheels(rig.world, way=False), "current"),
        (SimWheels(rig.world, way=False, current=False), "nothing now"),
    ):
        rig.rover = replace(rig.rover, wheels=sensor)
        finding = rig.look(parts.wheels)
        assert (finding.verdict, finding.text) == (OK, f"answers; it measures {measures}")
    rig.compass.dead = True
    rig.rover = replace(rig.rover, wheels=rig.compass)  # type: ignore[arg-type]  # any part that does not answer
    assert rig.look(parts.wheels).verdict is FAIL


@pytest.mark.parametrize(
    ("source", "sensor", "told"),
    [
        ("wheels", None, 'the rover file has no [parts.wheels], and anomaly_source is "wheels"'),
        ("wheels", {"way": False}, 'answers, and measures current, but anomaly_source names "wheels"'),
        (
            "current",
            {"current": False},
            'answers, and measures the way of the rims, but anomaly_source names "current"',
        ),
        ("motion", {"way": False}, None),
        ("wheels+current", {}, None),
    ],
)
def test_wheels_that_are_to_notice_stalls_must_be_measured(
    rig: Rig, source: str, sensor: dict[str, bool] | None, told: str | None
) -> None:
    rig.config = rig.config.with_anomaly_source(source)
    rig.rover = replace(rig.rover, wheels=None if sensor is None else SimWheels(rig.world, **sensor))
    finding = rig.look(parts.wheels)
    assert (finding.verdict, finding.text) == (FAIL, told) if told else finding.verdict is OK


@pytest.mark.parametrize("source", ["wheels", "current", "yaw", "wheels+current+yaw"])
def test_owner_of_a_rover_without_a_motion_sensor_is_told_what_nobody_sees(rig: Rig, source: str) -> None:
    rig.config = rig.config.with_anomaly_source(source)
    finding = rig.look(parts.motion)
    assert finding.verdict is WARN
    assert "wheels that spin on mud or leaves look like driving; it turns away after 3 m instead" in finding.text
    rig.config = rig.config.with_anomaly_source(f"motion+{source}")
    assert rig.look(parts.motion).verdict is OK


def test_a_part_that_can_be_done_without_is_only_a_warning(rig: Rig) -> None:
    assert [rig.look(check).verdict for check in (parts.light, parts.position)] == [SKIPPED, SKIPPED]
    rig.rover = replace(rig.rover, light=rig.compass)  # type: ignore[arg-type]  # any part that opens, or not
    assert rig.look(parts.light).verdict is OK
    rig.compass.dead = True
    rig.rover = replace(rig.rover, position=rig.compass)  # type: ignore[arg-type]
    assert [rig.look(check).verdict for check in (parts.light, parts.position)] == [WARN, WARN]


class ScriptedReceiver:
    """gpsd, as far as its lines go: ``reports`` come every second, each of one receiver."""

    name = "gpsd at 127.0.0.1:2947"

    def __init__(self, *reports: dict[str, Any]) -> None:
        self._reports, self._fixes = reports, Fixes(3.0)
        self._lines = 0

    async def open(self) -> None: ...

    async def close(self) -> None: ...

    async def read(self) -> PositionFix | None:
        now_s = asyncio.get_running_loop().time()
        while self._reports and self._lines <= now_s:
            for report in self._reports:
                line = {"class": "TPV", "time": f"2025-07-20T12:00:{self._lines:02d}.000Z"} | report
                self._fixes.take(json.dumps(line).encode(), now_s)
            self._lines += 1
        return self._fixes.latest(now_s)

    def why_no_fix(self) -> NoFix:
        return self._fixes.why_none()


FIX = {"device": "/dev/ttyACM0", "mode": 3, "lat": 51.5, "lon": -0.1, "eph": 17.1}
SEARCHES = {"device": "/dev/ttyUSB0", "mode": 1}
TIMELESS = {"device": "/dev/ttyUSB1", "mode": 3, "lat": 51.5, "lon": -0.1, "time": None}
HUNG = {"device": "/dev/ttyUSB2", "mode": 3, "lat": 51.5, "lon": -0.1, "time": "2025-07-20T11:00:00.000Z"}


@pytest.mark.parametrize(
    ("reports", "verdict", "found", "remedy"),
    [
        ([FIX], OK, "a fix, off by 17 m at most", ""),
        ([HUNG, SEARCHES, TIMELESS, FIX], OK, "a fix, off by 17 m at most", ""),
        ([FIX | {"eph": None}], OK, "a fix", ""),
        ([SEARCHES], WARN, "/dev/ttyUSB0 has no fix", "outdoors"),
        ([TIMELESS], WARN, "/dev/ttyUSB1 sends a position without a time", "RMC"),
        ([HUNG], WARN, "/dev/ttyUSB2 has sent nothing new", "restart gpsd"),
        ([HUNG, SEARCHES], WARN, "/dev/ttyUSB2 has sent nothing new, /dev/ttyUSB0 has no fix", "outdoors"),
        ([], WARN, "no receiver sends anything", "DEVICES"),
    ],
)
def test_fix_no_fix_and_no_time_of_each_receiver_are_told_apart(
    rig: Rig, reports: list[dict[str, Any]], verdict: CheckVerdict, found: str, remedy: str
) -> None:
    rig.rover = replace(rig.rover, position=ScriptedReceiver(*reports))
    finding = rig.look(parts.position)
    assert (finding.verdict, finding.text.partition("; ")[0]) == (verdict, f"gpsd at 127.0.0.1:2947: {found}")
    assert ("; likely " in finding.text) is (verdict is WARN)
    assert remedy in finding.remedy


# -- calibration ---------------------------------------------------------------------------------------------------


def test_a_heading_that_swings_at_rest_fails(rig: Rig) -> None:
    rig.set(safety={"settle_spread_deg": 6.0})
    assert rig.look(calibrated.heading_at_rest).verdict is OK
    swing_deg = iter(range(0, 1000, 3))
    rig.compass.bias_deg = lambda: float(next(swing_deg))
    finding = rig.look(calibrated.heading_at_rest)
    assert (finding.verdict, "keys" in finding.remedy) == (FAIL, True)


@pytest.mark.parametrize("kind", ["compass", "flow", "motors"])
def test_each_entry_of_the_calibration_file_must_be_there_sound_and_of_this_part(rig: Rig, kind: str) -> None:
    def found(**changes: Any) -> Finding:
        save(path, replace(whole, **{kind: replace(getattr(whole, kind), **changes)}))
        return rig.look(look)

    path, whole, look = rig.host.calibration_file, whole_calibration(rig), partial(calibrated.calibrated, kind)
    assert (rig.look(look).verdict, "wayfarer calibrate" in str(rig.look(look))) == (WARN, True)
    assert found().verdict is OK
    other = found(part="another part")
    assert (other.verdict, "another part" in other.text) == (FAIL, True)
    assert found(t_wall=T_WALL - 200 * 86_400.0).verdict is WARN


def test_entry_of_a_part_that_is_silent_or_not_there_is_not_judged(rig: Rig) -> None:
    save(rig.host.calibration_file, whole_calibration(rig))
    rig.compass.dead = True
    assert rig.look(partial(calibrated.calibrated, "compass")).verdict is SKIPPED
    rig.rover = replace(rig.rover, motion=None)
    assert rig.look(partial(calibrated.calibrated, "flow")).verdict is SKIPPED


def test_quarter_turns_that_were_wrong_are_told(rig: Rig) -> None:
    rig.keep(compass=CompassEntry(**stamp(rig.compass.name, T_WALL), level=3, residual_deg=12.0))
    compass = rig.look(partial(calibrated.calibrated, "compass"))
    assert (compass.verdict, "12°" in compass.text) == (WARN, True)


# -- together ------------------------------------------------------------------------------------------------------


def test_a_healthy_rover_may_be_armed_within_a_second(rig: Rig) -> None:
    save(rig.host.calibration_file, whole_calibration(rig))

    async def main() -> tuple[list[Finding], float]:
        return await run_checks(rig.inspection(), ARMING), asyncio.get_running_loop().time()

    findings, took_s = run_virtually(main())
    assert passed(findings)
    assert {each.name for each in findings if each.verdict is not OK} == {
        "computer power", "card", "deadman proved", "wheels",
    }  # fmt: skip
    assert took_s < 1.0
    assert len({finding.name for finding in findings}) == len(ARMING)


def test_every_failure_says_why_and_what_to_do_in_one_line(rig: Rig) -> None:
    rig.compass.dead = rig.motors.dead = rig.motion.dead = True
    rig.host = replace(rig.host, t_wall=0.0)
    findings = run_virtually(run_checks(rig.inspection(), ARMING))
    assert not passed(findings)
    for finding in findings:
        troubled = finding.verdict in (FAIL, WARN)
        assert bool(finding.remedy) is troubled, finding
        assert all("\n" not in text for text in finding)
