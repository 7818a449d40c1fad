"""Arming over the control socket: what is checked first, what refuses it, and what ends it."""

from __future__ import annotations

import asyncio
import dataclasses
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.daemon.played import ABOUT, DELAY_S, Run, played
from tests.kit.rover import T_WALL, Rig
from tests.virtual import asked, virtual
from wayfarer.commissioning.checks import ARMING
from wayfarer.commissioning.checks.deadman import keep_proof
from wayfarer.config import calibration_file
from wayfarer.config.calibration_file import Calibration, MotorsEntry, stamp
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.errors import NotResponding, WayfarerError
from wayfarer.hal import STOP, MotorHealth, WheelCommand
from wayfarer.safety.settings import ManualSettings
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.motor_boards import ThunderBorgChip


@played
async def test_rover_starts_disarmed_and_drives_after_arming_and_the_delay(run: Run) -> None:
    assert run.mode == "disarmed"
    reply = await run.commands.arm(asked(), 90.0)
    assert (reply["mode"], reply["start_delay_s"]) == ("arming", DELAY_S)
    await asyncio.sleep(DELAY_S - 0.2)
    assert run.wheels == STOP
    await asyncio.sleep(0.5)
    assert run.mode == "armed"
    assert run.supervisor.controller.goal_heading_deg == 90.0
    assert run.wheels != STOP


@played
async def test_warnings_of_the_checks_are_told_and_keep_no_rover_from_arming(run: Run) -> None:
    warnings = str((await run.commands.arm(asked()))["warnings"])
    assert "calibrated compass" in warnings
    assert "wayfarer calibrate" in warnings


@pytest.mark.parametrize("armed", [False, True], ids=["arming", "armed"])
@played
async def test_arming_twice_is_refused_and_changes_nothing(run: Run, armed: bool) -> None:
    await run.commands.arm(asked(), 0.0)
    if armed:
        await asyncio.sleep(DELAY_S + 1.0)
    mode = run.mode
    with pytest.raises(RequestRefused, match=f"{mode} already: disarm it first"):
        await run.commands.arm(asked(), 180.0)
    assert run.mode == mode
    assert run.supervisor.controller.goal_heading_deg == 0.0


@played
async def test_only_one_of_two_who_arm_at_once_is_heard(run: Run) -> None:
    opened = asyncio.Event()
    run.rig.motors.open = opened.wait  # type: ignore[assignment, method-assign]
    first = asyncio.create_task(run.commands.arm(asked(), 0.0))
    await asyncio.sleep(0.01)
    with pytest.raises(RequestRefused, match="being checked"):
        await run.commands.arm(asked(), 180.0)
    opened.set()
    assert (await first)["mode"] == "arming"


