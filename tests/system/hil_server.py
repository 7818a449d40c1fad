"""Hardware-in-the-loop server: a world and the simulated chips of a rover file, in real time, in one process.

::

    python -m tests.system.hil_server --rover rover.toml --socket /tmp/bench.sock
    WAYFARER_BENCH=/tmp/bench.sock wayfarer run --rover rover.toml

with ``buses = "tests.system.hil_buses:buses"`` as the first line of ``rover.toml``. The daemon then runs its real
drivers over its real bus threads, and may be killed, suspended or disconnected: nothing here notices but the motor
boards' own deadmen. ``WAYFARER_BENCH`` names the socket. The rover stands in a clearing: nothing is in its way.

Both ends speak one JSON object a line. Transfers name a bus and give their bytes in hex, a list of pieces; on I2C no
piece means a read alone. Beside them

* ``{"do": "begin", "rover": "rover.toml"}`` begins again, in another clearing, with the chips of this rover file;
* ``{"do": "look", "since_s": 0.0}`` returns the state of the world and the wheel commands since then;
* ``{"do": "power_cycle"}`` interrupts the motor board's power for a moment;
* ``{"do": "inject", "target": "motors", "kind": "failsafe_off"}`` begins a fault of the bus layer
  (``simhal.faults.kinds.KINDS``);
* ``{"do": "hang", "bus": "/dev/i2c-1", "for_s": 1.0}`` holds a bus: what is under way ends late, as commanded.
"""

from __future__ import annotations

import argparse
import asyncio
import errno
from asyncio import StreamReader, StreamWriter
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from math import inf
from pathlib import Path
from random import Random
from typing import Any

import msgspec

from tests.system.hil_buses import from_hex
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.daemon.daemon import DaemonLoop
from wayfarer.errors import NotResponding
from wayfarer.escape.settings import Vehicle
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chip_wiring import ChipWiring
from wayfarer.simhal.faults.kinds import KINDS
from wayfarer.simhal.faults.wires import FaultyBuses, wired_part
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING, Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

TICK_S = 0.01  # how late a deadman may act in real time; in the world it acts at its own
KEPT_COMMANDS = 2000  # 50 s of two sides at 20 Hz


class RecordedWorld(World):
    """A world that remembers what its wheels were commanded: (time that it is true from, left duty, right duty)."""

    def __init__(
        self, forest: Forest, vehicle: Vehicle, physics: Physics, streams: RandomStreams, starts_s: float = 0.0
    ) -> None:
        self.commands: deque[tuple[float, float, float]] = deque(maxlen=KEPT_COMMANDS)
        self._now_s = starts_s
        super().__init__(forest, vehicle, physics, streams, starts_s)

    @property
    def wheels_m_s(self) -> tuple[float, float]:
        """How fast the left and right wheels turn."""
        return self._left_m_s, self._right_m_s

    def advance_to(self, t_s: float) -> None:
        """Go on to a time."""
        self._now_s = t_s
        super().advance_to(t_s)

    def command(self, left: float, right: float) -> None:
        """Set the duty of both sides."""
        self.commands.append((self._now_s, left, right))
        super().command(left, right)


