"""Driving by the station's stick: MANUAL_CONTROL in, samples for the rover's manual mode out.

Only the axes x (forward) and y (to the right) count, those of one stick that springs back. The throttle z does not:
stations disagree whether its middle is 0 or 500, and a throttle that stands at "no way" of the one drives the other.
A rover turns only after the stick has been seen in its middle, at the beginning and after each silence: whoever
connects again must let go first. A message that comes twice counts once.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import common

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import WayfarerError

FULL = 1000  # at full deflection
MIDDLE = 50  # as joy's dead zone of 0.05 in ROS
INVALID: Final = 0x7FFF  # an axis that is not there

Sender = tuple[int, int]  # system and component


class StickDriving:
    """One station's stick.

    Args:
        commands: those of the daemon.
        tell: takes a text for the person at the station.
    """

    def __init__(self, commands: Commands, tell: Callable[[str], None]) -> None:
        self._commands = commands
        self._tell = tell
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
        self._tell("manual: let the stick go to its middle first, then x drives and y turns")

    async def end(self) -> None:
        """Leave manual mode, if this station drives."""
        lease, self._lease = self._lease, None
        if lease is not None:
            await self._commands.manual_end(lease)

    def take(self, stick: common.MAVLink_manual_control_message, sender: Sender, sequence: int, now_s: float) -> None:
        """Take a sample; ``sequence`` is the sender's number of the frame. Does not wait."""
        if self._lease is None or sender != self._sender or sequence == self._last_sequence:
            return
        if not (abs(stick.x) <= FULL and abs(stick.y) <= FULL):
            return  # no stick, or none with these axes
        if now_s - self._at_s > self._deadman_s:
            self._centred = False
        self._at_s, self._last_sequence = now_s, sequence
        if abs(stick.x) <= MIDDLE and abs(stick.y) <= MIDDLE:
            self._centred = True
        forward, turn = (stick.x / FULL, stick.y / FULL) if self._centred else (0.0, 0.0)
        if self._sending is None or self._sending.done():  # else a newer sample follows
            self._count += 1
            sample = self._send(self._lease, self._count, forward, turn, now_s)
            self._sending = asyncio.get_running_loop().create_task(sample, name="mavlink stick")

    async def _send(self, lease: int, count: int, forward: float, turn: float, now_s: float) -> None:
        try:
            await self._commands.manual_drive(lease, count, forward, turn, now_s)
        except WayfarerError as refusal:
            if lease == self._lease:
                self._lease = None
                self._tell(f"manual mode has ended: {refusal}")


def _integer(value: object) -> int:
    assert isinstance(value, int)
    return value


def _number(value: object) -> float:
    assert isinstance(value, int | float)
    return float(value)
