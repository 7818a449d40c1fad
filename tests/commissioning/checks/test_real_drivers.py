"""The same checks and the same calibration over the real drivers and register-accurate chips."""

from __future__ import annotations

import asyncio
from math import inf
from pathlib import Path

import pytest

from tests.kit.rover import ChipRig, Script
from tests.virtual import run_virtually
from wayfarer.commissioning.checks import CheckVerdict, Finding, parts, run_checks
from wayfarer.drivers.sabertooth import SabertoothSettings
from wayfarer.hal import WheelCommand
from wayfarer.simhal.chips.motor_boards import ThunderBorgChip

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