class HilServer:
    """All chips of one rover in a clearing, where it drives ahead until something is done to it.

    What has no chip (a bumper, a receiver, a light at a GPIO pin) is left out, and a camera, too much for this wire.

    Args:
        config: the rover file.
        clock: seconds; the world's time.
    """

    def __init__(self, config: RoverConfig, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.begin(config)

    def begin(self, config: RoverConfig) -> None:
        """Put new chips and a new world in the place of those that there are."""
        streams = RandomStreams(0)
        self.world = RecordedWorld(CLEARING, config.vehicle, Physics(slip_free_m=inf), streams, self._clock())
        self._wires = FaultyBuses()
        self._wiring = ChipWiring(self.world, streams, self._clock, self._wires)
        self._config = config
        self._faults = ExitStack()
        self._hangs_until_s: dict[str, float] = {}
        for part, table in config.parts.items():
            self._wiring.attach(part, table)

    def step(self) -> None:
        """Let time pass: first for the deadmen, then for the world."""
        self._wiring.tick()
        self.world.advance_to(self._clock())

    async def serve_client(self, reader: StreamReader, writer: StreamWriter) -> None:
        """Answer a client's requests in turn until it goes away."""
        try:
            while line := await reader.readline():
                writer.write(msgspec.json.encode(await self.answer(msgspec.json.decode(line))) + b"\n")
                await writer.drain()
        except ConnectionError:
            pass
        finally:
            writer.close()

    async def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Do what a request says and return the reply; if that failed ``error`` says why, and ``errno`` as Linux."""
        do = getattr(self, f"_do_{request.pop('do')}")
        try:
            reply: dict[str, Any] = await do(**request)
        except NotResponding as error:
            return {"error": str(error), "errno": errno.EREMOTEIO}
        except ChipMisuse as error:
            return {"error": str(error), "errno": 0}
        return reply

    # -- transfers -----------------------------------------------------------------------------------------------

    async def _do_i2c(self, bus: str, address: int, data: list[str], count: int = 0) -> dict[str, Any]:
        await self._wait_for(bus)
        wires = self._wires.i2c(bus)
        if not data:
            return {"data": [wires.chip_at(address).read(count).hex()]}
        (piece,) = from_hex(data)
        if count:
            return {"data": [(await wires.write_read(address, piece, count)).hex()]}
        await wires.write(address, piece)
        return {"data": []}

    async def _do_spi(self, bus: str, data: list[str]) -> dict[str, Any]:
        await self._wait_for(bus)
        return {"data": [piece.hex() for piece in await self._wires.spi(bus).transfer(*from_hex(data))]}

    async def _do_serial(self, bus: str, data: list[str]) -> dict[str, Any]:
        await self._wait_for(bus)
        (piece,) = from_hex(data)
        port: Any = self._wires.serial(bus)
        return {"data": [(await port.hang.carry(lambda: port.send(piece))).hex()]}

    async def _wait_for(self, bus: str) -> None:
        """Wait until a bus no longer hangs."""
        await asyncio.sleep(self._hangs_until_s.get(bus, 0.0) - self._clock())

    # -- what a test, or a person, may see and do ------------------------------------------------------------------

    async def _do_begin(self, rover: str) -> dict[str, Any]:
        self.begin(load_rover(rover))
        return {"t_s": self._clock()}

    async def _do_look(self, since_s: float = -inf) -> dict[str, Any]:
        self.step()
        return {
            "t_s": self._clock(),
            "commanded": self.world.commanded,
            "commands": [command for command in self.world.commands if command[0] >= since_s],
            "wheels_m_s": self.world.wheels_m_s,
            "forward_m": self.world.forward_m,
            "deadman_armed": [board.stops_by_s < inf for board in self._wiring.boards],
        }

    async def _do_power_cycle(self) -> dict[str, Any]:
        for board in self._wiring.boards:
            board.power_cycle()
        return {"t_s": self._clock()}

    async def _do_inject(self, target: str, kind: str, **params: Any) -> dict[str, Any]:
        wired = wired_part(target, self._config, self._wires)
        self._faults.enter_context(KINDS[kind](**params).effect(wired, Random(0)))
        return {"t_s": self._clock()}

    async def _do_hang(self, bus: str, for_s: float) -> dict[str, Any]:
        t_s = self._clock()
        self._hangs_until_s[bus] = t_s + for_s
        return {"t_s": t_s}


async def serve(config: RoverConfig, path: Path) -> None:
    """Serve a rover's chips at a socket for ever."""
    bench = HilServer(config, asyncio.get_running_loop().time)
    talks: set[asyncio.Task[None]] = set()
    used = asyncio.Event()

    def serve_client(reader: StreamReader, writer: StreamWriter) -> None:
        talk = asyncio.create_task(bench.serve_client(reader, writer))
        talks.add(talk)
        talk.add_done_callback(ended)
        used.set()

    def ended(talk: asyncio.Task[None]) -> None:
        talks.discard(talk)
        if not talks:
            used.clear()

    async with await asyncio.start_unix_server(serve_client, path):
        print(f"the chips of {config.name} are at {path}", flush=True)
        try:
            while await used.wait():
                bench.step()
                await asyncio.sleep(TICK_S)
        finally:  # left to the end of the loop, they would end in tracebacks
            for talk in talks:
                talk.cancel()
            await asyncio.gather(*talks, return_exceptions=True)


def main() -> None:
    """Serve what the command line says."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.system.hil_server", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--rover", required=True, help="a shipped rover or a TOML file")
    parser.add_argument("--socket", required=True, type=Path, help="where to serve its chips")
    options = parser.parse_args()
    with suppress(KeyboardInterrupt), asyncio.Runner(loop_factory=DaemonLoop) as runner:
        runner.run(serve(load_rover(options.rover), options.socket))


if __name__ == "__main__":
    main()
