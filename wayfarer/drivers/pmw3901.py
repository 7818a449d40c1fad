"""PMW3901 optical flow sensor, such as Pimoroni's breakout, on SPI, looking down at the ground.

A read is one burst and never waits: no motion is a valid answer. If the chip cannot see the ground it reports zero, so
each reading has a quality, calculated from the texture that the chip found (SQUAL). Darkness is quality 0, not
standing still.

It needs 80 mm from lens to ground and 60 lux, and follows no more than 7.4 rad/s: 0.74 m/s at 0.1 m. All numbers are
from the data sheet, as docs/reference/hardware.md quotes it, unless a comment names another source. A reading of more
than that is garbage from the bus, and is rejected. The PAA5100, for smaller distances, has the same identity and
cannot be distinguished. If the sensor is not at the centre of a turn, the turn adds flow; that is not corrected.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from wayfarer.drivers import pmw3901_registers as registers
from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.hal import MotionReading

Axis = Literal["+x", "-x", "+y", "-y"]

PRODUCT, INVERSE_PRODUCT = 0x49, 0xB6
RUNNING = 0xBF  # the observation byte of a chip that works
# The highest speed that the chip follows; a reading near it may be of a higher speed.
LIMIT_RAD_S, AT_LIMIT = 7.4, 0.95
RAD_PER_COUNT = 0.00213195
PROBE_TRIES = 3
RESET_S, SETTLE_S, START_S = 0.02, 0.01, 0.24  # Pimoroni's waits; the reset needs 1 ms
OBSERVE_S = 0.02  # two frames are 15 ms
OPEN_S = RESET_S + SETTLE_S + START_S + OBSERVE_S


@dataclass(frozen=True, slots=True)
class PMW3901Settings:
    """Where the sensor is, and how it is mounted."""

    bus: str = "/dev/spidev0.1"
    """Device file of the SPI device: the breakout's front slot is chip select 1, its back slot chip select 0
    (``/dev/spidev0.0``)."""
    spi_mode: Literal[0, 3] = 0
    """SPI mode, by its number. The data sheet says 3; Pimoroni, PX4 and libdriver on the Pi use 0, and one port worked
    in 0 only."""
    speed_hz: Annotated[int, Interval(ge=10_000, le=2_000_000)] = 400_000
    """Clock of the bus. The chip accepts 2 MHz, and needs 35 us to find a register's value. ``spidev`` makes no pause
    after the address, so only a slow clock gives it time: at Pimoroni's 400 kHz a byte takes 20 us, which is known to
    work."""
    height_m: Annotated[float, Interval(ge=0.08, le=5)] = 0.1
    """From lens to ground. At 0.1 m it follows 0.74 m/s, in proportion higher up."""
    rad_per_count: Annotated[float, Interval(ge=1e-4, le=0.01)] = RAD_PER_COUNT
    """Angle of one count, in rad. The default is the data sheet's; published drivers use 0.00126 to 0.0026, so
    calibrate."""
    forward: Axis = "-y"
    """Which of the chip's axes increases as the rover moves forward. The default is the mounting of the Crazyflie's
    flow deck; ``check`` asks you to push the rover, and finds this value."""
    right: Axis = "+x"
    """Which of the chip's axes increases as the rover moves to its right."""
    squal_full: Annotated[int, Interval(ge=1, le=255)] = 95
    """The chip's texture number (SQUAL) that counts as quality 1, in proportion below. Indoors 80 to 100, in the sun
    120 to 150, at night 0 to 60 (PX4 #12894)."""
    led: bool = True
    """Light the breakout's own LED."""

    def __post_init__(self) -> None:
        if self.forward[1] == self.right[1]:
            raise ValueError(f"forward '{self.forward}' and right '{self.right}' lie on one axis; use one x and one y")

    @property
    def m_per_count(self) -> float:
        """Distance over ground of one count, in metres: 0.213 mm at 0.1 m."""
        return self.rad_per_count * self.height_m

    @property
    def limit_counts_s(self) -> float:
        """Counts a second at the highest speed that the chip follows: 3,471, or more if a smaller angle is set.

        A larger angle does not lower the limit: a chip as in the data sheet may give 3,471 at any angle.
        """
        return LIMIT_RAD_S / min(self.rad_per_count, RAD_PER_COUNT)


