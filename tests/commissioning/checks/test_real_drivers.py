"""The same checks and the same calibration over the real drivers and register-accurate chips."""

from __future__ import annotations

import asyncio
from math import degrees, inf, pi
from pathlib import Path

import pytest

from tests.commissioning.checks.rigs import Rig, Script, WatchedWorld, run
from wayfarer.commissioning.calibrate import calibrate
from wayfarer.commissioning.calibrate.compass import OFF
from wayfarer.commissioning.checks import Check, CheckVerdict, Finding, Inspection, board, parts, run_checks
from wayfarer.commissioning.checks.motion import deadman_trips
from wayfarer.commissioning.checks.standalone import StandaloneInspection
from wayfarer.commissioning.checks.system import device_files
from wayfarer.drivers.cmps14 import CMPS14, CMPS14Settings
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.hal import DriveMotors, Rover, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.cmps14 import CALIBRATED, CMPS14Chip
from wayfarer.simhal.chips.sabertooth import SabertoothChip
from wayfarer.simhal.chips.thunderborg import ThunderBorgChip
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import HeadingSensorModel


def now_s() -> float:
    """The time on the loop, and zero before it runs: chips are soldered in before that."""
    try:
        return asyncio.get_running_loop().time()
    except RuntimeError:
        return 0.0


class Bench:
    """A compass and both motor boards on fake buses; a rover is made with either board."""

    def __init__(self, folder: Path) -> None:
        self.world = WatchedWorld()
        self.buses = FakeBuses()
        self.compass = CMPS14Chip(HeadingSensorModel(self.world, RandomStreams(0)), now_s)
        self.thunderborg = ThunderBorgChip(self.world, now_s)
        self.sabertooth = SabertoothChip(self.world, now_s)
        self.buses.i2c("/dev/i2c-1").attach(0x60, self.compass)
        self.buses.i2c("/dev/i2c-1").attach(0x15, self.thunderborg)
        self.buses.serial("/dev/serial0").chip = self.sabertooth
        rig = Rig(folder)
        self.config, self.host = rig.config, rig.host

    def inspect(self, motors: DriveMotors) -> StandaloneInspection:
        rover = Rover(CMPS14(CMPS14Settings(), self.buses), motors)
        return StandaloneInspection(self.config, rover, self.host)

    def run(self, check: Check, motors: DriveMotors) -> Finding:
        async def main() -> Finding:
            async with self.inspect(motors) as inspection:
                await inspection.open("motors")
                return await check(inspection)

        finding = run(main())
        assert self.world.commanded == (0.0, 0.0)
        return finding


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@pytest.mark.parametrize(("acts", "verdict"), [(True, CheckVerdict.OK), (False, CheckVerdict.FAIL)])
def test_a_thunderborg_is_asked_whether_its_failsafe_tripped(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, acts: bool, verdict: CheckVerdict
) -> None:
    someone = Script(bench.world, {})
    if not acts:
        monkeypatch.setattr(ThunderBorgChip, "stops_by_s", inf)

    async def trips(inspection: Inspection) -> Finding:
        return await deadman_trips(someone.ask, inspection)

    assert bench.run(trips, ThunderBorg(ThunderBorgSettings(), bench.buses)).verdict is verdict
    assert bench.world.most > 0.0
    assert someone.told == []


@pytest.mark.parametrize(("acts", "verdict"), [(True, CheckVerdict.OK), (False, CheckVerdict.FAIL)])
def test_a_sabertooth_is_watched_and_does_as_its_timeout_says(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, acts: bool, verdict: CheckVerdict
) -> None:
    if not acts:
        monkeypatch.setattr(SabertoothChip, "stops_by_s", inf)
    motors = Sabertooth(SabertoothSettings(), bench.buses)
    answers: dict[str, bool] = {}
    was_m: list[float] = []

    async def begin() -> None:
        was_m.append(bench.world.path_m)

    async def see() -> None:
        bench.world.advance_to(asyncio.get_running_loop().time())
        longest_m = 0.2 * 1.4 * 2.0  # what it would drive in two seconds
        answers["Did they turn"] = bench.world.path_m - was_m[0] < longest_m

    someone = Script(bench.world, answers, {"count the seconds": begin, "Did they turn": see})

    async def trips(inspection: Inspection) -> Finding:
        return await deadman_trips(someone.ask, inspection)

    assert bench.run(trips, motors).verdict is verdict


