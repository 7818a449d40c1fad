"""Buses over blocking devices, each behind a thread: a hanging bus does not block the event loop.

Every call on a real bus blocks, for a second and more if a wire is loose, and cannot be interrupted. So each bus has
one thread (``Worker``), which does its transfers one after the other, and each transfer has a deadline. A transfer that
misses it raises ``NotResponding``; until the call in the thread returns, every further transfer is refused at once. A
queued transfer that has not begun within its deadline is dropped, because an old drive command must never reach the
wheels late, also not after the process was suspended. Posted stops are kept, and are sent first.

A blocking device is opened in its thread at the first transfer, and again after every error: a USB adapter that was
unplugged comes back as another file, so the old handle may fail for ever. Only the first opening, when no wheel turns
yet, has a longer deadline, because it also loads the bus's library.
"""

from __future__ import annotations

import asyncio
import errno
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from math import inf
from typing import Any, Generic, Protocol, TypeVar

from wayfarer.drivers.buses import ANSWER_WITHIN_S, CLOSE_WAIT_S, Missing, whole
from wayfarer.errors import NotInstalled, NotResponding, how_to_install
from wayfarer.waiting_thread import WaitingThread

POSTED_MAX = 8  # stops that wait while a bus hangs; all stops are the same, so the newest ones are enough
TRANSFER_DEADLINE_S = 0.1  # a block read takes 3 ms at 100 kHz; the rover's boards stop the wheels after 0.25 s
ANSWER_SPARE_S = 0.02  # before a transfer's deadline, a wait for an answer ends: a busy computer wakes threads late
OPEN_DEADLINE_S = 5.0  # a Raspberry Pi that has just booted may need a second to load a library from its card

T = TypeVar("T")


class Worker(WaitingThread):
    """One thread that does blocking jobs one after the other, each with a deadline."""

    def __init__(self, name: str, deadline_s: float = TRANSFER_DEADLINE_S) -> None:
        super().__init__(f"bus {name}")
        self.name = name
        self._deadline_s = deadline_s
        self._jobs: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._posted: deque[tuple[Callable[[], Any], Future[Any]]] = deque(maxlen=POSTED_MAX)
        self._busy = False
        self._overdue = False
        self.ends_by_s = inf  # the deadline of the call that is being done, on the loop's clock
        self._ended: Future[None] = Future()

    async def call(self, job: Callable[[], T], deadline_s: float | None = None) -> T:
        """Do a job in the thread and return its result.

        Raises:
            NotResponding: the deadline passed, or an earlier job has missed its own and still hangs.
        """
        deadline_s = self._deadline_s if deadline_s is None else deadline_s
        future: Future[T] = Future()
        clock = asyncio.get_running_loop().time  # any thread may read it
        begins_by_s = clock() + deadline_s

        def in_time() -> T:
            if clock() > begins_by_s:
                raise NotResponding(f"{self.name}: a transfer did not begin within {deadline_s:g} s, and was dropped")
            self.ends_by_s = begins_by_s
            return job()

        with self._changed:
            if self._overdue or self._closed:
                raise NotResponding(
                    f"{self.name}: closed"
                    if self._closed
                    else f"{self.name}: an earlier transfer still hangs; a device holds the bus, check power and wiring"
                )
            self._jobs.append((in_time, future))
            try:
                self._wake()
            except RuntimeError as error:
                self._jobs.pop()
                raise NotResponding(f"{self.name}: {error}; the computer is out of threads or memory") from None
        try:
            async with asyncio.timeout(deadline_s) as deadline:
                return await asyncio.wrap_future(future)
        except TimeoutError:
            if not deadline.expired():
                raise  # the job's own error: a driver in the kernel timed out
            self._give_up()
            raise NotResponding(
                f"{self.name}: a transfer did not end within {deadline_s:g} s; a device holds the bus, "
                "check power and wiring"
            ) from None

    def post(self, job: Callable[[], Any]) -> None:
        """Do a job before all queued ones, from any thread, without waiting; its errors are ignored."""
        with self._changed:
            if not self._closed:
                self._posted.append((job, Future()))  # which nobody waits for
                with suppress(RuntimeError):  # no thread can be started now: the next job tries again
                    self._wake()

    async def close(self, last: Callable[[], Any] | None = None, wait_s: float = CLOSE_WAIT_S) -> None:
        """Let the thread end after the posted jobs and ``last``; wait for it no longer than ``wait_s``."""
        with self._changed:
            if last is not None and self._thread is not None and not self._closed:
                self._posted.append((last, Future()))
            self._close()
        if self._thread is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(wait_s):
                    await asyncio.shield(asyncio.wrap_future(self._ended))

    def _give_up(self) -> None:
        """Drop all calls that wait behind a job that hangs: a call, an abandoned call, or a stop."""
        with self._changed:
            self._overdue = self._busy
            dropped, self._jobs = self._jobs, deque()
        for _, waiting in dropped:
            if waiting.set_running_or_notify_cancel():
                waiting.set_exception(NotResponding(f"{self.name}: an earlier transfer hangs"))

    def _work(self) -> None:
        while (next_job := self._next()) is not None:
            job, future = next_job
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(job())
            except Exception as error:
                future.set_exception(error)
        self._ended.set_result(None)

    def _next(self) -> tuple[Callable[[], Any], Future[Any]] | None:
        """Wait for a job; None once the worker is closed and no posted job is left."""
        with self._changed:
            self._busy = self._overdue = False
            self._changed.wait_for(lambda: self._posted or self._jobs or self._closed)
            self._busy = True
            if self._posted:
                return self._posted.popleft()
            if self._closed:
                return None
            return self._jobs.popleft()


