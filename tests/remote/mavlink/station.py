"""A ground station and a rover for tests: what a station sends, and what the rover was asked."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import common

from tests.remote.live.records import run_log
from wayfarer.config.rover_file import load_rover
from wayfarer.config.settings import MavlinkSettings
from wayfarer.daemon.socket.protocol import Commands, Details, RequestRefused
from wayfarer.remote.mavlink.ground_station import GroundStation
from wayfarer.remote.mavlink.link import Address, FrameReader

STATION = Address("udpout", "127.0.0.1", 14550)
USUAL = MavlinkSettings()

Message = Any


class Encoder:
    """What a station sends with; ``signs``: with a key, which the rover does not know."""

    def __init__(self, *, signs: bool = False, system: int = 255) -> None:
        self._mavlink = common.MAVLink(None, system, 190)
        if signs:
            self._mavlink.signing.secret_key, self._mavlink.signing.sign_outgoing = bytes(32), True

    def frame(self, message: Message, *, force_mavlink1: bool = False) -> bytes:
        data: bytes = message.pack(self._mavlink, force_mavlink1=force_mavlink1)
        self._mavlink.seq = (self._mavlink.seq + 1) % 256
        return data


def heartbeat() -> Message:
    return common.MAVLink_heartbeat_message(common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)


def command(number: int, first: float = 0.0, second: float = 0.0, *, target: int = 1, component: int = 1) -> Message:
    return common.MAVLink_command_long_message(target, component, number, 0, first, second, 0, 0, 0, 0, 0)


def mode(number: int) -> Message:
    return command(common.MAV_CMD_DO_SET_MODE, 1.0, float(number))


def arming(arms: float) -> Message:
    return command(common.MAV_CMD_COMPONENT_ARM_DISARM, arms)


def stick(x: int, y: int) -> Message:
    return common.MAVLink_manual_control_message(1, x, y, 500, 0, 0)


def starts() -> list[Message]:
    """All that could be taken for leave to turn a wheel, as a station would send it."""
    arm, set_mode = common.MAV_CMD_COMPONENT_ARM_DISARM, common.MAV_CMD_DO_SET_MODE
    ahead = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    return [
        command(arm, 1.0), command(arm, 1.0, 21196.0), command(arm, 1.0, target=0),
        common.MAVLink_command_int_message(1, 1, 0, arm, 0, 0, 1.0, 21196.0, 0, 0, 0, 0, 0),
        *(command(set_mode, 1.0, float(number)) for number in range(30) if number not in (4, 5)),
        *(command(set_mode, base, 0.0) for base in (128.0, 192.0, 194.0, 208.0, 216.0, 220.0)),
        *(common.MAVLink_set_mode_message(1, base, 10) for base in (1, 128, 217, 220)),
        *(command(common.MAV_CMD_DO_SET_STANDARD_MODE, float(number)) for number in (0, 2, 3, 5, 6, 8)),
        command(common.MAV_CMD_DO_PAUSE_CONTINUE, 1.0), command(common.MAV_CMD_OVERRIDE_GOTO, 1.0),
        command(common.MAV_CMD_DO_FLIGHTTERMINATION, 0.0), command(common.MAV_CMD_MISSION_START),
        command(common.MAV_CMD_NAV_WAYPOINT), command(common.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        command(common.MAV_CMD_NAV_TAKEOFF), command(common.MAV_CMD_DO_REPOSITION, 1.0),
        command(common.MAV_CMD_DO_CHANGE_SPEED, 1.0, 5.0), command(common.MAV_CMD_DO_MOTOR_TEST, 1.0, 1.0),
        command(common.MAV_CMD_DO_SET_SERVO, 1.0, 2000.0), command(common.MAV_CMD_DO_SET_ACTUATOR, 1.0, 1.0),
        command(common.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0),
        stick(1000, 0), stick(0, 1000),
        common.MAVLink_rc_channels_override_message(1, 1, *[2000] * 8),
        common.MAVLink_set_position_target_local_ned_message(0, 1, 1, common.MAV_FRAME_LOCAL_NED, 0, *ahead),
        common.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0, 1.0),
        common.MAVLink_set_actuator_control_target_message(0, 0, 1, 1, [1.0] * 8),
        common.MAVLink_setup_signing_message(1, 1, list(range(32)), 1),
        common.MAVLink_param_set_message(1, 1, b"LINK_LOST_HOLD", 1.0, common.MAV_PARAM_TYPE_REAL32),
        common.MAVLink_serial_control_message(0, 0, 0, 0, 3, [1, 2, 3, *[0] * 67]),
    ]  # fmt: skip


class Rover:
    """What a station can ask for; keeps what it was asked, by whatever name of ``Commands``."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.refuses: str | None = None
        self.breaks: Exception | None = None

    def __getattr__(self, name: str) -> Callable[..., Awaitable[Details]]:
        async def note(text: str = "") -> Details:
            self.asked.append(f"{name}: {text}" if text else name)
            if self.refuses is not None:
                raise RequestRefused(self.refuses)
            if self.breaks is not None:
                raise self.breaks
            return {}

        return note


class FakePort:
    """A link without wires: keeps what the rover sends; ``receive`` is what the station sends."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.is_near = True
        self.is_served = True
        self.sender = ("192.168.1.5", 14550)
        self.broken = False
        self._ready: Callable[[], None] = lambda: None
        self._data = b""
        self._reader = FrameReader()

    def listen(self, ready: Callable[[], None]) -> None:
        self._ready = ready

    def read(self, now_s: float) -> Iterator[tuple[bytes, bool]]:
        if self.broken:
            raise OSError("unplugged")
        data, self._data = self._data, b""
        for frame in self._reader.feed(data, now_s):
            yield frame, self.is_near

    def receive(self, data: bytes) -> None:
        self._data = data
        self._ready()

    def write(self, frame: bytes) -> None:
        self.sent.append(frame)

    def serve(self) -> bool:
        return self.is_served

    def forget(self) -> None: ...

    def close(self) -> None: ...


class Linked:
    """A rover with its link, in virtual time."""

    def __init__(self, settings: MavlinkSettings, port: FakePort) -> None:
        self.port = port
        self.rover = Rover()
        self.station = GroundStation(STATION, load_rover("sim").model_copy(update={"mavlink": settings}))
        self.log = run_log(self.station.show, simulated=False)
        self.encoder = Encoder()

    async def says(self, *messages: Message) -> None:
        """Send messages of the station, and let the rover take them."""
        for message in messages:
            self.port.receive(self.encoder.frame(message))
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
    monkeypatch: pytest.MonkeyPatch, settings: MavlinkSettings = USUAL, commands: object = None
) -> AsyncIterator[Linked]:
    """Give a link as a task group of the daemon would have it, to ``commands`` or a rover that only takes notes."""
    port = FakePort()
    monkeypatch.setattr("wayfarer.remote.mavlink.link.open_port", lambda _address, _devices: port)
    made = Linked(settings, port)
    async with made.station.serving(cast(Commands, commands or made.rover)):
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