class PMW3901:
    """The sensor as a ``hal.MotionSensor``.

    ``error_counts`` has the readings at the highest speed that it can follow, and those that were rejected as garbage.
    """

    part: ClassVar[str] = "motion"
    Settings = PMW3901Settings

    def __init__(self, settings: PMW3901Settings, buses: Buses) -> None:
        self.name = f"PMW3901 on {settings.bus}"
        self._settings = settings
        self._m_per_count, self._limit_counts_s = settings.m_per_count, settings.limit_counts_s
        self._bus = buses.spi(settings.bus, mode=settings.spi_mode, speed_hz=settings.speed_hz)
        self._asked_t_s = self._read_t_s = 0.0
        self._is_first = True
        self.error_counts: Counter[str] = Counter()

    async def open(self) -> None:
        """Reset the chip, check its identity, write its settings and check that it runs; takes 0.3 s.

        ``spidev`` cannot give the single pulse of chip select with which the data sheet begins; each transfer is such a
        pulse anyway.

        Raises:
            NotResponding: no answer, or the chip does not run after its start-up.
            WrongPart: something else answered.
        """
        await self._reset()
        await self.identify()
        await self._configure()
        await self._observe()
        self._is_first = True

    async def identify(self) -> None:
        """Read the product number and its inverse; raises as ``open``."""
        product, inverse = await self._read(0x00), await self._read(0x5F)
        if (product, inverse) != (PRODUCT, INVERSE_PRODUCT):
            expected = f"product 0x{PRODUCT:02X} and inverse 0x{INVERSE_PRODUCT:02X}"
            got = f"0x{product:02X} and 0x{inverse:02X}"
            raise self._silence(bytes((product, inverse))) or WrongPart(self.name, expected, got)

    async def close(self) -> None:
        """Nothing to release: the bus belongs to ``Buses``."""

    async def read(self) -> MotionReading:
        """Return the displacement since the previous read; the first one after ``open`` has quality 0.

        Raises:
            NotResponding: silence, or the chip has lost its settings; ``open`` writes them again.
            BadReading: an impossible displacement, caused by garbage on the bus.
        """
        loop, settings = asyncio.get_running_loop(), self._settings
        asked_t_s = loop.time()
        (answer,) = await self._bus.transfer(b"\x16" + bytes(12))
        t_s = loop.time()
        # The counts began at some moment in the previous transfer and end in this one: allow for late answers.
        longest_s, since_s = t_s - self._asked_t_s, t_s - self._read_t_s
        self._asked_t_s, self._read_t_s = asked_t_s, t_s
        burst = registers.decode(answer[1:])
        if burst.observation != RUNNING:
            raise self._silence(answer[1:]) or NotResponding(
                f"{self.name}: has stopped (observation 0x{burst.observation:02X}, not 0x{RUNNING:02X}); "
                "likely its supply dipped and it lost its settings, check the 3.3 V wire"
            )
        quality = registers.quality(burst, settings.squal_full)
        if self._is_first:  # the counts of an unknown time, with the motion during the start-up
            self._is_first, quality = False, 0.0
        elif what := registers.contradiction(burst, longest_s, self._limit_counts_s):
            self.error_counts["impossible readings rejected"] += 1
            raise BadReading(
                f"{self.name}: ({burst.dx}, {burst.dy}): {what}; noise on the SPI wires, keep them short; "
                "or the ground goes by too fast, raise the lens and height_m"
            )
        elif max(abs(burst.dx), abs(burst.dy)) * settings.rad_per_count >= AT_LIMIT * LIMIT_RAD_S * since_s > 0.0:
            self.error_counts["readings at the speed limit"] += 1
        counts = {"+x": burst.dx, "-x": -burst.dx, "+y": burst.dy, "-y": -burst.dy}
        scale = self._m_per_count
        return MotionReading(t_s, counts[settings.forward] * scale, counts[settings.right] * scale, quality)

    async def _reset(self) -> None:
        # An interrupted opening leaves another bank selected, and the reset register is documented for bank 00 only.
        await self._write((0x7F, 0x00), (0x3A, 0x5A))
        await asyncio.sleep(RESET_S)
        for register in range(0x02, 0x07):  # the data sheet requires one read of each; the values do not matter
            await self._read(register)

    async def _configure(self) -> None:
        """Write the start-up table, with its reads and choices."""
        await self._write(*registers.WAKE)
        await self._probe()
        await self._write(*(registers.LONG if await self._read(0x67) & 0x80 else registers.SHORT), *registers.ASK_TRIM)
        if await self._read(0x73) == 0x00:
            trim = registers.trim(await self._read(0x70), await self._read(0x71))
            await self._write(*registers.ALLOW_TRIM, *trim)
        await self._write(*registers.TUNE)
        await asyncio.sleep(SETTLE_S)
        await self._write(*registers.START)
        await asyncio.sleep(START_S)
        await self._write(*(registers.LED_ON if self._settings.led else registers.LED_OFF))

    async def _probe(self) -> None:
        """Write until the chip confirms, three times at most.

        A chip that never confirms may still run: the drivers of Pimoroni and PX4 do not ask. ``_observe`` checks it.
        """
        for _ in range(PROBE_TRIES):
            await self._write(*registers.PROBE)
            if await self._read(0x47) == 0x08:
                return

    async def _observe(self) -> None:
        """Check that the chip takes pictures: it sets the observation byte again in each."""
        await self._write((0x15, 0x00))
        await asyncio.sleep(OBSERVE_S)
        observation = await self._read(0x15)
        if observation != RUNNING:
            raise NotResponding(
                f"{self.name}: answers but does not run (observation 0x{observation:02X}, not 0x{RUNNING:02X}); "
                "switch its power off for a second, and check the 3.3 V wire"
            )

    async def _write(self, *writes: tuple[int, int]) -> None:
        for register, value in writes:  # one transfer each: the chip needs 45 us between two writes
            await self._bus.transfer(bytes((register | 0x80, value)))

    async def _read(self, register: int) -> int:
        (answer,) = await self._bus.transfer(bytes((register, 0x00)))
        return answer[1]

    def _silence(self, answer: bytes) -> NotResponding | None:
        """Return the error for a line without an answer, or None if there is one."""
        if set(answer) not in ({0x00}, {0xFF}):
            return None
        return NotResponding(
            f"{self.name}: only 0x{answer[0]:02X} comes back, nothing answers; check power and plug, the slot (front "
            "is /dev/spidev0.1, back is /dev/spidev0.0) and that SPI is on (sudo raspi-config nonint do_spi 0)"
        )