class BlockingDevice(Protocol):
    """An open device; every method blocks and raises ``OSError``."""

    def close(self) -> None:
        """Release it."""


class BlockingI2C(BlockingDevice, Protocol):
    """An open I2C bus."""

    def write(self, address: int, data: bytes) -> None:
        """Write bytes."""

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, repeated start, read."""

    def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, stop, read."""


class BlockingSPI(BlockingDevice, Protocol):
    """An open SPI device."""

    def transfer(self, pieces: tuple[bytes, ...]) -> tuple[bytes, ...]:
        """Exchange pieces, chip select low for each in turn."""


class BlockingSerial(BlockingDevice, Protocol):
    """An open serial port."""

    def write(self, data: bytes) -> None:
        """Write bytes and wait until they are in the port's own buffer."""

    def forget_input(self) -> None:
        """Throw away what has come."""

    def read(self, count: int, wait_s: float) -> bytes:
        """Return what has come, at most ``count`` bytes, as soon as there is any; nothing if the wait is over."""


D = TypeVar("D", bound=BlockingDevice)

# What a person who holds the wires should look for, by the error that Linux gives (docs/reference/hardware.md).
_CAUSES = {
    errno.EREMOTEIO: "no acknowledgement",
    errno.ENXIO: "no acknowledgement",
    errno.EIO: "the transfer broke off: a loose wire, or the part stretches the clock",
    errno.ETIMEDOUT: "the bus is stuck: a part holds a line low; switch its power off and on",
    errno.ENOENT: "no such device file",
    errno.ENODEV: "no such device",
    errno.ESHUTDOWN: "no such device any more",  # how spidev says that its driver was unbound
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EBUSY: "another program, or a driver of the kernel, has it",
}
# What helps if the computer is the reason, and no wire.
_REMEDIES = {
    errno.ENOENT: "enable the interface with sudo raspi-config, or correct the rover file",
    errno.ENODEV: "plug it in, or enable the interface with sudo raspi-config",
    errno.ESHUTDOWN: "enable SPI again with sudo raspi-config",
    errno.EACCES: "add the user to the device's group (ls -l shows it) and log in again",
    errno.EPERM: "allow the device to the service or container that this runs in (DeviceAllow=, --device)",
    errno.EBUSY: "end the program that has it (sudo fuser -v shows it), such as another daemon",
}
# How each library of a bus is installed, by the module that could not be imported.
_WITH_CAMERA = "sudo apt install python3-picamera2, and a venv with --system-site-packages"
LIBRARIES = {
    "smbus2": how_to_install("pi"),
    "spidev": how_to_install("pi"),
    "serial": f"{how_to_install('pi')} (pyserial; a package named serial is another one: pip uninstall serial)",
    "picamera2": _WITH_CAMERA,
    "libcamera": _WITH_CAMERA,
}


