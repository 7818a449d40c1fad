"""The bench: what a rover file's real drivers get from chips at the other end of a socket."""

from __future__ import annotations

import asyncio
import signal
import socket
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tests.children import child
from tests.simhal.chips.bench import Clock
from tests.system.hil_buses import SOCKET_VARIABLE, HilBuses, HilConnection, buses
from tests.system.hil_server import HilServer, serve
from tests.system.hil_setup import BUSY, STARTS, wait_for
from tests.system.subprocesses import starting
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadConfig, BadInput, NotResponding
from wayfarer.hal import STOP, Rover, WheelCommand
from wayfarer.simhal.chips.thunderborg import FAILSAFE_S

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


def bench() -> tuple[HilServer, Clock]:
    clock = Clock()
    return HilServer(minirover(), clock), clock


async def i2c(bench: HilServer, address: int, *data: int) -> dict[str, Any]:
    return await bench.answer({"do": "i2c", "bus": I2C, "address": address, "data": [bytes(data).hex()]})


async def test_read_alone_is_the_answer_to_the_write_before_it() -> None:
    made, _ = bench()
    assert await i2c(made, 0x15, 0x99) == {"data": []}
    request = {"do": "i2c", "bus": I2C, "address": 0x15, "data": [], "count": 6}
    assert (await made.answer(request))["data"][0].startswith("9915")


async def test_deadman_acts_at_its_own_time_and_the_record_says_so() -> None:
    made, clock = bench()
    for command in ((19, 1), (11, 100)):
        await i2c(made, 0x15, *command)
    told_s = clock.t_s
    clock.t_s += 10.0
    made.step()
    last = (await made.answer({"do": "look"}))["commands"][-1]
    assert last == (pytest.approx(told_s + FAILSAFE_S), 0.0, 0.0)


def test_nothing_is_in_the_rovers_way() -> None:
    clock = Clock()
    made = HilServer(minirover(), clock)
    made.world.command(0.5, 0.5)
    clock.t_s += 200.0
    made.step()
    assert min(made.world.wheels_m_s) > 0.0
    assert made.world.forward_m == pytest.approx(200.0 * sum(made.world.wheels_m_s) / 2.0, rel=0.01)


async def test_board_forgets_its_deadman_with_its_power() -> None:
    made, _ = bench()
    await i2c(made, 0x15, 19, 1)
    assert (await made.answer({"do": "look"}))["deadman_armed"] == [True]
    await made.answer({"do": "power_cycle"})
    assert (await made.answer({"do": "look"}))["deadman_armed"] == [False]


async def test_silenced_part_answers_no_more_and_its_neighbour_does() -> None:
    made, _ = bench()
    await made.answer({"do": "inject", "target": "compass", "kind": "nack"})
    assert "0x60" in (await i2c(made, 0x60, 0))["error"]
    assert "error" not in await i2c(made, 0x15, 14, 0)


def test_camera_is_refused() -> None:
    with pytest.raises(BadConfig, match=r"parts\.motion"):
        HilServer(load_rover("minirover"), Clock())
    with pytest.raises(BadInput, match="no camera"):
        HilBuses("nowhere").camera("0", width=64, height=48, rate_hz=10, exposure_us=None)


def test_buses_are_those_of_the_socket_that_the_environment_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(SOCKET_VARIABLE, raising=False)
    with pytest.raises(BadInput, match=SOCKET_VARIABLE):
        buses()
    monkeypatch.setenv(SOCKET_VARIABLE, "/tmp/some.sock")
    handed_out: Buses = buses()
    assert isinstance(handed_out, HilBuses)


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


async def use(rover: Rover) -> None:
    """Every driver of a rover, once."""
    assert rover.motion is not None
    for part in rover.parts.values():
        await part.open()
    reading = await rover.compass.read()
    assert abs((reading.heading_deg + 180.0) % 360.0 - 180.0) < 10.0, "the rover stands facing north"
    await rover.motion.read()  # the first after the opening says nothing
    assert (await rover.motion.read()).quality > 0.0
    assert (await rover.motors.drive(AHEAD)).left == pytest.approx(0.5, abs=0.01)
    await rover.motors.stop()


@pytest.mark.parametrize("config", [load_rover("forestrover"), minirover()], ids=["forestrover", "minirover"])
async def test_real_drivers_of_a_shipped_rover_work_over_the_socket(config: RoverConfig) -> None:
    for _ in range(STARTS):
        async with served(config) as (over, ask):
            try:
                await use(assemble(config, over))
            except NotResponding as late:  # bench and drivers share a process, which had no time for them
                assert BUSY.search(str(late))
                continue
            look = await ask("look")
        break
    else:
        pytest.fail(f"no time for a transfer in {STARTS} attempts")
    told = [(left, right) for _, left, right in look["commands"]]
    assert max(left for left, _ in told) == pytest.approx(0.5, abs=0.01)
    assert look["commanded"] == [0.0, 0.0]


async def test_hanging_bus_misses_its_deadline_and_its_neighbours_do_not() -> None:
    async with served(minirover()) as (over, ask):
        rover = assemble(minirover(), over)
        await rover.motors.open()
        await ask("hang", bus=I2C, for_s=0.4)
        with pytest.raises(NotResponding, match="a transfer did not end"):
            await rover.motors.drive(STOP)
        with pytest.raises(NotResponding, match="hangs"):
            await rover.compass.read()
        assert rover.motion is not None
        await rover.motion.open()
        await asyncio.sleep(0.5)
        assert await rover.motors.drive(STOP) == STOP


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


async def test_errors_on_the_wire_come_back_as_a_real_bus_tells_them() -> None:
    async with served(minirover()) as (over, _):
        bus = over.i2c(I2C)
        with pytest.raises(NotResponding, match="no acknowledgement"):
            await bus.write(0x16, b"\0")
        with pytest.raises(NotResponding, match="ThunderBorg: no command 63"):
            await bus.write(0x15, b"\x63")
        await bus.write(0x15, b"\x0e\x00")  # neither was fatal


async def test_missing_bench_is_told_by_its_path() -> None:
    over = HilBuses("/nowhere/bench")
    with pytest.raises(NotResponding, match="no HIL server at /nowhere/bench"):
        await over.i2c(I2C).write(0x15, b"\0")
    await over.close()


@pytest.mark.process
def test_bench_that_is_ended_while_a_client_is_connected_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "bench"
    command = [sys.executable, "-m", "tests.system.hil_server", "--rover", "forestrover", "--socket", str(path)]
    with (
        child(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as served_bench,
        socket.socket(socket.AF_UNIX) as client,
    ):
        assert served_bench.stdout is not None
        served_bench.stdout.readline()
        client.connect(str(path))
        client.sendall(b'{"do": "look"}\n')
        assert client.recv(65_536)
        served_bench.send_signal(signal.SIGINT)
        _, said = served_bench.communicate(timeout=10.0)
    assert (served_bench.returncode, said) == (0, b"")
