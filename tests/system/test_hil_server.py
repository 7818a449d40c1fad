"""Real drivers over real threads of buses, and chips at the other end of a socket, when a bus hangs."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tests.system.hil_buses import HilBuses, HilConnection
from tests.system.hil_server import serve
from tests.system.hil_setup import wait_for
from tests.system.subprocesses import starting
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.errors import NotResponding
from wayfarer.hal import WheelCommand
from wayfarer.simhal.chips.motor_boards import FAILSAFE_S

I2C = "/dev/i2c-1"
FLOW = {"driver": "pmw3901", "bus": "/dev/spidev0.1"}
AHEAD = WheelCommand(0.5, 0.5)


@pytest.fixture(autouse=True)
def on_a_free_computer() -> Iterator[None]:
    """A transfer has 0.1 s."""
    with starting():
        yield


def minirover() -> RoverConfig:
    config = load_rover("minirover")
    return config.model_copy(update={"parts": {**config.parts, "motion": FLOW}})


Ask = Callable[..., Awaitable[dict[str, Any]]]


@asynccontextmanager
async def served(config: RoverConfig) -> AsyncIterator[tuple[HilBuses, Ask]]:
    """The buses of a bench that serves a rover meanwhile, and what asks the bench itself."""
    with TemporaryDirectory(prefix="wf-") as folder:
        path = Path(folder) / "bench"
        serving = asyncio.create_task(serve(config, path))
        await asyncio.to_thread(wait_for, "the bench listens", path.exists)
        over, line = HilBuses(str(path)), await asyncio.to_thread(HilConnection, str(path))
        try:
            yield over, lambda do, **details: asyncio.to_thread(line.ask, do, **details)
        finally:
            line.close()
            await over.close()
            serving.cancel()
            with suppress(asyncio.CancelledError):
                await serving


async def test_write_that_hung_in_the_wire_arrives_late_and_the_stop_right_behind_it() -> None:
    async with served(minirover()) as (over, ask):
        motors = assemble(minirover(), over).motors
        await motors.open()
        bus = over.i2c(I2C)
        hung_s = (await ask("hang", bus=I2C, for_s=0.4))["t_s"]
        with pytest.raises(NotResponding, match="a transfer did not end"):
            await bus.write(0x15, b"\x0b\x79")  # the left side ahead: what the driver writes once it has asked
        motors.halt()
        await asyncio.sleep(0.5)
        look = await ask("look")
    late, stop = [command for command in look["commands"] if command[0] > hung_s]
    assert late[0] - hung_s >= 0.4
    assert late[1] > 0.0
    assert stop[1:] == [0.0, 0.0]
    assert stop[0] - late[0] < FAILSAFE_S / 2, "the deadman did it"


async def test_command_behind_a_question_that_hung_never_reaches_the_wheels() -> None:
    async with served(minirover()) as (over, ask):
        motors = assemble(minirover(), over).motors
        await motors.open()
        hung_s = (await ask("hang", bus=I2C, for_s=0.4))["t_s"]
        with pytest.raises(NotResponding, match="a transfer did not end"):
            await motors.drive(AHEAD)
        await asyncio.sleep(0.5)
        look = await ask("look")
    assert [command[1:] for command in look["commands"] if command[0] > hung_s] == []
