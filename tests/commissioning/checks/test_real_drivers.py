"""The same checks and the same calibration over the real drivers and register-accurate chips."""

from __future__ import annotations

import asyncio
import re
from math import inf
from pathlib import Path
from typing import Any

import pytest

from tests.kit.boards import now_s
from tests.kit.rover import ChipRig, Script
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CheckVerdict, Finding, parts, run_checks
from wayfarer.drivers.bno055 import BNO055, BNO055Settings
from wayfarer.drivers.roboclaw import RoboClaw, RoboClawSettings
from wayfarer.drivers.sabertooth import SabertoothSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import Rover, WheelCommand
from wayfarer.simhal.chips.bno055 import BNO055Chip
from wayfarer.simhal.chips.motor_boards import ThunderBorgChip
from wayfarer.simhal.chips.roboclaw import RoboClawChip
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import HeadingSensorModel

either = pytest.mark.parametrize(("acts", "verdict"), [(True, CheckVerdict.OK), (False, CheckVerdict.FAIL)])


class Forgetful(dict[int, int]):
    """The settings of a board that takes none."""

    def __setitem__(self, command: int, data: int) -> None:
        pass


@pytest.fixture
def rig(tmp_path: Path) -> ChipRig:
    return ChipRig(tmp_path)


@either
def test_a_thunderborg_is_asked_whether_its_failsafe_tripped(
    rig: ChipRig, monkeypatch: pytest.MonkeyPatch, acts: bool, verdict: CheckVerdict
) -> None:
    someone = Script(rig.world, {})
    if not acts:
        monkeypatch.setattr(ThunderBorgChip, "stops_by_s", inf)
    assert rig.look(someone.watch_the_deadman).verdict is verdict
    assert rig.world.most > 0.0
    assert someone.told == []


@either
def test_a_sabertooth_is_watched_and_does_as_its_timeout_says(rig: ChipRig, acts: bool, verdict: CheckVerdict) -> None:
    if not acts:
        rig.sabertooth.settings = Forgetful()
    rig.drive_by_sabertooth(SabertoothSettings())
    answers: dict[str, bool] = {}
    was_m: list[float] = []

    async def begin() -> None:
        was_m.append(rig.world.path_m)

    async def see() -> None:
        rig.world.advance_to(asyncio.get_running_loop().time())
        longest_m = 0.2 * 1.4 * 2.0  # what it would drive in two seconds
        answers["Did they turn"] = rig.world.path_m - was_m[0] < longest_m

    someone = Script(rig.world, answers, {"count the seconds": begin, "Did they turn": see})
    assert rig.look(someone.watch_the_deadman).verdict is verdict


def test_real_parts_answer_their_checks_and_a_fault_of_the_last_mission_is_found(rig: ChipRig) -> None:
    async def look() -> tuple[list[Finding], Finding]:
        well = await run_checks(rig.inspection(), [parts.motor_board, parts.battery, parts.motor_faults, parts.compass])
        await rig.rover.motors.drive(WheelCommand(0.3, 0.3))
        await rig.rover.motors.stop()
        rig.thunderborg.drive_faults.add(0)
        return well, await parts.motor_faults(rig.inspection())

    well, fault = run_virtually(look())
    assert {finding.verdict for finding in well} == {CheckVerdict.OK}, well
    assert fault.verdict is CheckVerdict.FAIL


# -- a RoboClaw --------------------------------------------------------------------------------------------------------


@pytest.fixture
def claw(rig: ChipRig) -> RoboClawChip:
    """The board that the rig drives by."""
    chip = RoboClawChip(rig.world, now_s)
    rig.buses.serial("/dev/serial0").attach(chip)
    rig.drive_by(RoboClaw(RoboClawSettings(), rig.buses))
    return chip


@either
@pytest.mark.parametrize("fed", [True, False])
def test_a_roboclaw_is_asked_whether_its_timeout_tripped(
    rig: ChipRig, claw: RoboClawChip, monkeypatch: pytest.MonkeyPatch, fed: bool, acts: bool, verdict: CheckVerdict
) -> None:
    claw.fed_by_requests = fed
    someone = Script(rig.world, {})
    if not acts:
        monkeypatch.setattr(RoboClawChip, "stops_by_s", inf)
    assert rig.look(someone.watch_the_deadman).verdict is verdict
    assert rig.world.most > 0.0
    assert someone.told == []


