"""A ground station: shows it the run, and does what it may ask for; implements ``daemon.daemon.Viewer``.

Nothing here waits for the station, and what goes out and comes in is bounded: bytes by a budget, texts by a queue,
orders by their kinds, frames by one read in a turn of the loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from pymavlink.dialects.v20 import common

from wayfarer.commissioning.checks.system import device_files
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.rate import Rate, RateLimiter
from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.wording import plural
from wayfarer.views.mavlink import answers
from wayfarer.views.mavlink.address import Address
from wayfarer.views.mavlink.budget import Budget, Stream
from wayfarer.views.mavlink.link import Link, Received
from wayfarer.views.mavlink.manual import StickDriving
from wayfarer.views.mavlink.modes import Order, asked_for
from wayfarer.views.mavlink.orders import Orders
from wayfarer.views.mavlink.signing import RESERVED_S, Signing, TimeFile
from wayfarer.views.mavlink.telemetry import Telemetry
from wayfarer.views.mavlink.texts import StatusTexts

LOOK_HZ = 20.0  # how often the streams are looked at: as often as the fastest may be sent
REFUSED_S = 30.0  # between two texts about messages that were not believed
HELD = ("arming", "armed")  # the modes in which a lost link may hold the wheels

_log = logging.getLogger("wayfarer.views.mavlink")


class GroundStation:
    """The link to one ground station.

    Args:
        address: where it is.
        config: the rover; ``mavlink`` in it says what a station gets and may do.
        signing: whose messages are believed, and what signs ours; None without a key.
        time_file: keeps the time of ``signing``; None without a key.
    """

    def __init__(
        self, address: Address, config: RoverConfig, signing: Signing | None, time_file: TimeFile | None
    ) -> None:
        self._address = address
        self._settings = settings = config.mavlink
        self._devices = device_files(config)
        self._signing = signing
        self._time_file = time_file
        self._telemetry = telemetry = Telemetry(config.declination_deg)
        self._texts = StatusTexts()
        self._answers = answers.Answers(settings)
        self._budget = Budget(settings.bytes_per_s)
        self._refusals = RateLimiter()
        self._refused_told, self._refused_told_s = 0, float("-inf")
        self._is_connected = False
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
        self._on_request = {
            common.MAVLINK_MSG_ID_AUTOPILOT_VERSION: answers.version,
            common.MAVLINK_MSG_ID_HEARTBEAT: telemetry.heartbeat,
            common.MAVLINK_MSG_ID_ATTITUDE: telemetry.attitude,
            common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: telemetry.position,
            common.MAVLINK_MSG_ID_SYS_STATUS: telemetry.health,
        }

    def show(self, record: Record) -> None:
        """Take a record."""
        self._texts.take(self._telemetry.take(record))

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        """Keep the link while entered; the last texts are still sent at the end."""
        self._commands = commands
        self._stick = StickDriving(commands, self._telemetry)
        self._orders = Orders(commands, self._stick, self._settings, self._telemetry, self._tell)
        self._link = Link(self._address, self._settings.system_id, self._devices, self._signing, self._take)
        loop = asyncio.get_running_loop()
        tasks = [
            loop.create_task(self._link.run(), name="mavlink link"),
            loop.create_task(self._tell_regularly(), name="mavlink streams"),
            loop.create_task(self._keep_time(), name="mavlink time"),
        ]
        try:
            yield
        finally:
            while self._texts:
                self._send(*self._texts.pop())
            self._send(*self._telemetry.heartbeat())
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, self._orders.end(), return_exceptions=True)

    # -- to the station ------------------------------------------------------------------------------------------

    async def _tell_regularly(self) -> None:
        rate = Rate(LOOK_HZ)
        while True:
            await rate.wait()
            now_s = asyncio.get_running_loop().time()
            self._budget.fill(now_s)
            await self._watch_link(now_s)
            self._send_due(now_s)

    def _send_due(self, now_s: float) -> None:
        for stream in list(self._streams):
            if stream.is_due(now_s) and (self._budget.is_left or stream.always):
                try:
                    self._send(*stream.make())
                except Exception:  # a bug must not end the others, nor the watch on the link
                    self._streams.remove(stream)
                    _log.exception("in telling a ground station: this is not told any more")
                stream.sent(now_s)
        if self._is_connected and self._texts and self._budget.is_left:
            self._send(*self._texts.pop())

    def _send(self, *messages: common.MAVLink_message) -> None:
        for message in messages:
            self._budget.spend(self._link.send(message))

    def _tell(self, text: str) -> None:
        """Queue a text for the person at the station, unless there are too many."""
        if self._refusals.take(asyncio.get_running_loop().time()):
            self._texts.add(text, common.MAV_SEVERITY_WARNING)

    async def _watch_link(self, now_s: float) -> None:
        """Notice that the station came or went, and do what the rover file says."""
        was_connected, self._is_connected = self._is_connected, now_s - self._link.heard_s <= self._settings.link_lost_s
        if was_connected and not self._is_connected:
            self._link.station_is_silent()
            holds = self._settings.on_link_lost == "hold" and self._telemetry.state.mode in HELD
            if holds:
                with suppress(WayfarerError):
                    await self._commands.hold()
            with suppress(WayfarerError):
                await self._commands.link_lost(f"the ground station is silent{': held' if holds else ''}")
        refused = self._link.refused - self._refused_told
        if refused and now_s - self._refused_told_s > REFUSED_S:
            self._refused_told, self._refused_told_s = self._link.refused, now_s
            text = f"{plural(refused, 'message')} ignored: not signed with our key"
            self._send(*self._texts.chunks(text, common.MAV_SEVERITY_WARNING))  # now: nobody is believed to listen

    async def _keep_time(self) -> None:
        """Reserve the signing time of the next minutes, so that no restart makes it go back."""
        told = ""
        while self._signing is not None and self._time_file is not None:
            try:
                await asyncio.to_thread(self._time_file.write, self._signing.reserve())
            except (OSError, WayfarerError) as error:
                if told != str(error):
                    told = str(error)
                    _log.warning("the time of MAVLink's signatures is not kept over a restart: %s", told)
            await asyncio.sleep(RESERVED_S / 2.0)

    # -- from the station ----------------------------------------------------------------------------------------

    def _take(self, received: Received) -> None:
        """Take a message that may be heard."""
        message, own = received.message, self._settings.system_id
        match message:
            case common.MAVLink_radio_status_message(txbuf=txbuf):
                self._budget.radio_says(txbuf)
            case common.MAVLink_manual_control_message(target=target) if target == own:
                if not self._orders.why_not(Order.MANUAL, received):
                    sender = received.system, received.component
                    self._stick.take(message, sender, received.sequence, asyncio.get_running_loop().time())
            case common.MAVLink_set_mode_message(target_system=target) if target == own:
                self._command(received, common.MAV_CMD_DO_SET_MODE, message.base_mode, message.custom_mode)
            case common.MAVLink_command_long_message() | common.MAVLink_command_int_message():
                if message.target_system == own:
                    self._command(received, message.command, message.param1, message.param2)
            case _ if getattr(message, "target_system", None) == own and self._budget.is_left:
                self._send(*self._answers.to(message, received.system, received.component))

    def _command(self, received: Received, command: int, first: float, second: float) -> None:
        def answer(result: int) -> None:
            if result == common.MAV_RESULT_DENIED and not self._budget.is_left:
                return  # anybody can ask: what is told of the rover must not wait for that
            self._send(common.MAVLink_command_ack_message(command, result, 0, 0, received.system, received.component))

        order = asked_for(command, first, second)
        if order is not None:
            self._orders.take(order, received, answer)
        elif self._budget.is_left:
            wanted = answers.on_request(self._on_request, first) if command == common.MAV_CMD_REQUEST_MESSAGE else None
            answer(common.MAV_RESULT_UNSUPPORTED if wanted is None else common.MAV_RESULT_ACCEPTED)
            if wanted is not None:
                self._send(wanted)
