"""Keeps the link open, signs what goes out, and judges what comes in. Nothing that happens to it stops the rover."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from pymavlink.dialects.v20 import common

from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.views.mavlink.address import Address
from wayfarer.views.mavlink.frames import Frame
from wayfarer.views.mavlink.ports import Port, open_port
from wayfarer.views.mavlink.signing import Signing

AGAIN_S = 2.0  # between two tries to open it
RENEW_S = 20.0  # of silence: a UDP socket keeps the address of a network that the computer has left
TIME_TOLD_S = 0.1  # so often at most our time is told to those who are behind it: an enemy may send recorded frames
COMPONENT = common.MAV_COMP_ID_AUTOPILOT1

_log = logging.getLogger("wayfarer.views.mavlink")


class Received(NamedTuple):
    """A message that may be heard. ``signed``: by somebody with the key; ``local``: from this computer."""

    message: common.MAVLink_message
    sequence: int
    system: int
    component: int
    signed: bool
    local: bool


class Link:
    """One link to one station.

    ``heard_s`` is the loop's time at which a station's heartbeat last came, ``refused`` how many frames were not
    believed.

    Args:
        address: where it goes.
        system_id: the rover's number.
        devices: the device files of the rover's parts, which are no link.
        signing: checks and signs; None: there is no key.
        on_message: takes what is believed; must not wait.
    """

    def __init__(
        self, address: Address, system_id: int, devices: tuple[str, ...], signing: Signing | None,
        on_message: Callable[[Received], None],
    ) -> None:  # fmt: skip
        self._address = address
        self._devices = devices
        self._signing = signing
        self._on_message = on_message
        self._encoder = common.MAVLink(None, system_id, COMPONENT)
        self._decoder = common.MAVLink(None)  # it is told no key: ``signing`` has checked before
        if signing is not None:
            self._encoder.signing.secret_key, self._encoder.signing.sign_outgoing = signing.key, True
        self._port: Port | None = None
        self._broken = asyncio.Event()
        self.heard_s = float("-inf")
        self.refused = 0
        self._time_told_s = float("-inf")

    async def run(self) -> None:
        """Keep the link open until cancelled."""
        told = ""
        while True:
            try:
                port = await self._opened()
            except (OSError, BadInput) as error:
                why = getattr(error, "strerror", None) or str(error)
                if told != why:  # once, not every two seconds
                    told = why
                    _log.warning(
                        "MAVLink at %s does not open (tried again every %g s): %s", self._address, AGAIN_S, told
                    )
                await asyncio.sleep(AGAIN_S)
                continue
            told, self._port = "", port
            self._broken.clear()
            port.listen(self._read)
            try:
                await self._wait_until_broken()
            finally:
                self._port = None
                port.close()

    async def _opened(self) -> Port:
        if self._address.kind == "serial":  # a driver may take its time
            return await asyncio.to_thread(open_port, self._address, self._devices)
        return open_port(self._address, self._devices)

    async def _wait_until_broken(self) -> None:
        time = asyncio.get_running_loop().time
        opened_s = time()
        while not self._broken.is_set():
            with suppress(TimeoutError):
                async with asyncio.timeout(RENEW_S):
                    await self._broken.wait()
            if self._address.kind == "udpout" and time() - max(opened_s, self.heard_s) >= RENEW_S:
                return
        await asyncio.sleep(AGAIN_S)

    def send(self, message: common.MAVLink_message) -> int:
        """Send a message; return how many bytes it has, 0 where the link is not open."""
        if self._port is None:
            return 0
        data = self._packed(message)
        try:
            self._port.write(data)
        except OSError:
            self._broken.set()
        return len(data)

    def _packed(self, message: common.MAVLink_message) -> bytes:
        if self._signing is not None:
            t_s = asyncio.get_running_loop().time()
            self._encoder.signing.timestamp = self._signing.now_ticks(wall_clock(t_s), t_s)
        data: bytes = message.pack(self._encoder)
        self._encoder.seq = (self._encoder.seq + 1) % 256
        return data

    def station_is_silent(self) -> None:
        """Let another station take the place of the one that is silent."""
        if self._port is not None:
            self._port.forget()

    def _read(self) -> None:
        port = self._port
        if port is None:
            return
        try:
            for frame, local in port.read(asyncio.get_running_loop().time()):
                self._take(frame, local)
        except OSError:
            port.close()  # or its descriptor would stay readable, and keep the loop busy
            self._port = None
            self._broken.set()
        except Exception:
            _log.exception("in taking what a ground station sent")

    def _take(self, frame: Frame, local: bool) -> None:
        """Believe a frame or not. Without a key everything may be heard; ``station`` decides what may be done."""
        signed = self._signing is not None and self._signing.is_genuine(frame)
        is_radio = frame.message_id == common.MAVLINK_MSG_ID_RADIO_STATUS  # a radio has no key
        if self._signing is not None and not signed and not is_radio:
            self.refused += 1
            self._tell_time(self._signing, frame)
            return
        try:
            message = self._decoder.decode(bytearray(frame.data))
        except common.MAVError:
            return  # a text that is no UTF-8
        if isinstance(message, common.MAVLink_heartbeat_message) and message.type == common.MAV_TYPE_GCS:
            # Nothing else: another vehicle may have the same key, and an enemy may send our own messages back to us.
            self.heard_s = asyncio.get_running_loop().time()
            if self._port is not None:
                self._port.believe()
        self._on_message(Received(message, frame.sequence, frame.system, frame.component, signed, local))

    def _tell_time(self, signing: Signing, frame: Frame) -> None:
        """Tell our signing time to a sender who has the key, but whose time is behind ours, as after a restart.

        Stations go on from the latest time that they hear. To ``udpin`` nothing is sent before a station is believed,
        so it would never hear ours.
        """
        t_s = asyncio.get_running_loop().time()
        if self._port is None or t_s - self._time_told_s < TIME_TOLD_S or not signing.has_key(frame):
            return
        self._time_told_s = t_s
        boot_ms = int(t_s * 1e3) % 2**32
        self._port.answer(self._packed(common.MAVLink_system_time_message(int(wall_clock(t_s) * 1e6), boot_ms)))
