"""Simulated buses that can hang, with faults on the wires, and which of a rover's parts is on which wire.

Without a fault they behave as ``simhal.buses``.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.drivers.buses import ANSWER_WITHIN_S, Camera, Frame, Missing, whole
from wayfarer.drivers.linux import FRAME_DEADLINE_S
from wayfarer.drivers.threaded import POSTED_MAX, TRANSFER_DEADLINE_S
from wayfarer.errors import NotResponding
from wayfarer.simhal.buses import ChipMisuse, FakeBuses, FakeI2C, FakeSerial, FakeSPI, I2CChip
from wayfarer.simhal.chip_wiring import driver_name

T = TypeVar("T")

# What a chip answers, and what it was asked with: what the driver gets instead.
AnswerChange = Callable[[bytes, bytes], bytes]
# What was written: what the chip gets instead, None if it receives nothing.
WriteChange = Callable[[bytes], bytes | None]


class Hang:
    """A bus as a driver sees it through the worker thread (``drivers.threaded``): carries transfers, or holds them up.

    The transfer that is under way when the bus hangs is done late, when it is back; its driver gets the error "no
    answer" after the deadline, and every further one at once. Stops that were posted go first after that.
    """

    def __init__(self, name: str, deadline_s: float = TRANSFER_DEADLINE_S) -> None:
        self._name = name
        self._deadline_s = deadline_s
        self._hangs = False
        self._under_way: Callable[[], Any] | None = None
        self._posted: deque[Callable[[], Any]] = deque(maxlen=POSTED_MAX)
        self._back = asyncio.Event()

    def begin(self) -> None:
        """Hold the bus."""
        self._hangs = True
        self._back.clear()

    def end(self) -> None:
        """Release it: first what was under way is done, then what was posted."""
        self._hangs = False
        late, self._under_way = self._under_way, None
        for job in (late, *self._posted):
            if job is not None:
                with suppress(NotResponding):
                    job()
        self._posted.clear()
        self._back.set()

    async def carry(self, job: Callable[[], T]) -> T:
        """Do a transfer.

        Raises:
            NotResponding: the bus hangs for longer than a transfer's deadline.
        """
        if not self._hangs:
            return job()
        if self._under_way is not None:
            raise NotResponding(f"{self._name}: an earlier transfer still hangs; a device holds the bus")
        done: list[T] = []
        self._under_way = lambda: done.append(job())
        try:
            async with asyncio.timeout(self._deadline_s):
                await self._back.wait()
        except TimeoutError:
            raise NotResponding(f"{self._name}: a transfer did not end within {self._deadline_s:g} s") from None
        if not done:
            raise NotResponding(f"{self._name}: no answer")
        return done[0]

    def post(self, job: Callable[[], Any]) -> None:
        """Do a transfer without waiting; it goes first when the bus is back."""
        if self._hangs:
            self._posted.append(job)
        else:
            with suppress(NotResponding):
                job()


class FaultyWire:
    """A chip behind a wire; speaks whichever of the three chip protocols the chip does.

    ``answers`` change what the chip sends, ``writes`` what it receives; ``unheard`` says for each transfer whether it
    is not acknowledged; ``late_s`` is how late an answer comes on a serial line.
    """

    def __init__(self, where: str, chip: Any = None) -> None:
        self.chip = chip
        self.answers: list[AnswerChange] = []
        self.writes: list[WriteChange] = []
        self.unheard: list[Callable[[], bool]] = []
        self.late_s = 0.0
        self._where = where
        self._asked = b""

    def check(self) -> None:
        """Acknowledge a transfer.

        Raises:
            NotResponding: it is not.
        """
        if any(is_lost() for is_lost in self.unheard):
            raise NotResponding(f"{self._where}: not acknowledged; a fault was injected")

    def _heard(self, data: bytes) -> bytes | None:
        for change in self.writes:
            changed = change(data)
            if changed is None:
                return None
            data = changed
        return data

    def _said(self, asked: bytes, answer: bytes) -> bytes:
        for change in self.answers:
            answer = change(asked, answer)
        return answer

    def write(self, data: bytes) -> None:
        """Take a write on an I2C bus."""
        self.check()
        self._asked = data
        if (heard := self._heard(data)) is not None:
            self.chip.write(heard)

    def read(self, count: int) -> bytes:
        """Give a read on an I2C bus."""
        self.check()
        return self._said(self._asked, self.chip.read(count))

    def exchange(self, data: bytes) -> bytes:
        """Exchange bytes on an SPI bus, where nothing acknowledges."""
        heard = self._heard(data)
        return self._said(data, bytes(len(data)) if heard is None else self.chip.exchange(heard))

    def receive(self, data: bytes) -> bytes:
        """Take bytes on a serial line; noise that comes out as a command that the chip does not know is passed over."""
        self.check()
        heard, answer = self._heard(data), b""
        if heard == data:
            answer = self.chip.receive(data)
        else:
            for byte in heard or b"":
                with suppress(ChipMisuse):
                    answer += self.chip.receive(bytes((byte,)))
        return self._said(data, answer) if answer else b""


class FaultyI2C(FakeI2C):
    """An I2C bus that can hang, with a wire to each address."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.hang = Hang(name)

    def attach(self, address: int, chip: I2CChip) -> None:
        """Put a chip at an address, behind a wire."""
        super().attach(address, FaultyWire(f"{self.name}: 0x{address:02X}", chip))

    async def write(self, address: int, data: bytes) -> None:
        """Write to the chip at an address."""
        await self.hang.carry(lambda: self.chip_at(address).write(data))

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, then read."""
        return await self.hang.carry(lambda: self._transfer(address, data, count))

    write_then_read = write_read

    def post(self, address: int, data: bytes) -> None:
        """Write without waiting."""
        self.hang.post(lambda: self.chip_at(address).write(data))


class FaultySPI(FakeSPI):
    """An SPI bus that can hang."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.hang = Hang(name)
        self.wire = FaultyWire(name)

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        """Exchange pieces with the chip."""

        def exchange() -> tuple[bytes, ...]:
            self.wire.check()
            self.wire.chip = self.chip
            return tuple(b"\xff" * len(piece) if self.chip is None else self.wire.exchange(piece) for piece in pieces)

        return await self.hang.carry(exchange)


