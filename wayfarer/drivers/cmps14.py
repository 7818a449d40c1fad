"""Devantech CMPS14: a tilt-compensated compass on I2C.

Registers and commands are those of the CMPS14 data sheet, pages 2 to 4; where it is silent, a comment says what is
assumed. The part has no data-valid flag and no checksum, and a Raspberry Pi's I2C can corrupt bytes when a part
stretches the clock. So every reading is one block of the whole register map, and ``flaw`` compares the values that the
map has twice.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.angles import wrap360
from wayfarer.drivers.buses import Buses
from wayfarer.drivers.cmps14_registers import (
    BLOCK_BYTES,
    SILENT_LINE,
    CalibrationLevels,
    RegisterBlock,
    decode,
    flaw,
    has_strange_pitch,
)
from wayfarer.errors import BadReading, DriverError, NotResponding, WrongPart
from wayfarer.hal import CompassReading

_COMMAND_REGISTER = 0x00  # the same register reads the firmware version

# Its boot time is not documented; a second is waited. The Pi itself boots for tens of seconds.
_BOOT_TRIES, _BOOT_PAUSE_S = 10, 0.1

_CONFIGURE, _STORE, _ERASE = b"\x98\x95\x99", b"\xf0\xf5\xf6", b"\xe0\xe5\xe2"
_COMMAND_GAP_S = 0.02  # data sheet page 3: after each byte of a command
OPEN_S = 4 * _COMMAND_GAP_S  # switching background calibration off
_ERASE_SETTLE_S = 0.6  # published drivers wait 0.3 to 0.6 s
# What ``configure`` takes (page 3): accelerometer and magnetometer without periodic saving, or nothing.
LEARN, OFF = 0x83, 0x80


@dataclass(frozen=True, slots=True)
class CMPS14Settings:
    """Where the compass is and how it is mounted."""

    bus: str = "/dev/i2c-1"
    """Device file of the I2C bus."""
    address: Annotated[int, Interval(ge=0x60, le=0x67)] = 0x60
    """I2C address, 7-bit."""
    heading_offset_deg: Annotated[float, Interval(ge=-180, le=180)] = 0.0
    """Added to the bearing: a part whose arrow points 90 degrees to the right of the rover's nose needs -90."""
    reverse_pitch: bool = False
    """The part reads negative with the nose up; its data sheet does not say which way is up, ``check`` asks."""
    reverse_roll: bool = False
    """The part reads negative with the right side down."""
    swap_pitch_roll: bool = False
    """The part is mounted across; applied before ``reverse_pitch`` and ``reverse_roll``."""
    background_calibration: bool = False
    """Let the part calibrate itself while it is used. Near iron or motors it learns a wrong calibration; ``wayfarer
    calibrate`` calibrates it once, and the part stores it."""