@virtual
async def test_arming_right_after_the_start_waits_until_the_parts_are_open(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    opens = rig.compass.open

    async def open_slowly() -> None:
        await asyncio.sleep(1.0)
        await opens()

    rig.compass.open = open_slowly  # type: ignore[method-assign]

    async with Run(rig, after_s=0.0) as run:
        assert (await run.commands.arm(asked(), 0.0))["mode"] == "arming"
        await asyncio.sleep(DELAY_S + 1.0)
        assert run.wheels != STOP


@virtual
async def test_arming_while_parts_take_too_long_to_open_is_refused_and_says_so(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.compass.open = lambda: asyncio.sleep(4.0)  # type: ignore[method-assign]

    async with Run(rig, after_s=0.0) as run:
        with pytest.raises(RequestRefused, match="still being opened: try again in some seconds"):
            await run.commands.arm(asked(), 0.0)


class ThunderBorgRig(Rig):
    """A rover whose motor board is a ThunderBorg, through its real driver."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        buses = FakeBuses()
        self.chip = ThunderBorgChip(self.world, lambda: asyncio.get_running_loop().time(), full_level=255)
        buses.i2c("/dev/i2c-1").attach(0x15, self.chip)
        self.motors = ThunderBorg(ThunderBorgSettings(), buses)  # type: ignore[assignment]
        self.rover = dataclasses.replace(self.rover, motors=self.motors)


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("driving", [False, True], ids=["standing", "driving"])
@virtual
async def test_first_arming_after_the_board_lost_its_power_is_not_refused(
    tmp_path: Path, after_s: float, driving: bool
) -> None:
    rig = ThunderBorgRig(tmp_path)

    async with Run(rig) as run:
        if driving:
            await run.arm()
        rig.chip.power_cycle()
        if driving:
            await asyncio.sleep(0.1)
            assert (run.mode, run.wheels) == ("armed", STOP)
            assert "lost its power" in str(run.log.named("motors_failed"))
            await run.commands.disarm()
        await asyncio.sleep(after_s)
        await run.arm()
        assert rig.chip.failsafe


MOTORS = "board at 0x15 on /dev/i2c-1"
SHIFTED = MotorsEntry(**stamp(MOTORS, T_WALL), shift_half_deg=4.0, shift_full_deg=17.0, passed=False)


@pytest.mark.parametrize(
    ("part", "state", "text"),
    [
        (
            "motors",
            {"health_now": MotorHealth(12.0, ("motor A: drive fault",))},
            "motor faults: .*switch it off and on",
        ),
        ("motors", {"deadman_s": None}, "cannot stop the wheels by itself"),
        ("motors", {"dead": True}, f"{MOTORS}: no answer"),
        ("compass", {"level": 1}, "compass calibration: level 1 of 3, at least 2 is needed"),
        ("calibration", {"motors": SHIFTED}, "calibrated motors: motor current shifts the heading by 17°"),
    ],
)
@played
async def test_arming_is_refused_with_what_a_check_found_and_what_to_do(
    run: Run, part: str, state: dict[str, Any], text: str
) -> None:
    """Fault catalogue, fault 12, and others."""
    if part == "calibration":
        run.calibration = Calibration(**state)
    else:
        vars(getattr(run.rig, part)).update(state)
    await asyncio.sleep(0.1)
    with pytest.raises(RequestRefused, match=f"not armed: .*{text}"):
        await run.commands.arm(asked())
    assert run.mode == "disarmed"
    assert run.log.named("arming_refused")
    await asyncio.sleep(DELAY_S + 1.0)
    assert run.wheels == STOP


@pytest.mark.parametrize("because", ["", "nobody may come near it"])
@virtual
async def test_board_that_cannot_be_asked_is_armed_with_a_proof_or_a_reason_that_is_told(
    tmp_path: Path, because: str
) -> None:
    rig = Rig(tmp_path)
    rig.motors.tells = False
    rig.set(safety={"deadman_unproved_because": because})

    async with Run(rig) as run:
        if not because:
            with pytest.raises(RequestRefused, match=r"deadman proved: nobody has seen board at 0x15 .*wayfarer check"):
                await run.commands.arm(asked(), 0.0)
            assert run.log.named("arming_refused") == [{"failed": ["deadman proved"]}]
            keep_proof(run.inspect(), tripped=True)
            run.calibration = rig.kept  # as another daemon would find it
        warnings: Any = (await run.commands.arm(asked(), 0.0))["warnings"]
        told = [warning for warning in warnings if warning.startswith("deadman proved")]
        assert len(told) == bool(because)
        assert all(because in warning for warning in told)


@played
async def test_rover_that_lies_on_its_roof_is_refused_at_once_and_told_what_to_do(run: Run) -> None:
    """Today's fault, not a memory of one: set upright, it is armed."""

    run.rig.compass.tilt_deg = 170.0
    await asyncio.sleep(1.0)
    with pytest.raises(RequestRefused, match=r"not armed: overturned: .*put it on its wheels"):
        await run.commands.arm(asked(), 0.0)
    assert run.mode == "disarmed"
    assert run.log.named("arming_refused") == [{"failed": ["overturned"]}]
    assert not run.log.named("arming")
    run.rig.compass.tilt_deg = 0.0
    await asyncio.sleep(1.0)
    await run.arm()


@played
async def test_board_that_turns_the_wheels_by_itself_is_refused_at_once(run: Run) -> None:
    async def astray() -> WheelCommand:
        return WheelCommand(0.3, 0.3)

    run.rig.motors.read_back = astray  # type: ignore[method-assign]
    await asyncio.sleep(2.5)  # sim.toml asks the board once a second
    with pytest.raises(RequestRefused, match=r"board disagrees: .*no other program commands it"):
        await run.commands.arm(asked(), 0.0)
    assert not run.log.named("arming")


@played
async def test_arming_reads_no_calibration_file(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A card that hangs would hang the event loop, and with it a stop."""
    reads: list[Path] = []
    monkeypatch.setattr(calibration_file, "read_regular", lambda path, _: reads.append(path))
    assert (await run.commands.arm(asked(), 0.0))["mode"] == "arming"
    assert reads == []


@pytest.mark.parametrize("checked", [True, False], ids=["checked", "unchecked"])
@pytest.mark.parametrize("verb", ["arm", "manual_begin"])
@played
async def test_board_is_opened_once_at_each_start_and_one_that_fails_refuses_it(
    run: Run, verb: str, checked: bool
) -> None:
    answers, opened = [None, NotResponding("board: no answer")], 0

    async def open_once() -> None:
        nonlocal opened
        opened += 1
        if (failed := answers.pop(0)) is not None:
            raise failed

    run.rig.motors.open = open_once  # type: ignore[method-assign]
    checks = ARMING if checked else ()
    commands = RoverCommands(run.supervisor, run.rig.motors, run.inspect, run.log, ABOUT, checks)
    run.supervisor.controller.manual.settings = ManualSettings(allowed=True)
    start = partial(commands.arm, heading_deg=0.0) if verb == "arm" else partial(commands.manual_begin, driver="page")
    await start(asked())
    assert (opened, run.mode) == (1, "arming" if verb == "arm" else "manual")
    await commands.disarm()
    await asyncio.sleep(0.1)
    told = r"motor board: board: no answer; likely .* \(check its" if checked else "board: no answer"
    with pytest.raises(RequestRefused, match=f"not armed: {told}"):
        await start(asked())
    assert (opened, run.mode) == (2, "disarmed")


@played
async def test_board_that_is_asked_and_falls_silent_after_it_was_opened_refuses_arming(run: Run) -> None:
    async def silent() -> WheelCommand:
        raise NotResponding("board: no answer")

    run.rig.motors.read_back = silent  # type: ignore[method-assign]
    with pytest.raises(RequestRefused, match="not armed: motor board: "):
        await run.commands.arm(asked())
    assert run.mode == "disarmed"


@pytest.mark.parametrize("verb", ["disarm", "hold", "stop"])
@played
async def test_whatever_stops_the_wheels_while_the_checks_run_ends_the_arming(run: Run, verb: str) -> None:
    opened = asyncio.Event()
    run.rig.motors.open = opened.wait  # type: ignore[assignment, method-assign]
    arming = asyncio.create_task(run.commands.arm(asked(), 0.0))
    await asyncio.sleep(0.01)
    with suppress(RequestRefused):
        await getattr(run.commands, verb)()
    opened.set()
    with pytest.raises(WayfarerError, match=r"stopped, or started, after this was asked|the run is ending"):
        await arming
    await asyncio.sleep(DELAY_S + 1.0)
    assert run.wheels == STOP
