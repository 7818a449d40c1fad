"""gpsd: only fixes that are new and whole, whatever comes over the line, and a lost daemon is said so."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.drivers import gpsd
from wayfarer.drivers.gpsd import Fixes, Gpsd, GpsdSettings
from wayfarer.errors import NotResponding, WrongPart
from wayfarer.hal import ExplainsNoFix, PositionFix, PositionReceiver
from wayfarer.safety.mission import Mission, Place
from wayfarer.safety.settings import SafetySettings
from wayfarer.simhal.buses import FakeBuses
from wayfarer.testing import check_position_receiver

VERSION = b'{"class":"VERSION","release":"3.22","rev":"3.22","proto_major":3,"proto_minor":14}\n'
# docs/reference/hardware.md, as Debian 12's gpsd 3.22 reports it
LATITUDE_DEG, LONGITUDE_DEG, ERROR_M = 51.501666667, -0.125, 17.1
NOON_S = 1_753_012_800.0  # of the reports below, seconds since 1970


def report(second: int, **fields: Any) -> bytes:
    """Return a TPV line; fields that are None are left out."""
    whole = {
        "class": "TPV",
        "device": "/dev/ttyACM0",
        "mode": 3,
        "time": f"2025-07-20T12:00:{second:02d}.000Z",
        "lat": LATITUDE_DEG,
        "lon": LONGITUDE_DEG,
        "eph": ERROR_M,
    }
    return json.dumps({key: value for key, value in (whole | fields).items() if value is not None}).encode() + b"\n"


def taken(*lines: bytes, stale_s: float = 3.0) -> Fixes:
    """Return what is known after lines that came one a second, the first at 0 s."""
    fixes = Fixes(stale_s)
    for t_s, line in enumerate(lines):
        fixes.take(line, float(t_s))
    return fixes


# -- reports ---------------------------------------------------------------------------------------------------------


def test_a_fix_has_the_position_and_the_error_that_gpsd_says() -> None:
    fix = taken(report(0), report(1)).latest(1.0)
    assert fix == PositionFix(1.0, LATITUDE_DEG, LONGITUDE_DEG, ERROR_M, NOON_S + 1.0)


def test_a_first_fix_may_be_an_old_one_and_counts_when_its_time_moves_on() -> None:
    assert taken(report(0)).latest(0.0) is None
    assert taken(report(0), report(1)).latest(1.0) is not None


def test_a_repeated_fix_goes_stale() -> None:
    fixes = taken(report(0), report(1), report(1), report(1), report(1))
    assert fixes.latest(4.0) is not None
    assert fixes.latest(4.1) is None
    fixes.take(report(2), 10.0)
    assert fixes.latest(10.0) == PositionFix(10.0, LATITUDE_DEG, LONGITUDE_DEG, ERROR_M, NOON_S + 2.0)


def test_of_several_reports_of_one_moment_the_last_counts() -> None:
    fixes = taken(report(0), report(1, mode=1, lat=None, lon=None), report(1, mode=2, eph=None), report(1, lat=51.6))
    assert fixes.latest(3.0) == PositionFix(1.0, 51.6, LONGITUDE_DEG, ERROR_M, NOON_S + 1.0)


def test_time_that_leaps_back_counts_again_when_it_moves_on() -> None:
    fixes = taken(report(30), report(31), report(2))
    assert fixes.latest(4.0) is not None
    assert fixes.latest(4.1) is None
    fixes.take(report(3), 6.0)
    assert fixes.latest(6.0) is not None


@pytest.mark.parametrize(
    "fields",
    [
        {"mode": 1},
        {"mode": True},
        {"lon": None},
        {"lat": float("nan")},
        {"lat": 10**400},
        {"lat": 90.5},
        {"lon": -180.5},
        {"time": None},
        {"time": 12},
    ],
)
def test_what_is_no_fix_ends_the_one_before_and_never_becomes_zero(fields: dict[str, Any]) -> None:
    before = taken(report(0), report(1))
    assert before.latest(1.0) is not None
    before.take(report(2, **fields), 2.0)
    assert before.latest(2.0) is None


@pytest.mark.parametrize("error", [None, float("nan"), -1.0, "17"])
def test_an_error_that_is_not_told_is_none(error: Any) -> None:
    assert taken(report(0), report(1, eph=error)).latest(1.0) == PositionFix(
        1.0, LATITUDE_DEG, LONGITUDE_DEG, None, NOON_S + 1.0
    )


@pytest.mark.parametrize("time", ["2026-12-31T23:59:60.000Z", "2026-13-01T00:00:00Z", "2026-11-18T12:00:00", "x"])
def test_a_time_that_no_clock_has_leaves_the_position(time: str) -> None:
    fix = taken(report(0, time=time), report(0, time=time + "~")).latest(1.0)
    assert fix is not None
    assert fix.utc_s is None


# -- several receivers -----------------------------------------------------------------------------------------------

LIVE, OTHER = "/dev/ttyACM0", "/dev/ttyUSB0"
HOME_S, RADIUS_M = 10.0, 100.0
NORTH_DEG = 1.0 / 111_000.0  # a metre
OTHERS: dict[str, Callable[[float], dict[str, Any] | None]] = {
    "hung": lambda _: {"time": "2025-07-20T12:00:05.000Z"},
    "hung and ahead": lambda _: {"time": "2026-07-20T12:00:05.000Z"},
    "hangs later": lambda t_s: {"time": clock_text(min(t_s, 8.0))},
    "without fix": lambda t_s: {"time": clock_text(t_s), "mode": 1},
    "without time": lambda _: {"time": None},
    "unplugged later": lambda t_s: {"time": clock_text(t_s)} if t_s < 8.0 else None,
}


def clock_text(t_s: float) -> str:
    return f"2025-07-20T12:{int(t_s // 60):02d}:{t_s % 60:06.3f}Z"


@pytest.mark.parametrize("stale_s", [1.5, 60.0])
@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("period_s", [0.2, 1.0, 1.7])
@pytest.mark.parametrize("phase_s", [0.05, 0.5, 0.95])
def test_mission_ends_at_its_radius_by_the_receiver_that_is_well(
    stale_s: float, other: str, period_s: float, phase_s: float
) -> None:
    """A rover whose dead reckoning sees nothing is carried away by 5 m per second; the other receiver stays at home."""
    mission, fixes = Mission(SafetySettings(mission_radius_m=RADIUS_M), 0.0, Place()), Fixes(stale_s)
    said = [(float(n), LIVE) for n in range(60)]
    said += [(n * period_s + phase_s, OTHER) for n in range(int(60.0 / period_s))]
    reads = [(n + 0.7, "") for n in range(60)]
    ended_s = None
    for t_s, device in sorted(said + reads):
        if device:
            fields = {"time": clock_text(t_s)} if device == LIVE else OTHERS[other](t_s)
            away_m = 5.0 * max(0.0, t_s - HOME_S) if device == LIVE else 0.0
            if fields is not None:
                line = report(0, device=device, lat=LATITUDE_DEG + away_m * NORTH_DEG, **fields)
                fixes.take(line, t_s)
            continue
        if (fix := fixes.latest(t_s)) is not None:
            mission.position(fix)
        if mission.end(t_s) is not None:
            ended_s = t_s
            break
    assert ended_s is not None
    assert HOME_S + RADIUS_M / 5.0 < ended_s < HOME_S + RADIUS_M / 5.0 + 8.0


def test_the_receiver_that_is_served_stays_until_it_has_no_new_fix() -> None:
    fixes = Fixes(60.0)

    def read(t_s: float) -> float | None:
        fix = fixes.latest(t_s)
        return None if fix is None else fix.latitude_deg

    for second in range(3):
        fixes.take(report(second, device=LIVE, lat=1.0), float(second))
        fixes.take(report(second, device=OTHER, lat=2.0), second + 0.5)
        assert read(second + 0.9) == (None if second == 0 else 1.0)
    for second in range(3, 20):
        fixes.take(report(second, device=OTHER, lat=2.0), second + 0.5)
        assert read(second + 0.9) == (1.0 if second < 5 else 2.0), "for 3 s, although a fix could be used for 60 s"
    fixes.take(report(20, device=OTHER, mode=1), 20.0)
    assert read(20.1) == 1.0
    assert read(62.1) is None


def test_receivers_without_end_take_no_memory_and_the_one_that_speaks_is_kept() -> None:
    fixes = Fixes(3.0)
    for number in range(1_000):
        fixes.take(report(number % 60, device=LIVE, time=clock_text(float(number))), float(number))
        fixes.take(report(0, device=f"/dev/pts/{number}"), number + 0.5)
    assert fixes.latest(999.5) is not None
    assert len(fixes._receivers) == gpsd.MOST_RECEIVERS


garbage = st.one_of(
    st.binary(max_size=200),
    st.sampled_from((b"[" * 60_000, b"[1,2]", b"null", b"\xff\xfe{\x00", b'{"class":"SKY"}', b'{"class":"TPV"', b"")),
    st.builds(lambda cut: report(5)[:cut], st.integers(0, len(report(5)) - 3)),
    st.just(report(5).replace(b"}", b",}")),  # the trailing comma of an old NTRIP source
)


@given(lines=st.lists(garbage, max_size=10))
def test_what_is_no_report_changes_nothing(lines: list[bytes]) -> None:
    fixes = taken(report(0), report(1))
    for line in lines:
        fixes.take(line, 1.5)
    assert fixes.latest(2.0) == PositionFix(1.0, LATITUDE_DEG, LONGITUDE_DEG, ERROR_M, NOON_S + 1.0)


# -- the connection --------------------------------------------------------------------------------------------------

Script = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


@asynccontextmanager
async def served(script: Script) -> AsyncIterator[Gpsd]:
    """Give a client of a server that follows a script with each who calls."""

    calls = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        calls.append(asyncio.current_task())
        with suppress(OSError):
            await script(reader, writer)
        writer.close()
        with suppress(OSError):
            await writer.wait_closed()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    client = Gpsd(GpsdSettings(port=server.sockets[0].getsockname()[1]), FakeBuses())
    try:
        yield client
    finally:
        await client.close()
        server.close()
        await asyncio.gather(*filter(None, calls))
        await server.wait_closed()


def saying(*pieces: bytes, then_hangs_up: bool = False) -> Script:
    """Return a script that sends pieces and stays on the line."""

    async def script(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for piece in pieces:
            writer.write(piece)
            await writer.drain()
            await asyncio.sleep(0.005)
        if not then_hangs_up:
            await reader.read()

    return script


async def fix_from(client: Gpsd) -> PositionFix:
    for _ in range(1000):
        if fix := await client.read():
            return fix
        await asyncio.sleep(0.005)
    raise AssertionError("no fix came")


async def test_asks_for_reports_and_gives_the_fix() -> None:
    asked = []

    async def script(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(VERSION)
        asked.append(await reader.readline())
        await saying(b'{"class":"DEVICES","devices":[]}\n', report(0), report(1))(reader, writer)

    async with served(script) as client:
        assert isinstance(client, PositionReceiver)
        assert isinstance(client, ExplainsNoFix)
        await client.open()
        fix = await fix_from(client)
        assert fix[1:] == (LATITUDE_DEG, LONGITUDE_DEG, ERROR_M, NOON_S + 1.0)
        assert 0.0 <= asyncio.get_running_loop().time() - fix.t_s < 3.0
    assert asked == [b'?WATCH={"enable":true,"json":true};\n']
    assert len(asked[0]) <= 80  # gpsd_json(5) allows no longer request


async def test_lines_may_come_in_halves_and_some_be_garbage() -> None:
    first, second = report(0), report(1)
    pieces = (VERSION, first[:30], first[30:] + b"\x00\xff\n" + second[:-1], b"\n")
    async with served(saying(*pieces)) as client:
        await client.open()
        assert (await fix_from(client)).latitude_deg == LATITUDE_DEG


async def test_a_line_without_end_is_dropped_and_what_follows_is_heard() -> None:
    endless = b'{"class":"TPV","x":"' + b"x" * 300_000
    async with served(saying(VERSION, report(0), endless, b'"}\n', report(1))) as client:
        await client.open()
        assert (await fix_from(client)).longitude_deg == LONGITUDE_DEG


async def test_read_never_waits_and_gives_none_while_there_is_no_fix() -> None:
    async with served(saying(VERSION)) as client:
        await client.open()
        async with asyncio.timeout(0.5):
            assert await client.read() is None


async def test_a_daemon_that_is_gone_is_said_so_and_comes_back_by_opening_again() -> None:
    lives = iter([saying(VERSION, then_hangs_up=True), saying(VERSION, report(0), report(1))])

    async def script(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await next(lives)(reader, writer)

    async with served(script) as client:
        await client.open()
        with pytest.raises(NotResponding, match=r"gpsd at 127\.0\.0\.1:\d+: has closed the connection"):
            await fix_from(client)
        await client.open()
        assert (await fix_from(client)).error_m == ERROR_M


@pytest.mark.parametrize("greeting", [b"SSH-2.0-OpenSSH_9.2\r\n", b'{"class":"TPV"}\n', b"\xff\xfe\n", b"x" * 200_000])
async def test_what_is_no_gpsd_is_another_part(greeting: bytes) -> None:
    async with served(saying(greeting)) as client:
        with pytest.raises(WrongPart, match="VERSION"):
            await client.open()
        with pytest.raises(NotResponding, match="not open"):
            await client.read()


async def test_nobody_there_is_told_with_the_remedy() -> None:
    async with served(saying()) as client:
        pass  # the server is gone now
    with pytest.raises(NotResponding, match="sudo apt install gpsd; systemctl status gpsd"):
        await client.open()
    await client.close()


@pytest.mark.parametrize("host", ["no-such-host.invalid", "a..b", "x" * 70, "\0"])
async def test_a_name_of_no_host_is_told_as_one_that_may_come(host: str) -> None:
    client = Gpsd(GpsdSettings(host=host), FakeBuses())
    with pytest.raises(NotResponding, match="gpsd at"):
        await client.open()


async def test_a_server_that_hangs_up_at_once_or_says_nothing_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    async with served(saying(then_hangs_up=True)) as client:
        with pytest.raises(NotResponding, match="without an answer"):
            await client.open()
    monkeypatch.setattr(gpsd, "ANSWER_S", 0.05)
    async with served(saying()) as client:
        with pytest.raises(NotResponding, match=r"no answer within 0\.05 s"):
            await client.open()


async def test_keeps_the_promises_of_a_position_receiver() -> None:
    async with served(saying(VERSION)) as client:
        await check_position_receiver(lambda: client, lambda: Gpsd(GpsdSettings(port=1), FakeBuses()))
        await client.open()
        await client.open()


async def test_an_opening_that_is_cancelled_hangs_up() -> None:
    hung_up = asyncio.Event()

    async def script(reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
        await reader.read()
        hung_up.set()

    async with served(script) as client:
        opening = asyncio.create_task(client.open())
        await asyncio.sleep(0.02)
        opening.cancel()
        async with asyncio.timeout(2.0):
            await asyncio.wait([opening])
            await hung_up.wait()
        assert opening.cancelled()
