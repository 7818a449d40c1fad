"""The motor boards, each on a wire that can be troubled, over a world; nothing has spoken to them yet."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Self

from tests.simhal.clearing import steady_world
from wayfarer.drivers.roboclaw import RoboClaw, RoboClawSettings
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.drivers.thunderborg_board import ThunderBorgLight, ThunderBorgLightSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import DriveMotors
from wayfarer.simhal.buses import FakeBuses, FakeSerial
from wayfarer.simhal.chips.motor_boards import SabertoothChip, ThunderBorgChip
from wayfarer.simhal.chips.roboclaw import RoboClawChip
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

WIRING = ("left", "reverse_left", "reverse_right")


def now_s() -> float:
    """The time on the loop, and zero before it runs: a fixture makes its chips before that."""
    try:
        return asyncio.get_running_loop().time()
    except RuntimeError:
        return 0.0


def stall(for_s: float) -> None:
    """Let time pass without the loop, as in a process that is suspended."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stall(for_s)


class MotorBench:
    """A motor board and its driver; the wire between them keeps in ``seen`` what each write brought."""

    motors: DriveMotors

    def __init__(self, steps: float, settings: Any) -> None:
        self.steps = steps * settings.duty_limit
        self.wiring = {"full_level": self.steps} | {key: getattr(settings, key) for key in WIRING}
        self.world = steady_world()
        self.buses = FakeBuses()
        self.seen: list[bytes] = []

    async def opened(self) -> Self:
        """This bench with open motors, of which nothing is in ``sent``."""
        await self.motors.open()
        self.sent()
        return self

    def sent(self) -> list[str]:
        """Return what was written since this was asked last, a string for each write."""
        sent = [data.hex(" ").upper() for data in self.seen]
        self.seen.clear()
        return sent


class ThunderBorgBench(MotorBench):
    """A ThunderBorg at the end of a cable: the next writes fail, or some are lost although acknowledged.

    ``garbled`` is how many answers to a command come back with a wrong echo, ``answers`` what is answered in place of
    the chip's own; at the write ``restarts_at`` the board loses its power for a moment.
    """

    Settings = ThunderBorgSettings
    motors: ThunderBorg

    def __init__(self, **settings: Any) -> None:
        given = ThunderBorgSettings(**settings)
        super().__init__(255, given)
        self.chip = ThunderBorgChip(self.world, now_s, **self.wiring)
        self.loose = self.failsafes_lost = 0
        self.garbled: dict[int, int] = {}
        self.answers: dict[int, bytes] = {}
        self.restarts_at: bytes | None = None
        self.buses.i2c(given.bus).attach(given.address, self)
        self.motors = ThunderBorg(given, self.buses)
        self.light = ThunderBorgLight(ThunderBorgLightSettings(), self.buses)

    def write(self, data: bytes) -> None:
        if data == self.restarts_at:
            self.restarts_at, self.loose = None, 1
            self.chip.power_cycle()
        if self.loose:
            self.loose -= 1
            raise NotResponding("/dev/i2c-1: no answer at address 0x15")
        self.seen.append(data)
        if data == b"\x13\x01" and self.failsafes_lost:
            self.failsafes_lost -= 1
        else:
            self.chip.write(data)

    def read(self, count: int) -> bytes:
        reply = self.chip.read(count)
        command = reply[0]
        if self.garbled.get(command):
            self.garbled[command] -= 1
            return b"\x07" + reply[1:]
        return bytes((command, *self.answers.get(command, reply[1:]))).ljust(count)

    @staticmethod
    def unreachable() -> ThunderBorg:
        """Motors whose board is not there."""
        return ThunderBorg(ThunderBorgSettings(), FakeBuses())


class SerialLine(FakeSerial):
    """A serial line whose cable is pulled out while it is ``gone``."""

    gone = False

    async def write(self, data: bytes) -> None:
        if self.gone:
            raise NotResponding(f"{self.name}: the port is gone; plug it in again")
        await super().write(data)


class SabertoothBench(MotorBench):
    """A Sabertooth on a serial line that loses the bytes ``lost`` of each write; an ``old_board`` wants an AA."""

    Settings = SabertoothSettings
    motors: Sabertooth

    def __init__(self, *, old_board: bool | None = None, **settings: Any) -> None:
        given = SabertoothSettings(**settings)
        super().__init__(127, given)
        old_board = given.autobaud if old_board is None else old_board
        self.chip = SabertoothChip(self.world, now_s, address=given.address, autobaud=old_board, **self.wiring)
        self.lost: set[int] = set()
        self.line = self.buses._serial[given.port] = SerialLine(given.port)
        self.line.attach(self)
        self.motors = Sabertooth(given, self.buses)

    def receive(self, data: bytes) -> bytes:
        self.seen.append(data)
        return self.chip.receive(bytes(byte for at, byte in enumerate(data) if at not in self.lost))

    @staticmethod
    def unreachable() -> Sabertooth:
        """Motors whose port is gone."""
        bench = SabertoothBench()
        bench.line.gone = True
        return bench.motors


class RoboClawBench(MotorBench):
    """A RoboClaw of some ``firmware`` at the end of a serial line.

    ``change`` is what the line makes of an answer, which it gets after what was asked; what was ``lost`` is not heard.
    """

    Settings = RoboClawSettings
    motors: RoboClaw

    def __init__(self, firmware: dict[str, Any] | None = None, **settings: Any) -> None:
        given = RoboClawSettings(**settings)
        super().__init__(32767, given)
        self.chip = RoboClawChip(self.world, now_s, address=given.address, **firmware or {}, **self.wiring)
        self.change: Callable[[bytes, bytes], bytes] = lambda _, answer: answer
        self.lost: Callable[[bytes], bool] = lambda _: False
        self.buses.serial(given.port).attach(self)
        self.motors = RoboClaw(given, self.buses)

    def receive(self, data: bytes) -> bytes:
        self.seen.append(data)
        return b"" if self.lost(data) else self.change(data, self.chip.receive(data))

    @staticmethod
    def unreachable() -> RoboClaw:
        """Motors whose board is not there."""
        return RoboClaw(RoboClawSettings(), FakeBuses())