def explain(error: OSError) -> str:
    """Return what an error of a bus means for the person who holds the wires."""
    cause = _CAUSES.get(error.errno or 0)
    return f"{cause} [errno {error.errno}]" if cause else str(error) or type(error).__name__


class Threaded(Generic[D]):
    """A blocking device behind a worker."""

    def __init__(
        self,
        name: str,
        open_device: Callable[[], D],
        deadline_s: float = TRANSFER_DEADLINE_S,
        open_deadline_s: float = OPEN_DEADLINE_S,
    ) -> None:
        self.name = name
        self._open = open_device
        self._worker = Worker(name, deadline_s)
        self._open_deadline_s = open_deadline_s
        self._device: D | None = None
        self._tried = False  # whether an open was attempted

    async def call(self, use: Callable[[D], T]) -> T:
        """Use the device in its thread.

        Raises:
            NotResponding: the device failed, or the deadline passed.
        """
        try:
            if not self._tried:
                await self._worker.call(self._opened, self._open_deadline_s)
            return await self._worker.call(lambda: self._use(use))
        except OSError as error:
            raise NotResponding(f"{self.name}: {explain(error)}", _REMEDIES.get(error.errno or 0, "")) from None
        except ImportError as error:
            raise NotInstalled(self.name, error, LIBRARIES) from None

    def send(self, use: Callable[[D], Any]) -> None:
        """Use the device before all queued transfers, without waiting for it; from any thread."""
        self._worker.post(lambda: self._use(use))

    async def close(self, wait_s: float = CLOSE_WAIT_S) -> None:
        """Release the device after the posted transfers; wait for that no longer than ``wait_s``."""
        await self._worker.close(self._release, wait_s)

    def _use(self, use: Callable[[D], T]) -> T:
        """Open the device if necessary and use it; runs in the worker's thread, as all methods below."""
        device = self._opened()
        try:
            return use(device)
        except OSError:
            self._release()
            raise

    def _opened(self) -> D:
        if self._device is None:
            try:
                self._device = self._open()
            finally:
                self._tried = True  # only now: a call meanwhile needs the same long deadline
        return self._device

    def _release(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.close()


class ThreadedI2C(Threaded[BlockingI2C]):
    """Implements ``buses.I2CBus``."""

    async def write(self, address: int, data: bytes) -> None:
        """Write bytes."""
        await self.call(lambda bus: bus.write(address, data))

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, repeated start, read."""
        return await self.call(lambda bus: bus.write_read(address, data, count))

    async def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, stop, read, with nothing in between."""
        return await self.call(lambda bus: bus.write_then_read(address, data, count))

    def post(self, address: int, data: bytes) -> None:
        """Write without waiting."""
        self.send(lambda bus: bus.write(address, data))


class ThreadedSPI(Threaded[BlockingSPI]):
    """Implements ``buses.SPIBus``."""

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        """Exchange pieces."""
        return await self.call(lambda device: device.transfer(pieces))


class ThreadedSerial(Threaded[BlockingSerial]):
    """Implements ``buses.SerialPort``."""

    async def write(self, data: bytes) -> None:
        """Write bytes."""
        await self.call(lambda port: port.write(data))

    async def exchange(self, data: bytes, missing: Missing, *, within_s: float = ANSWER_WITHIN_S) -> bytes:
        """Write, and read the answer."""
        clock = asyncio.get_running_loop().time

        def ask(port: BlockingSerial) -> bytes:
            ends_s = min(clock() + within_s, self._worker.ends_by_s - ANSWER_SPARE_S)
            port.forget_input()
            port.write(data)
            answer = b""
            while (count := missing(answer)) > 0 and (left_s := ends_s - clock()) > 0:
                answer += port.read(count, left_s)
            return answer

        return whole(self.name, await self.call(ask), missing, within_s)

    def post(self, data: bytes) -> None:
        """Write without waiting."""
        self.send(lambda port: port.write(data))
