"""What people ask for and what fails, at any await: after a stop the wheels are stopped until somebody asks again."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from random import Random

import pytest

from tests.kit.workshop import Motors, Workshop, supervisor
from tests.virtual import asked, run_virtually
from wayfarer.control.supervisor import Supervisor
from wayfarer.errors import NotArmed, NotResponding
from wayfarer.hal import STOP, WheelCommand

SEEDS = 200
RUN_S = 4.0


class SlowMotors(Motors):
    """A board that takes its time, and applies a command at its end, whatever was asked for meanwhile."""

    def __init__(self, shop: Workshop, rng: Random) -> None:
        super().__init__(shop, "motors")
        self._rng = rng

    async def drive(self, command: WheelCommand) -> WheelCommand:
        await asyncio.sleep(self._rng.uniform(0.0, 0.06))
        return await super().drive(command)

    async def open(self) -> None:
        await asyncio.sleep(self._rng.uniform(0.0, 0.1))
        await super().open()


async def ask(run: Supervisor, what: str, shop: Workshop) -> None:
    if what == "breaks":
        shop.broken["motors.drive"] = NotResponding("motors: no answer")
    elif what == "mends":
        shop.broken.clear()
    elif what == "arm":
        await run.arm(asked(), 0.0)
    elif what == "resume":
        run.resume(asked())
    elif what == "take over":
        await run.begin_manual(asked(), 7, "page")


async def interleaved(seed: int) -> bool:
    """Do at random times what people and a loose wire do; return whether the wheels have turned."""
    rng, shop = Random(seed), Workshop()
    run = supervisor(shop, motors=SlowMotors(shop, rng))
    running = asyncio.create_task(run.run())
    time, stopped, turned = asyncio.get_running_loop().time, True, False
    asking: set[asyncio.Task[None]] = set()

    async def starts(what: str) -> None:
        nonlocal stopped
        with suppress(NotArmed, NotResponding):
            await ask(run, what, shop)
            # Nothing was awaited since the mode has changed. Who takes over presses nothing here.
            stopped = what == "take over"

    acts = ["disarm", "hold", "breaks", "mends", "mends", "arm", "arm", "resume", "resume", "take over"]
    while time() < RUN_S:
        await asyncio.sleep(rng.choice((0.0, 0.0, rng.uniform(0.0, 0.03), rng.uniform(0.0, 0.3))))
        assert not stopped or shop.wheels == STOP, f"seed {seed}: at {time():.3f} s the wheels turn after a stop"
        turned |= shop.wheels != STOP
        what = rng.choice(acts)
        if what in {"disarm", "hold"}:
            run.disarm("asked to") if what == "disarm" else run.hold()
            stopped = True
            assert shop.wheels == STOP, f"seed {seed}: at {time():.3f} s a stop waits for something"
        elif what in {"breaks", "mends"}:
            await ask(run, what, shop)
        else:
            asking.add(asyncio.create_task(starts(what)))
    run.finish("requested", "enough")
    await asyncio.wait([running, *asking])
    assert running.exception() is None
    assert shop.wheels == STOP
    return turned


@pytest.mark.parametrize("first", range(0, SEEDS, 50))
def test_after_a_stop_no_wheel_turns_until_a_later_request(first: int) -> None:
    turned = sum(run_virtually(interleaved(seed)) for seed in range(first, first + 50))
    assert turned > 30, "the wheels hardly ever turn: this shows nothing"
