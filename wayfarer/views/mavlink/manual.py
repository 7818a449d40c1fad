"""Driving by the station's stick: MANUAL_CONTROL in, samples for the rover's manual mode out.

Only the axes x (forward) and y (to the right) count, those of one stick that springs back. The throttle z does not:
stations disagree whether its middle is 0 or 500, and a throttle that stands at "no way" of the one drives the other.
The rover itself asks that the stick is let go at the beginning and after a hold (``safety.manual``); here it must be
let go after each silence too, because the person may have lost sight of the rover meanwhile. A message that comes twice
counts once. MAVLink does not say when a sample was taken (the time of a signature only counts messages at most
stations), so a sample is as old as its arrival: a link that delays all messages alike is not noticed.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress

from pymavlink.dialects.v20 import common

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import WayfarerError
from wayfarer.views.mavlink.telemetry import Telemetry

FULL = 1000  # at full deflection; an axis that a station does not have is 32,767
MIDDLE = 50  # as the dead zone of 0.05 of joy in ROS

Sender = tuple[int, int]  # system and component


class StickDriving:
    """One station's stick.

    Args:
        commands: those of the daemon.
        telemetry: the run so far.
    """

    def __init__(self, commands: Commands, telemetry: Telemetry) -> None:
        self._commands = commands
        self._telemetry = telemetry
        self._lease: int | None = None
        self._sender: Sender | None = None
        self._deadman_s = 0.0
        self._centred = False
        self._count = 0
        self._last_sequence: int | None = None
        self._at_s = float("-inf")
        self._sending: asyncio.Task[None] | None = None

    async def begin(self, sender: Sender) -> None:
        """Enter manual mode; from now on the stick of this sender drives.

        Raises:
            Refused: it is not allowed, somebody else drives, or the rover cannot.
        """
        details = await self._commands.manual_begin("mavlink")
        self._lease, self._deadman_s = _integer(details["lease"]), _number(details["deadman_s"])
        self._sender, self._centred, self._count, self._last_sequence = sender, False, 0, None

    async def end(self) -> None:
        """Leave manual mode, if this station drives."""
        lease, self._lease = self._lease, None
        if lease is not None and self._telemetry.state.mode == "manual":
            await self._commands.manual_end(lease)

    def take(self, stick: common.MAVLink_manual_control_message, sender: Sender, sequence: int, now_s: float) -> None:
        """Take a sample; ``sequence`` is the sender's number of the frame. Does not wait."""
        if self._telemetry.state.mode != "manual":
            self._lease = None  # somebody has ended it
        if self._lease is None or sender != self._sender or sequence == self._last_sequence:
            return
        if not (abs(stick.x) <= FULL and abs(stick.y) <= FULL):
            return  # no stick, or none with these axes
        if now_s - self._at_s > self._deadman_s:
            self._centred = False
        self._at_s, self._last_sequence = now_s, sequence
        forward, turn = (0.0 if abs(axis) <= MIDDLE else axis / FULL for axis in (stick.x, stick.y))
        self._centred = self._centred or forward == turn == 0.0
        if not self._centred:
            forward = turn = 0.0
        if self._sending is None or self._sending.done():  # else a newer sample follows
            self._count += 1
            sample = self._send(self._lease, self._count, forward, turn, now_s)
            self._sending = asyncio.get_running_loop().create_task(sample, name="mavlink stick")

    async def _send(self, lease: int, count: int, forward: float, turn: float, now_s: float) -> None:
        with suppress(WayfarerError):  # too late, or no longer ours: the wheels stand
            await self._commands.manual_drive(lease, count, forward, turn, now_s)


def _integer(value: object) -> int:
    assert isinstance(value, int)
    return value


def _number(value: object) -> float:
    assert isinstance(value, int | float)
    return float(value)