class FaultySerial(FakeSerial):
    """A serial line that can hang."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.hang = Hang(name)
        self.wire = FaultyWire(name)
        self._coming: deque[tuple[float, bytes]] = deque()  # answers under way, and when they are here

    async def write(self, data: bytes) -> None:
        """Send bytes."""
        await self.hang.carry(lambda: self.send(data))

    async def exchange(self, data: bytes, missing: Missing, *, within_s: float = ANSWER_WITHIN_S) -> bytes:
        """Send bytes and return what comes back in time; nobody acknowledges, so a lost transfer is silence."""

        def ask() -> bytes:
            with suppress(NotResponding):
                return self.send(data)
            return b""

        time = asyncio.get_running_loop().time
        while self._coming and self._coming[0][0] <= time():
            self._coming.popleft()  # what came unasked
        self._coming.append((time() + self.wire.late_s, await self.hang.carry(ask)))
        answer, ends_s = b"", time() + within_s
        while missing(answer) > 0 and self._coming and self._coming[0][0] <= ends_s:
            due_s, came = self._coming.popleft()  # which may answer an earlier question
            if due_s > time():
                await asyncio.sleep(due_s - time())
            answer += came
        if missing(answer) > 0:
            await asyncio.sleep(ends_s - time())
        return whole(self.name, answer, missing, within_s)

    def post(self, data: bytes) -> None:
        """Send bytes without waiting."""
        self.hang.post(lambda: self.send(data))

    def send(self, data: bytes) -> bytes:
        """Send bytes at once and return what the chip answers."""
        self.wire.chip = self.chip
        return b"" if self.chip is None else self.wire.receive(data)


class FaultyCamera:
    """A camera that can hang, go, or show what is not there.

    ``shows`` change its pictures, one after another; ``last`` is the latest picture as it was handed on.
    """

    def __init__(self, camera: Camera) -> None:
        self.name = camera.name
        self.hang = Hang(camera.name, FRAME_DEADLINE_S)
        self.wire = FaultyWire(camera.name)
        self.shows: list[Callable[[Frame], Frame]] = []
        self.last: Frame | None = None
        self._camera = camera

    async def frame(self) -> Frame:
        """Return the next frame, changed."""
        await self.hang.carry(self.wire.check)
        frame = await self._camera.frame()
        for change in self.shows:
            frame = change(frame)
        self.last = frame
        return frame


class FaultyBuses(FakeBuses):
    """Hands out buses that can be made faulty, by name; ``views`` are the cameras that were handed out."""

    I2C, SPI, SERIAL = FaultyI2C, FaultySPI, FaultySerial

    def __init__(self) -> None:
        super().__init__()
        self.views: dict[str, FaultyCamera] = {}

    def camera(self, name: str, *, width: int, height: int, rate_hz: float, exposure_us: int | None) -> FaultyCamera:
        """Return the camera of that name."""
        camera = super().camera(name, width=width, height=height, rate_hz=rate_hz, exposure_us=exposure_us)
        return self.views.setdefault(name, FaultyCamera(camera))


I2C, SPI, SERIAL, CAMERA = "an I2C bus", "an SPI device", "a serial port", "a camera"
ASKED = ("bno055", "roboclaw", "roboclaw_wheels")  # drivers whose part answers on a serial line
ANSWERING = (I2C, SPI, *ASKED)
CHIPS = (I2C, SPI, SERIAL)


@dataclass(frozen=True, slots=True)
class WiredPart:
    """Where a part is: its driver and settings, the kind of its bus, its chip (or camera), its wire, its bus's hang."""

    driver: str
    settings: Any
    bus: str
    chip: Any
    wire: FaultyWire
    hang: Hang


def wired_part(part: str, config: RoverConfig, buses: FaultyBuses) -> WiredPart:
    """Return where a part of a rover is; it must be on a bus.

    Raises:
        NotResponding: no chip is at its address.
    """
    kind, name, settings = _bus_of(part, config.parts[part])
    driver = driver_name(config.parts[part])
    if kind == I2C:
        i2c: Any = buses.i2c(name)
        wire = i2c.chip_at(settings.address)
        return WiredPart(driver, settings, kind, wire.chip, wire, i2c.hang)
    if kind == CAMERA:
        camera = buses.views[name]
        return WiredPart(driver, settings, kind, camera, camera.wire, camera.hang)
    line: Any = buses.spi(name) if kind == SPI else buses.serial(name)
    return WiredPart(driver, settings, kind, line.chip, line.wire, line.hang)


def is_on(part: str, places: tuple[str, ...], config: RoverConfig) -> bool:
    """Return whether a part of a rover is on one of these kinds of buses, or has one of these drivers."""
    table = config.parts[part]
    return bool({driver_name(table), _bus_of(part, table)[0]} & set(places))


def _bus_of(part: str, table: Mapping[str, Any]) -> tuple[str, str, Any]:
    """Return the kind and name of the bus that a part is on, by its settings, and these; no name if it is on none."""
    _, settings = part_settings(part, table)
    for key, kind in (("port", SERIAL), ("bus", I2C if hasattr(settings, "address") else SPI), ("camera", CAMERA)):
        if isinstance(name := getattr(settings, key, None), str) and name:
            return kind, name, settings
    return "no bus", "", settings
