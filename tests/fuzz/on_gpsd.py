"""gpsd's client, on a line from a server that says anything, in any pieces."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import isfinite

from hypothesis import strategies as st

from tests.drivers.test_gpsd import VERSION, report
from tests.fuzz.damage import as_json, bytes_of, json_of
from tests.fuzz.target import Case, Target, Try, refused
from wayfarer.drivers.gpsd import Gpsd, GpsdSettings, parse
from wayfarer.errors import DriverError
from wayfarer.hal import PositionFix
from wayfarer.simhal.buses import FakeBuses

REPORTS = [parse(report(second)) for second in range(3)]
LONG_S = 20.0  # this machine may be busy
SAID = VERSION + b"".join(map(report, range(4)))


def _conversations() -> st.SearchStrategy[Case]:
    whole = st.just(VERSION)
    lines = st.lists(json_of(REPORTS, 2).map(lambda value: as_json(value) + b"\n"), max_size=5).map(b"".join)
    return st.lists(bytes_of([SAID, report(9)], most=3), max_size=3) | st.tuples(whole, lines).map(list)


class Server:
    """Says to each who calls what ``pieces`` has, and hangs up."""

    def __init__(self) -> None:
        self.pieces: list[bytes] = []

    async def serve(self, _reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for piece in self.pieces:
            writer.write(piece)
            await asyncio.sleep(0)
        with suppress(OSError):
            writer.write_eof()
            await writer.drain()
        writer.close()


@contextmanager
def _called() -> Iterator[Try]:
    with asyncio.Runner() as runner:
        server = Server()
        listening = runner.run(asyncio.start_server(server.serve, "127.0.0.1", 0))
        client = Gpsd(GpsdSettings(port=listening.sockets[0].getsockname()[1]), FakeBuses())

        def attempt(pieces: list[bytes]) -> str:
            server.pieces = pieces
            return runner.run(_listened(client))

        yield attempt
        listening.close()


async def _listened(client: Gpsd) -> str:
    """Listen until the server has hung up, and see each fix that is given."""
    fixes = set()
    try:
        await client.open()
        follower = next(task for task in asyncio.all_tasks() if task.get_name() == client.name)
        async with asyncio.timeout(LONG_S):
            while not follower.done():
                fixes.add(_checked(await client.read()) is None)
                await asyncio.sleep(0)
        assert follower.exception() is None
        await client.read()
    except DriverError as error:
        return f"{sorted(fixes)} {refused(error)}"
    finally:
        await client.close()
    raise AssertionError("the server hung up, and read does not say so")


def _checked(fix: PositionFix | None) -> PositionFix | None:
    if fix is not None:
        assert abs(fix.latitude_deg) <= 90.0 and abs(fix.longitude_deg) <= 180.0 and isfinite(fix.t_s)
        assert fix.error_m is None or (fix.error_m >= 0.0 and isfinite(fix.error_m))
    return fix


GPSD = Target("gpsd", _conversations(), _called)
