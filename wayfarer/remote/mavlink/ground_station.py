"""A ground station: shows it the run, and holds or disarms the rover for it; implements ``daemon.daemon.Viewer``.

Nothing that comes over MAVLink starts a wheel: of the daemon's commands only ``hold`` and ``disarm`` are here, so no
message needs to be believed. Nothing waits for the station. What goes out is bounded by a budget of bytes, what comes
in by one read in a turn of the loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from math import isfinite
from typing import Literal

from pymavlink.dialects.v20 import common

from wayfarer.commissioning.checks.system import device_files
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.rate import Rate, RateLimiter
from wayfarer.daemon.socket.protocol import Commands, RequestRefused
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.record import AnyRecord
from wayfarer.remote.mavlink.link import COMPONENT, Address, Link
from wayfarer.remote.mavlink.telemetry import MODE_HOLD, MODE_LOITER, Answers, Messages, StatusTexts, Telemetry, version

LOOK_HZ = 20.0  # how often the streams are looked at: as often as the fastest may be sent
HELD = ("arming", "armed")  # the modes in which a lost link may hold the wheels
NOT_FROM_HERE = "a ground station can only hold and disarm; use wayfarer arm, wayfarer resume, or the live page"
NOT_FROM_THERE = "it came from another computer: network_may_stop in [mavlink] of the rover file is false"

_log = logging.getLogger("wayfarer.remote.mavlink")

# -- MAVLink's names for stop ------------------------------------------------------------------------------------------

Stop = Literal["hold", "disarm"]
# Of a command (MAV_CMD) the value of its first parameter that stops; the others start something, and are denied.
STOPS: Mapping[int, Mapping[float, Stop]] = {
    common.MAV_CMD_COMPONENT_ARM_DISARM: {0.0: "disarm"},
    common.MAV_CMD_DO_PAUSE_CONTINUE: {0.0: "hold"},
    common.MAV_CMD_OVERRIDE_GOTO: {float(common.MAV_GOTO_DO_HOLD): "hold"},
    common.MAV_CMD_DO_SET_STANDARD_MODE: {float(common.MAV_STANDARD_MODE_POSITION_HOLD): "hold"},
    common.MAV_CMD_DO_SET_MODE: {
        float(mode): "disarm"
        for mode in (
            common.MAV_MODE_PREFLIGHT, common.MAV_MODE_MANUAL_DISARMED, common.MAV_MODE_STABILIZE_DISARMED,
            common.MAV_MODE_GUIDED_DISARMED, common.MAV_MODE_AUTO_DISARMED, common.MAV_MODE_TEST_DISARMED,
        )
    },
}  # fmt: skip
HOLD_MODES = (MODE_HOLD, MODE_LOITER)  # the second parameter of DO_SET_MODE, if the first says that it counts
# From NAV_WAYPOINT to COMPONENT_ARM_DISARM: what a person sends. Above are questions, which stations ask by themselves.
OF_A_PERSON = range(16, 401)


def stop_asked_for(command: int, first: float, second: float) -> Stop | None:
    """Return which stop a command with these two parameters asks for; None if it is none.

    Parameters that are no such value, NaN among them, ask for nothing.
    """
    match command:
        case common.MAV_CMD_NAV_LOITER_UNLIM:
            return "hold"
        case common.MAV_CMD_DO_FLIGHTTERMINATION:
            return "disarm" if first > 0.5 else None
        case common.MAV_CMD_DO_SET_MODE if isfinite(first) and int(first) & common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return "hold" if second in HOLD_MODES else None
    return STOPS.get(command, {}).get(first)


# -- how much goes out -------------------------------------------------------------------------------------------------


class Budget:
    """A bucket of the bytes of a second, which fills at ``bytes_per_s``."""

    def __init__(self, bytes_per_s: float) -> None:
        self._bytes_per_s = self._left = bytes_per_s
        self._at_s: float | None = None

    def fill(self, now_s: float) -> None:
        """Let time pass."""
        passed_s = 0.0 if self._at_s is None else now_s - self._at_s
        self._at_s = now_s
        self._left = min(self._bytes_per_s, self._left + passed_s * self._bytes_per_s)

    @property
    def is_left(self) -> bool:
        """Whether a message may go; the last one may be longer than what is left."""
        return self._left > 0.0

    def spend(self, count: int) -> None:
        """Count bytes that went out; what always goes makes a debt of a second at most."""
        self._left = max(-self._bytes_per_s, self._left - count)


class Stream:
    """Messages that are sent ``rate_hz`` times per second, made of the newest state; ``always``: at any budget."""

    def __init__(self, make: Callable[[], Messages], rate_hz: float, *, always: bool = False) -> None:
        self.make = make
        self.always = always
        self._period_s = 1.0 / rate_hz
        self._due_s = float("-inf")

    def is_due(self, now_s: float) -> bool:
        """Return whether it is time."""
        return now_s >= self._due_s

    def sent(self, now_s: float) -> None:
        """Note that they went out; periods that were missed are skipped."""
        self._due_s = max(self._due_s, now_s - self._period_s) + self._period_s


# -- the station -------------------------------------------------------------------------------------------------------


class GroundStation:
    """The link to one ground station.

    Args:
        address: where it is.
        config: the rover; ``mavlink`` in it says what a station gets and may do.
    """

    def __init__(self, address: Address, config: RoverConfig) -> None:
        self._settings = settings = config.mavlink
        self._link = Link(address, settings.system_id, device_files(config), self._receive)
        self._telemetry = telemetry = Telemetry(config.declination_deg)
        self._texts = StatusTexts()
        self._answers = Answers(settings)
        self._budget = Budget(settings.bytes_per_s)
        self._refusals = RateLimiter()
        self._stopping: set[asyncio.Task[None]] = set()
        # The most important first: what the budget does not reach waits.
        self._streams = [
            Stream(telemetry.heartbeat, 1.0, always=True),
            Stream(telemetry.attitude, settings.attitude_hz),
            Stream(telemetry.position, settings.position_hz),
            Stream(telemetry.health, 1.0),
            Stream(telemetry.values, settings.values_hz),
            Stream(telemetry.speed, settings.position_hz),
            Stream(telemetry.receiver, 1.0),
            Stream(telemetry.battery, 0.5),
        ]

    def show(self, record: AnyRecord) -> None:
        """Show a record."""
        self._texts.add_events(self._telemetry.add(record))

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        """Keep the link while entered; the last texts are still sent at the end."""
        self._do: dict[Stop, Callable[[], Awaitable[object]]] = {"hold": commands.hold, "disarm": commands.disarm}
        self._note_loss = commands.link_lost
        loop = asyncio.get_running_loop()
        tasks = [
            loop.create_task(self._link.run(), name="mavlink link"),
            loop.create_task(self._tell_regularly(), name="mavlink streams"),
        ]
        try:
            yield
        finally:
            while self._texts:
                self._send(*self._texts.pop())
            self._send(*self._telemetry.heartbeat())
            for task in (*tasks, *self._stopping):
                task.cancel()
            await asyncio.gather(*tasks, *self._stopping, return_exceptions=True)

    # -- to the station ------------------------------------------------------------------------------------------

    async def _tell_regularly(self) -> None:
        rate = Rate(LOOK_HZ)
        while True:
            await rate.wait()
            now_s = asyncio.get_running_loop().time()
            self._budget.fill(now_s)
            self._link.look()  # a stop behind a stray marker must not wait for the station's next byte
            await self._watch_link(now_s)
            self._send_due(now_s)

    def _send_due(self, now_s: float) -> None:
        for stream in list(self._streams):
            if stream.is_due(now_s) and (self._budget.is_left or stream.always):
                try:
                    self._send(*stream.make())
                except Exception:  # a bug must not end the others, nor the watch on the link
                    self._streams.remove(stream)
                    _log.exception("in sending to a ground station: this is not sent any more")
                stream.sent(now_s)
        if self._link.is_served and self._texts and self._budget.is_left:
            self._send(*self._texts.pop())

    def _send(self, *messages: common.MAVLink_message) -> None:
        for message in messages:
            self._budget.spend(self._link.send(message))

    def _tell(self, text: str) -> None:
        """Queue a text for the person at the station, unless there are too many."""
        if self._refusals.take(asyncio.get_running_loop().time()):
            self._texts.add(text, common.MAV_SEVERITY_WARNING)

    async def _watch_link(self, now_s: float) -> None:
        """Notice that the station that was served has gone, and do what the rover file says."""
        if self._link.is_served and now_s - self._link.heard_s > self._settings.link_lost_s:
            self._link.station_is_silent()
            holds = self._settings.on_link_lost == "hold" and self._telemetry.state.mode in HELD
            held = holds and await _is_done(self._do["hold"]())
            await _is_done(self._note_loss(f"the ground station is silent{': held' if held else ''}"))

    # -- from the station ----------------------------------------------------------------------------------------

    def _receive(self, message: common.MAVLink_message, is_near: bool) -> None:
        """Take a message; ``is_near``: of a program on this computer, or of a serial line."""
        is_for_us = (  # 0: for everybody; a message that names no component is for all of a system
            getattr(message, "target_system", None) in (self._settings.system_id, 0)
            and getattr(message, "target_component", 0) in (COMPONENT, 0)
        )
        match message:
            case common.MAVLink_set_mode_message() if is_for_us:
                self._command(message, common.MAV_CMD_DO_SET_MODE, (message.base_mode, message.custom_mode), is_near)
            case common.MAVLink_command_long_message() | common.MAVLink_command_int_message() if is_for_us:
                self._command(message, message.command, (message.param1, message.param2), is_near)
            case _ if is_for_us and self._budget.is_left:
                self._send(*self._answers.to(message))

    def _command(
        self, message: common.MAVLink_message, command: int, values: tuple[float, float], is_near: bool
    ) -> None:
        """Begin to stop the rover, or answer something else while the budget lasts: anybody can ask."""

        def answer(result: int) -> None:
            sender = message.get_srcSystem(), message.get_srcComponent()
            self._send(common.MAVLink_command_ack_message(command, result, 0, 0, *sender))

        stop = stop_asked_for(command, *values)
        if stop is not None and (is_near or self._settings.network_may_stop):
            # Neither stop waits for anything, so those of one read are done before the next.
            doing = asyncio.get_running_loop().create_task(self._stop(stop, answer), name=f"mavlink {stop}")
            self._stopping.add(doing)
            doing.add_done_callback(self._stopping.discard)
        elif not self._budget.is_left:
            return
        elif command == common.MAV_CMD_REQUEST_MESSAGE and values[0] == common.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            answer(common.MAV_RESULT_ACCEPTED)
            self._send(version())
        else:
            if command in OF_A_PERSON:
                self._tell(NOT_FROM_HERE if stop is None else f"{stop} refused: {NOT_FROM_THERE}")
            is_denied = stop is not None or command in STOPS
            answer(common.MAV_RESULT_DENIED if is_denied else common.MAV_RESULT_UNSUPPORTED)

    async def _stop(self, stop: Stop, answer: Callable[[int], None]) -> None:
        result = common.MAV_RESULT_FAILED
        try:
            await self._do[stop]()
            result = common.MAV_RESULT_ACCEPTED
        except RequestRefused as refusal:
            result = common.MAV_RESULT_TEMPORARILY_REJECTED
            self._tell(f"{stop} refused: {refusal}")
        except WayfarerError as error:
            self._tell(f"{stop} failed: {error}")
        except Exception:
            _log.exception("in carrying out %s", stop)
            self._tell(f"{stop} failed: an error inside wayfarer")
        answer(result)


async def _is_done(doing: Awaitable[object]) -> bool:
    """Return whether this could be done of what a lost link asks for; the next loss must be noticed in any case."""
    try:
        await doing
    except WayfarerError:
        return False
    except Exception:
        _log.exception("in doing what a lost link asks for")
        return False
    return True
