"""What people ask for and what fails, in any order: the replay is exact, or goes up to a tick that did not end."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import replace as with_fields
from pathlib import Path
from random import Random

import pytest

from tests.fieldlog.test_replay import SIM, Trouble, records, ticks
from tests.kit.workshop import Overriding
from tests.virtual import asked, virtual
from wayfarer.control.supervisor import Supervisor
from wayfarer.errors import DriverError, NotArmed
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.replay import replay
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import MotorHealth, Rover, WheelCommand
from wayfarer.run_sim import simulated_rover_setup
from wayfarer.safety.manual import ManualSample
from wayfarer.simhal.world.physics import Depth

RUN_S = 60.0
ROVER = SIM.model_copy(update={"safety": with_fields(SIM.safety, start_delay_s=0.5)})
REQUESTS = ("arm", "arm", "arm", "resume", "resume", "hold", "disarm", "goal", "drive", "drive")
TROUBLES = ("motors", "power", "hangs", "hangs", "board", "fault", "disagrees", "compass", "nonsense", "flags")


class ShortTrouble(Trouble):
    """A rover whose motors may also find no memory."""

    def __init__(self, rover: Rover) -> None:
        super().__init__(rover)
        really = self.rover.motors.drive

        async def drive(command: WheelCommand) -> WheelCommand:
            if "memory" in self.failing:
                raise MemoryError
            return await really(command)

        self.rover = with_fields(self.rover, motors=Overriding(self.rover.motors, drive=drive))


async def happen(trouble: Trouble, what: str, for_s: float) -> None:
    """Let something fail for a while."""
    match what:
        case "hangs":
            trouble.drives_s = for_s
            await asyncio.sleep(0.06)  # only one command hangs
            trouble.drives_s = 0.02
        case "fault":
            trouble.health = MotorHealth(12.0, ("motor A: drive fault",))
            await asyncio.sleep(for_s)
            trouble.health = None
        case "disagrees":
            trouble.duties = WheelCommand(0.9, -0.9)
            await asyncio.sleep(for_s)
            trouble.duties = None
        case _:
            failing = {"motors", "power"} if what == "power" else {what}
            trouble.failing |= failing
            await asyncio.sleep(for_s)
            trouble.failing -= failing


async def ask(run: Supervisor, what: str, rng: Random) -> None:
    """Do what people ask for; what is refused is not done."""
    now, controller = asyncio.get_running_loop().time, run.controller
    with suppress(NotArmed, DriverError):
        match what:
            case "arm":
                await run.arm(asked(), rng.choice((None, 20.0)))
            case "resume":
                run.resume(asked())
            case "hold":
                run.hold()
            case "disarm":
                run.disarm("asked for")
            case "goal":
                controller.set_goal(now(), rng.uniform(0.0, 359.0))
            case "drive":
                await run.begin_manual(asked(), 7, "keys")
                for seq in range(rng.randrange(40)):
                    controller.manual.take(
                        now(), ManualSample(seq, rng.choice((0.0, 0.5)) if seq > 3 else 0.0, 0.1, now())
                    )
                    await asyncio.sleep(rng.choice((0.07, 0.3)))
                run.end_manual("asked for")


@virtual
async def any_order(folder: Path, seed: int, *, loses: bool) -> None:
    """Let everything happen at random times; if the run ``loses`` a tick, one that waits for a board that failed."""
    rng, now = Random(seed), asyncio.get_running_loop().time
    setup = simulated_rover_setup(ROVER, Depth.DEVICE, seed, lambda reason, text: run.finish(reason, text))
    about = {
        "algorithm": "pledge",
        "algorithm_seed": seed,
        "ladder_seed": seed,
        "config": ROVER.model_dump(mode="json"),
        "parts": dict.fromkeys(setup.rover.parts, ""),
    }
    log = FieldLog(Sink(folder), about, wall=lambda t_s: t_s, t_s=now())
    handler = CATALOGUE["pledge"].make(ROVER.escape, ROVER.vehicle, Random(seed))
    trouble = ShortTrouble(setup.rover)
    run = Supervisor(trouble.rover, ROVER, CATALOGUE["pledge"], handler, log, ladder_seed=seed, goes_on=True)
    running = asyncio.create_task(run.run())
    await asyncio.sleep(1.0)
    tasks = {asyncio.create_task(ask(run, "arm", rng))}
    while now() < RUN_S:
        await asyncio.sleep(rng.uniform(0.0, 1.0))
        if rng.random() < 0.5:
            tasks.add(asyncio.create_task(ask(run, rng.choice(REQUESTS), rng)))
        elif (what := rng.choice(TROUBLES)) == "flags":
            run.inbox.put_power(now(), rng.choice((0x0, 0x50005)))
        else:
            tasks.add(asyncio.create_task(happen(trouble, what, rng.choice((0.06, 0.3, 3.0)))))
        if loses and now() > 0.7 * RUN_S and run.controller.waits_for_motors:
            loses = False
            await happen(trouble, "memory", 0.06)
    run.finish("requested", "enough")
    for task in tasks:
        task.cancel()
    await asyncio.wait([running, *tasks])


@pytest.mark.parametrize("seed", range(10))
def test_replay_is_exact(seed: int, tmp_path: Path) -> None:
    run = tmp_path / "run"
    any_order(run, seed, loses=seed % 2 == 1)
    lost = [record["n"] for record in records(run) if record.get("lost") == "tick"]
    found, ended = replay(run), [tick for tick in ticks(run) if not lost or tick["n"] < lost[0]]
    assert found.difference is None
    assert found.ticks == len(ended)
    assert bool(lost) == (found.cut_elapsed_s is not None)