class CMPS14:
    """The compass as ``hal.Compass``; ``error_counts`` counts the reads that needed a second transfer."""

    part: ClassVar[str] = "compass"
    addresses: ClassVar[Sequence[int]] = range(0x60, 0x68)
    Settings = CMPS14Settings

    def __init__(self, settings: CMPS14Settings, buses: Buses) -> None:
        self._settings = settings
        self._bus = buses.i2c(settings.bus)
        self._read = partial(self._bus.write_read, settings.address, b"\x00")  # so many registers, from the first on
        self._where = f"at 0x{settings.address:02X} on {settings.bus}"
        self._version = 0
        self._argument_awaited = False
        self.name = f"CMPS14 {self._where}"
        self.error_counts: Counter[str] = Counter()

    async def open(self) -> None:
        """Identify the part, and switch its background calibration off unless the settings want it; raises as that."""
        await self.identify()
        if not self._settings.background_calibration:
            await self.configure(OFF)

    async def identify(self) -> None:
        """Read the firmware number, then one block; a part that is still booting gets a second. Only reads.

        A CMPS12 answers at the same address and has no register with its type, but it has a bearing where a CMPS14 has
        its 16-bit pitch. A CMPS12 that lies level and points north is not noticed until it turns; one with a firmware
        below 5 is not noticed.

        Raises:
            NotResponding: nothing at this address.
            WrongPart: no firmware number, or the register map of a CMPS12.
            BadReading: no plausible block within a second.
        """
        try:
            await self._read_version()
            block = await self._first_block()
        except NotResponding as error:
            if error.remedy:  # no wire is the reason
                raise
            raise NotResponding(
                f"{self.name}: no answer ({error}); check power, wires and address, "
                "and that its mode pin was open or high when it got power: low means serial"
            ) from error
        if has_strange_pitch(block):
            got = f"pitch {block.pitch_deg:.1f} at 0x1A and {block.pitch8_deg} at 0x04, as from a CMPS12"
            raise WrongPart(self.name, "a CMPS14", got)
        self._plausible(block)

    async def close(self) -> None:
        """Nothing to release."""

    async def read(self) -> CompassReading:
        """Return heading and tilt; a read that fails is repeated once, within the same call.

        Raises:
            NotResponding: no answer, twice.
            BadReading: an implausible block, twice.
        """
        block = await self._valid_block()
        t_s = asyncio.get_running_loop().time()
        settings = self._settings
        pitch_deg, roll_deg = block.pitch_deg, block.roll_deg
        if settings.swap_pitch_roll:
            pitch_deg, roll_deg = roll_deg, pitch_deg
        return CompassReading(
            t_s,
            wrap360(block.bearing_deg + settings.heading_offset_deg),
            -pitch_deg if settings.reverse_pitch else pitch_deg,
            -roll_deg if settings.reverse_roll else roll_deg,
            block.levels.heading,
        )

    # -- calibration ---------------------------------------------------------------------------------------------

    async def calibration(self) -> CalibrationLevels:
        """Return all levels of calibration; raises as ``read`` does."""
        return (await self._valid_block()).levels

    async def configure(self, config: int) -> None:
        """Choose what calibrates itself in the background.

        Bit 7 is always set; bit 0 magnetometer, 1 accelerometer, 2 gyro, 4 periodic saving. 0x80 is nothing, for the
        field; 0x83 is what a heading needs. Whether the part keeps this setting without power is not documented.

        If an earlier command was cut off before its argument, the chip takes the next byte as that argument. So the
        argument is sent first in this case; a chip that does not wait for one ignores it.

        Raises:
            NotResponding: a byte was not acknowledged; repeat the whole command.
        """
        argument = bytes((config,))
        awaited, self._argument_awaited = argument if self._argument_awaited else b"", True
        await self._command(awaited + _CONFIGURE + argument)
        self._argument_awaited = False

    async def store_profile(self) -> None:
        """Store the present calibration, so that the part keeps it without power.

        Raises:
            NotResponding: the compass did not acknowledge.
        """
        await self._command(_STORE)

    async def erase_profile(self) -> None:
        """Restore the factory calibration, and wait until the part has settled; raises as ``configure``."""
        await self._command(_ERASE)
        await asyncio.sleep(_ERASE_SETTLE_S)

    # -- transfers -----------------------------------------------------------------------------------------------

    async def _read_version(self) -> None:
        (version,) = await self._read_with_retry(1)
        if version in SILENT_LINE:
            raise WrongPart(self.name, "a firmware number", f"0x{version:02X}")
        self._version = version
        self.name = f"CMPS14 firmware {version} {self._where}"

    async def _first_block(self) -> RegisterBlock:
        """Return the first plausible block or, when the time to boot is over, an implausible one."""
        for _ in range(_BOOT_TRIES):
            block = decode(await self._read_with_retry(BLOCK_BYTES))
            if flaw(block, self._version) is None:
                break
            await asyncio.sleep(_BOOT_PAUSE_S)
        return block

    async def _valid_block(self) -> RegisterBlock:
        """Return a plausible block; one that was lost or is corrupted is read once more."""
        try:
            return self._plausible(decode(await self._read(BLOCK_BYTES)))
        except DriverError:
            self.error_counts["reads retried"] += 1
            return self._plausible(decode(await self._read(BLOCK_BYTES)))

    def _plausible(self, block: RegisterBlock) -> RegisterBlock:
        """Return the block, or raise ``BadReading`` if it is not plausible."""
        if (why := flaw(block, self._version)) is not None:
            raise BadReading(f"{self.name}: {why}")
        return block

    async def _read_with_retry(self, count: int) -> bytes:
        """Read, and once more if that fails: one lost transfer must not prevent a run from starting."""
        try:
            return await self._read(count)
        except NotResponding:
            return await self._read(count)

    async def _command(self, sequence: bytes) -> None:
        for byte in sequence:
            await self._bus.write(self._settings.address, bytes((_COMMAND_REGISTER, byte)))
            await asyncio.sleep(_COMMAND_GAP_S)