def test_a_healthy_roboclaw_passes_and_its_emergency_stop_is_a_sentence(rig: ChipRig, claw: RoboClawChip) -> None:
    looks = [parts.motor_board, parts.battery, parts.motor_faults]
    well = run_virtually(run_checks(rig.inspection(), looks))
    assert {finding.verdict for finding in well} == {CheckVerdict.OK}, well
    claw.status = 1
    pressed = rig.look(parts.motor_faults)
    assert pressed.verdict is CheckVerdict.FAIL
    assert pressed.text.startswith("emergency stop: release it")


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        pytest.param(lambda *_: b"", "nothing came); battery off, another address or baud rate", id="absent"),
        pytest.param(lambda _, data: data[:-1], "is not a complete answer; noise", id="slow"),
        pytest.param(lambda *_: b"$GPGGA,0,0\0ok", "expected RoboClaw, got no answer from one", id="wrong"),
        pytest.param(lambda *_: bytes(range(255, 200, -1)), "expected RoboClaw, got no answer from one", id="garbage"),
    ],
)
def test_what_is_wrong_with_a_roboclaw_is_one_line_with_a_remedy(
    rig: ChipRig, claw: RoboClawChip, monkeypatch: pytest.MonkeyPatch, answer: Any, text: str
) -> None:
    receive = claw.receive
    monkeypatch.setattr(claw, "receive", lambda data: answer(data, receive(data)))
    found = rig.look(parts.motor_board)
    assert (found.verdict, "\n" in found.text) == (CheckVerdict.FAIL, False)
    assert text in found.text
    assert found.remedy


def test_a_roboclaw_that_acknowledges_and_does_nothing_fails_when_it_is_to_turn(
    rig: ChipRig, claw: RoboClawChip, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(claw, "_turn", lambda *_: None)
    found = rig.look(Script(rig.world, {}).watch_the_deadman)
    assert (found.verdict, found.text[:27]) == (CheckVerdict.FAIL, "the wheels did not start; l")


# -- a BNO055: what a person reads on each of its lines --------------------------------------------------------------


class Torn(BNO055Chip):
    """Answers come shifted by a byte."""

    def _read(self, register: int, count: int) -> bytes:
        return super()._read(register, count)[1:] + b"\xff"


class Another(BNO055Chip):
    """Another part at its address."""

    def _read(self, register: int, count: int) -> bytes:
        return bytes(count)


class Frozen(BNO055Chip):
    """Its sensors measure nothing new."""

    frozen = True

    def _measure(self, *, is_asked: bool) -> None:
        pass


class Slow(BNO055Chip):
    """Takes longer than a driver waits."""

    def receive(self, data: bytes) -> bytes:
        return b""

    def read(self, count: int) -> bytes:
        raise NotResponding("/dev/i2c-1: a transfer did not end within 0.1 s; a device holds the bus")


AGAIN = "turn its power off and on"
ON_I2C = "on I2C, where a Raspberry Pi up to 4 may read it wrongly; its UART avoids that"
ON_UART = "FAIL BNO055 on /dev/serial0: no answer"


@pytest.mark.parametrize(
    ("chip", "port", "said"),
    [
        (BNO055Chip, "", rf"OK heading \d+°, pitch -?\d°, roll -?\d°; {ON_I2C}"),
        (BNO055Chip, "/dev/serial0", r"OK heading \d+°, pitch -?\d°, roll -?\d°"),
        (None, "", "FAIL BNO055 at 0x28 on /dev/i2c-1: no answer .*: check its four wires .*`i2cdetect -y 1`.*"),
        (None, "/dev/serial0", f"{ON_UART} .*nothing came.* PS1 was high .*: check its plug.*"),
        (
            Another,
            "",
            "FAIL .*expected the identities a0 fb 32 0f of a BNO055, got 00 00 00 00.*: correct .parts.comp.*",
        ),
        (Torn, "/dev/serial0", "FAIL .*expected the identities .*, got fb 32 0f ff.*: correct .parts.compass.*"),
        (Frozen, "", f"FAIL BNO055 at 0x28 on /dev/i2c-1: its sensors send nothing new, .*: {AGAIN}"),
        (Frozen, "/dev/serial0", f"FAIL BNO055 on /dev/serial0: its sensors send nothing new, .*: {AGAIN}"),
        (Slow, "", "FAIL .*a transfer did not end within 0.1 s; a device holds the bus.*"),
        (Slow, "/dev/serial0", f"{ON_UART} .*no complete answer within 0.05 s, nothing came.*"),
    ],
)
def test_bno055_that_is_absent_another_frozen_garbled_or_slow_is_one_line_with_its_remedy(
    rig: ChipRig, chip: type[BNO055Chip] | None, port: str, said: str
) -> None:
    if chip is not None:
        there = chip(HeadingSensorModel(rig.world, RandomStreams(0)), now_s)
        if port:
            rig.buses.serial(port).attach(there)
        else:
            rig.buses.i2c("/dev/i2c-1").attach(0x28, there)
    rig.rover = Rover(BNO055(BNO055Settings(port=port), rig.buses), rig.rover.motors)
    found = rig.look(parts.compass)
    assert re.fullmatch(said, f"{found.verdict.name} {found.text}" + (f": {found.remedy}" if found.remedy else ""))
