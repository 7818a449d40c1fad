"""A ground station and a rover for tests: what a station sends, and what the rover was asked."""

from __future__ import annotations

import asyncio
import hashlib
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import common

from tests.views.live.records import run_log
from wayfarer.config.mavlink_settings import MavlinkSettings
from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.socket.protocol import Commands, Details, Refused
from wayfarer.views.mavlink.address import Address
from wayfarer.views.mavlink.frames import Frame, FrameReader
from wayfarer.views.mavlink.ground_station import GroundStation
from wayfarer.views.mavlink.signing import Signing

KEY = hashlib.sha256(b"a passphrase for tests").digest()
NOW_S = 1_764_000_000.0  # the wall clock
STATION = Address("udpout", "127.0.0.1", 14550)
NO_KEY = MavlinkSettings()
MAY_ARM = MavlinkSettings(key_file="key", may_arm=True)

Message = Any


class Encoder:
    """What a station sends with; ``ticks`` is its signing time, 10 us more for each message."""

    def __init__(self, key: bytes | None = None, ticks: int | None = None, system: int = 255) -> None:
        self._mavlink = common.MAVLink(None, system, 190)
        if key is not None:
            signing = self._mavlink.signing
            signing.secret_key, signing.sign_outgoing = key, True
            signing.timestamp = Signing(key, 0, NOW_S).now_ticks(NOW_S, 0.0) if ticks is None else ticks

    def frame(self, message: Message, *, force_mavlink1: bool = False) -> bytes:
        data: bytes = message.pack(self._mavlink, force_mavlink1=force_mavlink1)
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        return data


def heartbeat() -> Message:
    return common.MAVLink_heartbeat_message(common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)


def command(number: int, first: float = 0.0, second: float = 0.0, *, target: int = 1) -> Message:
    return common.MAVLink_command_long_message(target, 1, number, 0, first, second, 0, 0, 0, 0, 0)


def mode(number: int) -> Message:
    return command(common.MAV_CMD_DO_SET_MODE, 1.0, float(number))


def arming(arms: float) -> Message:
    return command(common.MAV_CMD_COMPONENT_ARM_DISARM, arms)


def stick(x: int, y: int, *, target: int = 1) -> Message:
    return common.MAVLink_manual_control_message(target, x, y, 500, 0, 0)


class Rover:
    """What a station can ask for; keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.driven: list[tuple[float, float]] = []
        self.refuses: str | None = None
        self.event: Callable[..., None]

    def _note(self, what: str) -> Details:
        self.asked.append(what)
        if self.refuses is not None:
            raise Refused(self.refuses)
        return {}

    async def arm(self, heading_deg: float | None = None) -> Details:
        assert heading_deg is None
        await asyncio.sleep(0.5)  # as long as the checks take
        return self._note("arm")

    async def disarm(self) -> Details:
        return self._note("disarm")

    async def hold(self) -> Details:
        return self._note("hold")

    async def resume(self) -> Details:
        return self._note("resume")

    async def mark(self, text: str) -> Details:
        return self._note(f"mark: {text}")

    async def link_lost(self, text: str) -> Details:
        return self._note(f"link lost: {text}")

    async def manual_begin(self, driver: str) -> Details:
        self._note(f"manual by {driver}")
        self.event("manual", asyncio.get_running_loop().time(), driver=driver)
        return {"lease": 7, "deadman_s": 0.3, "mode": "manual"}

    async def manual_drive(self, lease: int, seq: int, forward: float, turn: float, sent_s: float) -> Details:
        assert (lease, sent_s) == (7, asyncio.get_running_loop().time())
        assert seq == len(self.driven) + 1
        self.driven.append((forward, turn))
        if self.refuses is not None:
            raise Refused(self.refuses)
        return {}

    async def manual_end(self, lease: int) -> Details:
        return self._note(f"end of {lease}")


class FakePort:
    """A link without wires: keeps what the rover sends; ``receive`` is what the station sends."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.answered: list[bytes] = []
        self.local = False
        self.broken = False
        self._ready: Callable[[], None] = lambda: None
        self._data = b""

    def listen(self, ready: Callable[[], None]) -> None:
        self._ready = ready

    def read(self, now_s: float) -> Iterator[tuple[Frame, bool]]:
        if self.broken:
            raise OSError("unplugged")
        for frame in FrameReader().datagram(self._data):
            yield frame, self.local

    def receive(self, data: bytes) -> None:
        self._data = data
        self._ready()

    def write(self, frame: bytes) -> None:
        self.sent.append(frame)

    def answer(self, frame: bytes) -> None:
        self.answered.append(frame)

    def believe(self) -> None: ...

    def forget(self) -> None: ...

    def close(self) -> None: ...


class Linked:
    """A rover with its link, in virtual time."""

    def __init__(self, settings: MavlinkSettings, *, simulated: bool, port: FakePort) -> None:
        self.port = port
        self.rover = Rover()
        config = load_rover("sim").model_copy(update={"mavlink": settings})
        signing = Signing(KEY, 0, NOW_S) if settings.key_file else None
        self.station = GroundStation(STATION, config, signing, None)
        self.log = run_log(self.station.show, simulated=simulated)
        self.rover.event = self.log.event
        self.encoder = Encoder(KEY if settings.key_file else None)

    async def says(self, *messages: Message, encoder: Encoder | None = None) -> None:
        """Send messages of the station, and let the rover take them."""
        for message in messages:
            self.port.receive((encoder or self.encoder).frame(message))
        await asyncio.sleep(0.01)

    def heard(self) -> list[Any]:
        """What the rover has sent since the last call."""
        decoder = common.MAVLink(None)
        heard = [decoder.decode(bytearray(data)) for data in self.port.sent]
        self.port.sent.clear()
        return heard

    def acks(self) -> list[int]:
        """The results of the orders since the last call of ``heard`` or this."""
        return [each.result for each in self.heard() if each.get_type() == "COMMAND_ACK"]


@asynccontextmanager
async def linked(
    monkeypatch: pytest.MonkeyPatch, settings: MavlinkSettings = NO_KEY, *, simulated: bool = False
) -> AsyncIterator[Linked]:
    """Give a rover with its link, as a task group of the daemon would have it."""
    port = FakePort()
    monkeypatch.setattr("wayfarer.views.mavlink.link.open_port", lambda _address, _devices: port)
    monkeypatch.setattr("wayfarer.views.mavlink.link.wall_clock", lambda t_s: NOW_S + t_s)
    made = Linked(settings, simulated=simulated, port=port)
    async with made.station.serving(cast(Commands, made.rover)):
        await asyncio.sleep(0.01)
        yield made


def kinds(messages: list[Any]) -> Counter[str]:
    """How many there are of each message."""
    return Counter(each.get_type() for each in messages)


def texts(messages: list[Any]) -> list[str]:
    """The texts, their chunks put together as a station does."""
    pieces: dict[int, str] = {}
    whole = []
    for each in messages:
        if each.get_type() != "STATUSTEXT":
            continue
        if each.id == 0:
            whole.append(each.text)
            continue
        pieces[each.id] = pieces.get(each.id, "") + each.text
        if len(each.text) < 50:
            whole.append(pieces.pop(each.id))
    return whole
