"""What the checks before arming look at: the latest values of the sensor tasks."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path

import pytest

from tests.daemon.played import Run, played
from tests.kit.rover import Rig
from tests.virtual import asked, virtual
from wayfarer.commissioning.checks import CheckVerdict, run_checks
from wayfarer.commissioning.checks.parts import contact
from wayfarer.daemon.arming_check import FRESH_S
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import NotResponding
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, Side


@played
async def test_inspection_gives_what_the_sensor_tasks_read_last(run: Run) -> None:
    now_s = asyncio.get_running_loop().time()
    inspection = run.inspect()
    compass, motion = await inspection.read("compass"), await inspection.read("motion")
    assert now_s - compass.t_s < 0.1
    assert now_s - motion.t_s < 0.2


@played
async def test_compass_that_fell_silent_is_stale_and_keeps_the_rover_from_arming(run: Run) -> None:
    run.rig.compass.dead = True
    await asyncio.sleep(FRESH_S / 2)
    assert (await run.inspect().read("compass")).calibration == 3, "half a second is no silence yet"
    await asyncio.sleep(FRESH_S)
    with pytest.raises(NotResponding, match="compass has said nothing for 1 s"):
        await run.inspect().read("compass")
    with pytest.raises(RequestRefused, match="compass has said nothing"):
        await run.commands.arm(asked())
    assert run.mode == "disarmed"


@played
async def test_motion_sensor_that_fell_silent_lets_no_rover_drive(run: Run) -> None:
    run.rig.motion.dead = True
    await asyncio.sleep(5.0)
    with suppress(RequestRefused):
        await run.commands.arm(asked(), 0.0)
    for _ in range(200):
        await asyncio.sleep(0.1)
        assert run.mode != "armed"
        assert run.wheels == STOP
    assert run.mode == "disarmed"


@virtual
async def test_inspection_before_the_first_tick_says_to_wait(tmp_path: Path) -> None:
    with pytest.raises(NotResponding, match="still being opened"):
        await Run(Rig(tmp_path)).inspect().read("compass")


@played
async def test_bumper_that_no_decision_uses_is_not_asked(run: Run) -> None:
    (finding,) = await run_checks(run.inspect(), [contact])
    assert finding.verdict is CheckVerdict.SKIPPED


@virtual
async def test_bumper_that_the_algorithm_uses_is_read(tmp_path: Path) -> None:
    async with Run(Rig(tmp_path), next(name for name, each in CATALOGUE.items() if "contact" in each.requires)) as run:
        run.rig.contact.sides = (Side.FRONT,)
        await asyncio.sleep(0.1)
        assert (await run.inspect().read("contact")).sides == (Side.FRONT,)
