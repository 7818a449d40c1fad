"""The real gpsd, fed by gpsfake: packages gpsd and gpsd-clients of Debian 12."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import reduce
from operator import xor
from pathlib import Path
from typing import NamedTuple

import pytest

from wayfarer.drivers.gpsd import Gpsd, GpsdSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import PositionFix
from wayfarer.safety.mission import Mission, Place
from wayfarer.safety.settings import SafetySettings
from wayfarer.simhal.buses import FakeBuses

NOON_S = 1_753_012_800.0  # 2025-07-20T12:00Z, the first second of the track
START_S = 20.0  # a busy machine takes seconds to start both

pytestmark = pytest.mark.skipif(
    not (shutil.which("gpsfake") and shutil.which("gpsd")),
    reason="gpsfake and gpsd are not on PATH; apt-get install gpsd gpsd-clients",
)


class Daemon(NamedTuple):
    process: subprocess.Popen[bytes]
    client: Gpsd

    def kill(self) -> None:
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def sentence(body: str) -> str:
    return f"${body}*{reduce(xor, body.encode()):02X}\r\n"


LATITUDE = "5130.1000,N,00007.5000,W"


def epoch(second: int, *, time: str | None = None, place: str = LATITUDE) -> str:
    """Return the two sentences of docs/reference/hardware.md, at a second after 12:00; ``place`` may be empty."""
    time = f"12{second // 60:02d}{second % 60:02d}.00" if time is None else time
    place, is_fix = place or ",,,", bool(place)
    return sentence(f"GPRMC,{time},{'A' if is_fix else 'V'},{place},2.00,090.0,200725,,,A") + sentence(
        f"GPGGA,{time},{place},{is_fix:d},08,0.9,35.0,M,46.0,M,,"
    )


# What another receiver says in each second, and what check says if it is the only one.
OTHERS: dict[str, tuple[Callable[[int], str], str]] = {
    "hung": (lambda _: epoch(5), "has sent nothing new"),
    "without fix": (lambda second: epoch(second, place=""), "has no fix"),
    "without time": (lambda second: epoch(second, time=""), "sends a position without a time"),
}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def running(folder: Path, *receivers: Callable[[int], str]) -> Iterator[Daemon]:
    """Run gpsd with receivers that say something for each second."""
    tracks = [folder / f"{number}.nmea" for number, _ in enumerate(receivers)]
    for track, says in zip(tracks, receivers, strict=True):
        track.write_text("".join(map(says, range(600))), encoding="ascii")
    port = free_port()
    command = ["gpsfake", "-n", "-q", "-c", "0.05", "-P", str(port), *map(str, tracks)]
    with (folder / "gpsfake.log").open("wb") as log:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
    daemon = Daemon(process, Gpsd(GpsdSettings(port=port), FakeBuses()))
    try:
        yield daemon
    finally:
        if process.poll() is None:
            daemon.kill()


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    with running(tmp_path, epoch) as daemon:
        yield daemon


async def opened(daemon: Daemon) -> None:
    """Open as soon as gpsd listens."""
    async with asyncio.timeout(START_S):
        while True:
            try:
                return await daemon.client.open()
            except NotResponding:
                await asyncio.sleep(0.05)


async def next_fix(client: Gpsd, after_s: float) -> PositionFix:
    for _ in range(round(START_S / 0.02)):
        fix = await client.read()
        if fix is not None and fix.t_s > after_s:
            return fix
        await asyncio.sleep(0.02)
    raise AssertionError("no fix came")


async def test_fixes_come_while_gpsd_runs_and_its_death_is_noticed(daemon: Daemon) -> None:
    await opened(daemon)
    try:
        first = await next_fix(daemon.client, 0.0)
        second = await next_fix(daemon.client, first.t_s)
        for fix in (first, second):
            assert fix.latitude_deg == pytest.approx(51.5016667, abs=1e-6)
            assert fix.longitude_deg == pytest.approx(-0.125, abs=1e-6)
            assert fix.error_m is None or 0.0 < fix.error_m < 100.0
            assert fix.utc_s is not None
            assert 0.0 <= fix.utc_s - NOON_S < 600.0
        daemon.kill()
        with pytest.raises(NotResponding, match="closed the connection"):
            await next_fix(daemon.client, float("inf"))
        with pytest.raises(NotResponding, match="sudo apt install gpsd"):
            await daemon.client.open()
    finally:
        await daemon.client.close()


def drives_off(second: int) -> str:
    """Go north by 37 m per second."""
    return epoch(second, place=LATITUDE.replace("5130.1000", f"{5130.1 + 0.02 * second:.4f}"))


@pytest.mark.parametrize("other", OTHERS)
async def test_mission_ends_at_its_radius_by_the_receiver_that_is_well(tmp_path: Path, other: str) -> None:
    says, _ = OTHERS[other]
    time = asyncio.get_running_loop().time
    mission, north_deg = Mission(SafetySettings(mission_radius_m=300.0, mission_time_s=600.0), time(), Place()), 0.0
    with running(tmp_path, says, drives_off) as daemon:
        await opened(daemon)
        try:
            for _ in range(round(START_S / 0.03)):
                await asyncio.sleep(0.03)
                if (fix := await daemon.client.read()) is not None:
                    assert fix.latitude_deg >= north_deg, "where the other one stays"
                    north_deg = fix.latitude_deg
                    mission.position(fix)
                if (end := mission.end(time())) is not None:
                    break
        finally:
            await daemon.client.close()
    assert end is not None
    assert end.reason == "mission_radius"


@pytest.mark.parametrize("other", OTHERS)
async def test_check_says_what_the_only_receiver_lacks(tmp_path: Path, other: str) -> None:
    says, lacks = OTHERS[other]
    with running(tmp_path, says) as daemon:
        await opened(daemon)
        try:
            for _ in range(round(START_S / 0.05)):
                await asyncio.sleep(0.05)
                if lacks in daemon.client.why_no_fix().found:
                    break
            assert lacks in daemon.client.why_no_fix().found
            assert await daemon.client.read() is None
        finally:
            await daemon.client.close()
