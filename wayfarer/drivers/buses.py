"""Bus protocols, as the drivers see them: I2C, SPI, serial, camera, GPIO pins.

A driver asks ``Buses`` for the bus that its settings name and awaits transfers on it. It does not know whether these
use the device files of a Raspberry Pi (``linux.py``), simulated chips (``simhal.buses``) or another process. No
transfer waits longer than a deadline: a bus that hangs raises ``NotResponding``. The first transfer may take seconds
more, because it opens the bus.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

from wayfarer.errors import NotResponding

if TYPE_CHECKING:
    import numpy
    from numpy.typing import NDArray

CLOSE_WAIT_S = 0.2  # as for each part: a run must have ended 2 s after SIGTERM
ANSWER_WITHIN_S = 0.05  # on a serial line, as a rule: half a transfer's deadline, 48 bytes at 9600 baud


class I2CBus(Protocol):
    """An I2C bus; addresses are 7-bit.

    Each transfer that is awaited raises ``NotResponding`` if there is no acknowledgement, or the deadline passed.
    """

    name: str

    async def write(self, address: int, data: bytes) -> None:
        """Write bytes."""

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, then read ``count`` bytes after a repeated start, as EEPROM-like chips need it."""

    async def write_then_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write, stop, read ``count`` bytes; no other transfer on this bus comes in between."""

    def post(self, address: int, data: bytes) -> None:
        """Write without waiting and without a report of success, from any thread; it never raises."""


class SPIBus(Protocol):
    """One device on an SPI bus."""

    name: str

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        """Exchange pieces, chip select low for each in turn, and return as many bytes as were sent for each.

        Raises:
            NotResponding: the bus failed, or the deadline passed. A missing device reads 00 or FF, without an error.
        """


# Says of the bytes that came so far how many more the answer has, at least; 0 if it is whole.
Missing = Callable[[bytes], int]


class SerialPort(Protocol):
    """A serial line."""

    name: str

    async def exchange(self, data: bytes, missing: Missing, *, within_s: float = ANSWER_WITHIN_S) -> bytes:
        """Discard old input, write bytes, read until ``missing`` of what came is 0, and return all of it.

        No other transfer on this port comes in between. A part that does not answer is not a bus that hangs: this ends
        before a transfer's deadline, also if ``within_s`` is longer.

        Raises:
            NotResponding: the answer is not whole after ``within_s``; the text has what came. Or as ``write``.
        """

    async def write(self, data: bytes) -> None:
        """Write bytes.

        Raises:
            NotResponding: the port is gone, or the deadline passed.
        """

    def post(self, data: bytes) -> None:
        """Write without waiting and without a report of success, from any thread; it never raises."""


def whole(name: str, answer: bytes, missing: Missing, within_s: float) -> bytes:
    """Return an answer on a serial line.

    Raises:
        NotResponding: bytes of it are missing.
    """
    if missing(answer) <= 0:
        return answer
    came = f"only {answer.hex(' ').upper()} came" if answer else "nothing came"
    raise NotResponding(f"{name}: no complete answer within {within_s:g} s, {came}")


class Frame(NamedTuple):
    """A camera frame: when it was taken on the event loop's clock, and its luma, shape (height, width), uint8."""

    t_s: float
    luma: NDArray[numpy.uint8]


class Camera(Protocol):
    """A camera that gives small grey frames."""

    name: str

    async def frame(self) -> Frame:
        """Return the next frame.

        Raises:
            NotResponding: no camera, or no frame within the deadline.
        """


class OutputPin(Protocol):
    """A pin that the computer drives. Setting it takes microseconds, and any thread may do it."""

    value: float  # the share of time that it is active, 0 to 1; a pin without PWM knows only the two

    def close(self) -> None:
        """Release it."""


class InputPin(Protocol):
    """A pin that something else drives."""

    when_activated: Callable[[], None] | None  # called by another thread, as is the next
    when_deactivated: Callable[[], None] | None

    @property
    def is_active(self) -> bool:
        """Whether it is high, or with a pull-up low, now."""

    def close(self) -> None:
        """Release it."""


class Pins(Protocol):
    """The GPIO pins, by their GPIO numbers; a pin has one user.

    Any error means that a pin cannot be had or failed: gpiozero and lgpio have a dozen kinds, of which
    ``drivers/gpio.py`` makes ``NotResponding``.
    """

    def output(self, pin: int, *, pwm_hz: float | None = None, active_high: bool = True) -> OutputPin:
        """Claim a pin and hold it inactive; with PWM of this frequency; without, only on and off."""

    def input(self, pin: int, *, pull_up: bool) -> InputPin:
        """Claim a pin, pulled up and active when low, or pulled down and active when high."""


class Buses(Protocol):
    """Gives buses by name; the same name gives the same bus, and nothing is touched until it is used."""

    def i2c(self, name: str) -> I2CBus:
        """Return an I2C bus, such as ``/dev/i2c-1``."""

    def spi(self, name: str, *, mode: int, speed_hz: int) -> SPIBus:
        """Return a device on an SPI bus, such as ``/dev/spidev0.1``."""

    def serial(self, name: str, *, baud: int) -> SerialPort:
        """Return a serial port, such as ``/dev/serial0``; 8 bits, no parity, 1 stop bit."""

    def camera(self, name: str, *, width: int, height: int, rate_hz: float, exposure_us: int | None) -> Camera:
        """Return a camera by its number among the connected ones, as text; ``exposure_us`` None is automatic."""

    def pins(self) -> Pins:
        """Return the GPIO pins; who claims one lets go of it."""

    async def close(self, wait_s: float = CLOSE_WAIT_S) -> None:
        """Send the posted commands, then release everything; never raises, and waits at most ``wait_s`` in total."""