def test_real_parts_answer_their_checks(bench: Bench) -> None:
    async def look(inspection: Inspection) -> list[Finding]:
        return await run_checks(inspection, [board.motor_board, board.battery, board.motor_faults, parts.compass])

    findings = run(look(bench.inspect(ThunderBorg(ThunderBorgSettings(), bench.buses))))
    assert {finding.verdict for finding in findings} == {CheckVerdict.OK}, findings
    assert bench.world.most == 0.0


def test_a_fault_of_the_last_mission_is_found_before_the_next(bench: Bench) -> None:
    motors = ThunderBorg(ThunderBorgSettings(), bench.buses)

    async def look() -> list[Finding]:
        await motors.open()
        await motors.drive(WheelCommand(0.3, 0.3))
        await motors.stop()
        bench.thunderborg.drive_faults.add(0)
        return await run_checks(bench.inspect(motors), [board.motor_board, board.motor_faults])

    assert [finding.verdict for finding in run(look())] == [CheckVerdict.OK, CheckVerdict.FAIL]


def test_a_compass_that_is_not_there_is_named_with_its_bus(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rover = Rover(CMPS14(CMPS14Settings(address=0x61), FakeBuses()), rig.motors)
    finding = run(parts.compass(StandaloneInspection(rig.config, rover, rig.host)))
    assert finding.verdict is CheckVerdict.FAIL
    assert "0x61 on /dev/i2c-1" in finding.found
    assert "i2cdetect" in finding.remedy


def test_a_real_compass_is_taught_by_its_own_commands(bench: Bench) -> None:
    """The levels rise five seconds after turning began; the profile is kept, and learning is off."""
    inspection = bench.inspect(ThunderBorg(ThunderBorgSettings(), bench.buses))

    async def turn() -> None:
        bench.world.heading_rad += pi / 2

    someone = Script(bench.world, {}, {"Turn it to the right": turn})

    async def main() -> None:
        bench.compass.calibration = bench.compass.profile = 0
        asyncio.get_running_loop().call_later(5.0, setattr, bench.compass, "calibration", CALIBRATED)
        found = await calibrate(bench.config, inspection.rover, bench.host, someone, ["compass"])
        assert found.compass is not None
        assert found.compass.residual_deg < 2.0
        assert found.compass.part.startswith("CMPS14")

    run(main())
    assert (bench.compass.config, bench.compass.profile, bench.compass.ignored) == (OFF, CALIBRATED, [])


def test_a_real_board_and_compass_measure_how_the_rover_turns(bench: Bench) -> None:
    rover = bench.inspect(ThunderBorg(ThunderBorgSettings(), bench.buses)).rover
    found = run(calibrate(bench.config, rover, bench.host, Script(bench.world, {}), ["turning"])).turning
    assert found is not None
    assert found.part.startswith("ThunderBorg")
    assert found.on_the_spot is not None
    assert found.on_the_spot.from_duty < 0.02
    assert found.on_the_spot.deg_s_per_duty == pytest.approx(degrees(2.0 * 1.4 / 0.5), rel=0.02)
    assert bench.world.commanded == (0.0, 0.0)


def test_the_device_files_of_real_settings_are_found() -> None:
    settings = (CMPS14Settings(), ThunderBorgSettings(), SabertoothSettings())
    assert device_files(settings) == ("/dev/i2c-1", "/dev/serial0")
