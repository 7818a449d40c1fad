"""Devantech CMPS14: a tilt-compensated compass on I2C.

Registers and commands are those of the CMPS14 data sheet, pages 2 to 4; where it is silent, the comment says what was
assumed. The part has no data-valid flag and no checksum, and a Raspberry Pi's I2C can corrupt bytes when a part
stretches the clock, so every reading is one block of the whole register map, and ``flaw`` looks whether what the map
says twice agrees.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass
from struct import Struct
from typing import Annotated, ClassVar, NamedTuple

from annotated_types import Interval

from wayfarer.angles import wrap180, wrap360
from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadReading, DriverError, NotResponding, WrongPart
from wayfarer.hal import CompassReading

# version, bearing, bearing, pitch, roll, magnetometer, accelerometer, gyro, 2 unlisted, pitch, roll, calibration
_MAP = Struct(">BBHbb3h3h3h2xhhB")
_COMMAND_REGISTER = 0x00  # the same register reads the firmware version
_SILENT_LINE = (0x00, 0xFF)  # what a line reads that nothing drives; no firmware has either number
_PITCH16_SINCE = 5  # earlier firmware has no 16-bit pitch at 0x1A: published drivers agree, the data sheet is silent
# Whether the 8-bit values are rounded or cut off is not documented: they may be one of their own steps away.
_BEARING_APART_DEG = 360 / 256 + 0.1
_TILT_APART_DEG = 1.5
_ROLL8_ENDS_DEG = 89.0  # the 8-bit roll is documented for +-90 only, the 16-bit one for +-180

# How long it boots is not documented: a second, beside the tens of seconds of the Pi that asks.
_BOOT_TRIES, _BOOT_PAUSE_S = 10, 0.1

_CONFIGURE, _STORE, _ERASE = b"\x98\x95\x99", b"\xf0\xf5\xf6", b"\xe0\xe5\xe2"
_COMMAND_GAP_S = 0.02  # data sheet page 3: after each byte of a command
OPEN_S = 4 * _COMMAND_GAP_S  # switching background calibration off
_ERASE_SETTLE_S = 0.6  # published drivers wait 0.3 to 0.6 s
_CONFIG_FIXED, _CONFIG_BITS = 0x80, 0x97

_CORRUPTED = "bytes shifted or swapped on the bus; lower i2c_arm_baudrate in config.txt, use shorter wires"


class CalibrationLevels(NamedTuple):
    """Calibration as in register 0x1E, each 0 (none) to 3 (full); the gyro's tells nothing, a bug of the sensor."""

    system: int
    gyro: int
    accel: int
    mag: int

    @property
    def heading(self) -> int:
        """How far the part itself trusts its heading: the magnetometer's level, and 0 while the system's is 0.

        The accelerometer's level is left out: the heading of a rover that is nearly level hardly depends on it. Even 3
        is no proof: iron and motor currents beside the part move the bearing and not the level.
        """
        return self.mag if self.system else 0


class RegisterBlock(NamedTuple):
    """The registers 0x00 to 0x1E. The signs of tilt and the units of the raw axes are not documented."""

    version: int
    bearing_deg: float
    bearing8_deg: float
    pitch_deg: float
    pitch8_deg: int
    roll_deg: float
    roll8_deg: int
    mag: tuple[int, int, int]
    accel: tuple[int, int, int]
    gyro: tuple[int, int, int]
    levels: CalibrationLevels


def decode(data: bytes) -> RegisterBlock:
    """Return what 31 bytes from register 0x00 say, true or not; pitch is in whole degrees before firmware 5."""
    version, bearing8, bearing, pitch8, roll8, *axes, pitch, roll, levels = _MAP.unpack(data)
    return RegisterBlock(
        version=version,
        bearing_deg=bearing / 10.0,
        bearing8_deg=bearing8 * 360 / 256,
        pitch_deg=pitch / 10.0 if version >= _PITCH16_SINCE else float(pitch8),
        pitch8_deg=pitch8,
        roll_deg=roll / 10.0,
        roll8_deg=roll8,
        mag=(axes[0], axes[1], axes[2]),
        accel=(axes[3], axes[4], axes[5]),
        gyro=(axes[6], axes[7], axes[8]),
        levels=CalibrationLevels(levels >> 6, levels >> 4 & 3, levels >> 2 & 3, levels & 3),
    )


def flaw(block: RegisterBlock, version: int) -> str | None:
    """Return why a block cannot be true, or None. ``version`` is what register 0x00 said when it was read alone."""
    if block.version in _SILENT_LINE:
        return f"firmware reads 0x{block.version:02X}: nobody drives the line, check power and wires"
    if not any(block.accel):
        return "the accelerometer feels no gravity: still booting, or a dead sensor; turn its power off and on"
    garbled = _garbled(block, version)
    return f"{garbled}: {_CORRUPTED}" if garbled else None


def _garbled(block: RegisterBlock, version: int) -> str | None:
    if block.version != version:
        # All else could agree: where each byte is shifted by one bit, both bearings are doubled, and both pitches.
        return f"firmware reads {block.version} and was {version} when opened"
    if block.bearing_deg >= 360.0:
        return f"bearing {block.bearing_deg:.1f} is beyond 359.9"
    if abs(wrap180(block.bearing_deg - block.bearing8_deg)) > _BEARING_APART_DEG:
        return f"bearing is {block.bearing_deg:.1f} in 16 bits and {block.bearing8_deg:.1f} in 8"
    if _has_strange_pitch(block):
        return f"pitch is {block.pitch_deg:.1f} in 16 bits and {block.pitch8_deg} in 8"
    if _has_strange_roll(block):
        return f"roll is {block.roll_deg:.1f} in 16 bits and {block.roll8_deg} in 8"
    return None


def _has_strange_pitch(block: RegisterBlock) -> bool:
    return abs(block.pitch_deg) > 90.0 or abs(block.pitch_deg - block.pitch8_deg) > _TILT_APART_DEG


def _has_strange_roll(block: RegisterBlock) -> bool:
    if abs(block.roll_deg) > _ROLL8_ENDS_DEG:
        return abs(block.roll_deg) > 180.0
    return abs(block.roll_deg - block.roll8_deg) > _TILT_APART_DEG


@dataclass(frozen=True, slots=True)
class CMPS14Settings:
    """Where the compass is and how it is mounted.

    ``heading_offset_deg`` is added to the bearing: a part whose arrow points 90 degrees to the right of the rover's
    nose needs -90. The signs of the part's tilt are not documented: compare with a rover that is held nose up (pitch
    positive) and then right side down (roll positive). A part that is mounted across needs ``swap_pitch_roll``, which
    comes before either is reversed.

    Background calibration is switched off when the part is opened, unless ``background_calibration``: near iron, or
    beside motors, it learns what is wrong there. ``wayfarer calibrate`` does it well once, and has the part keep it.
    """

    bus: str = "/dev/i2c-1"
    address: Annotated[int, Interval(ge=0x60, le=0x67)] = 0x60
    heading_offset_deg: Annotated[float, Interval(ge=-180, le=180)] = 0.0
    reverse_pitch: bool = False
    reverse_roll: bool = False
    swap_pitch_roll: bool = False
    background_calibration: bool = False


class CMPS14:
    """The compass as ``hal.Compass``; ``troubles`` count the reads that needed a second transfer."""

    part: ClassVar[str] = "compass"
    Settings = CMPS14Settings

    def __init__(self, settings: CMPS14Settings, buses: Buses) -> None:
        self._settings = settings
        self._bus = buses.i2c(settings.bus)
        self._where = f"at 0x{settings.address:02X} on {settings.bus}"
        self._version = 0
        self._argument_awaited = False
        self.name = f"CMPS14 {self._where}"
        self.troubles: Counter[str] = Counter()

    async def open(self) -> None:
        """Ask for the firmware, then for one block; a part that is still booting gets a second.

        A CMPS12 answers at the same address and cannot be asked what it is, but has a bearing where a CMPS14 has its
        16-bit pitch. One that lies level and points north passes, until it turns; so does one with a firmware below 5.

        Raises:
            NotResponding: nothing at this address.
            WrongPart: no firmware number, or the register map of a CMPS12.
            BadReading: no block that can be true within a second.
        """
        try:
            await self._identify()
            block = await self._first_block()
        except NotResponding as error:
            raise NotResponding(
                f"{self.name}: no answer ({error}); check power, wires and address, "
                "and that its mode pin was open or high when it got power: low means serial"
            ) from error
        if _has_strange_pitch(block):
            got = f"pitch {block.pitch_deg:.1f} at 0x1A and {block.pitch8_deg} at 0x04, as from a CMPS12"
            raise WrongPart(self.name, "a CMPS14", got)
        self._check(block)
        if not self._settings.background_calibration:
            await self.configure(_CONFIG_FIXED)

    async def close(self) -> None:
        """Nothing to release."""

    async def read(self) -> CompassReading:
        """Return heading and tilt; what fails is asked for once more at once, within the same call.

        Raises:
            NotResponding: no answer, twice.
            BadReading: a block that cannot be true, twice.
        """
        block = await self._sound_block()
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
        return (await self._sound_block()).levels

    async def configure(self, config: int) -> None:
        """Choose what calibrates itself in the background.

        Bit 7 is always set; bit 0 magnetometer, 1 accelerometer, 2 gyro, 4 periodic saving. 0x80 is nothing, for the
        field; 0x83 is what a heading needs. Whether the part remembers it without power is not documented.

        A command that broke off before its argument still waits for it, and would take the first byte of the next one
        as that: so the argument goes first then. Out of place it is nothing to the part.

        Raises:
            ValueError: bits that the data sheet does not define.
            NotResponding: a byte was not acknowledged; give the whole command again.
        """
        if config & ~_CONFIG_BITS or not config & _CONFIG_FIXED:
            raise ValueError(f"calibration config 0x{config:02X}: bit 7 must be set, bits 3, 5 and 6 have no meaning")
        argument = bytes((config,))
        awaited, self._argument_awaited = argument if self._argument_awaited else b"", True
        await self._command(awaited + _CONFIGURE + argument)
        self._argument_awaited = False

    async def store_profile(self) -> None:
        """Have the part keep its present calibration without power.

        Raises:
            NotResponding: a byte was not acknowledged; give the whole command again.
        """
        await self._command(_STORE)

    async def erase_profile(self) -> None:
        """Go back to the calibration of the factory, and wait until the part has settled.

        Raises:
            NotResponding: a byte was not acknowledged; give the whole command again.
        """
        await self._command(_ERASE)
        await asyncio.sleep(_ERASE_SETTLE_S)

    # -- transfers -----------------------------------------------------------------------------------------------

    async def _identify(self) -> None:
        (version,) = await self._insist(1)
        if version in _SILENT_LINE:
            raise WrongPart(self.name, "a firmware number", f"0x{version:02X}")
        self._version = version
        self.name = f"CMPS14 firmware {version} {self._where}"

    async def _first_block(self) -> RegisterBlock:
        """Return the first block that can be true or, when the time to boot is over, one that cannot."""
        for _ in range(_BOOT_TRIES):
            block = decode(await self._insist(_MAP.size))
            if flaw(block, self._version) is None:
                break
            await asyncio.sleep(_BOOT_PAUSE_S)
        return block

    async def _sound_block(self) -> RegisterBlock:
        """Return a block that can be true, with a second chance for one that was lost or corrupted."""
        try:
            return await self._checked_block()
        except DriverError:
            self.troubles["reads retried"] += 1
            return await self._checked_block()

    async def _checked_block(self) -> RegisterBlock:
        block = decode(await self._read(_MAP.size))
        self._check(block)
        return block

    def _check(self, block: RegisterBlock) -> None:
        if (why := flaw(block, self._version)) is not None:
            raise BadReading(f"{self.name}: {why}")

    async def _insist(self, count: int) -> bytes:
        """Read, and once more where that fails: one lost transfer must not end a run before it has begun."""
        try:
            return await self._read(count)
        except NotResponding:
            return await self._read(count)

    async def _read(self, count: int) -> bytes:
        """Read registers from the first on."""
        return await self._bus.write_read(self._settings.address, b"\x00", count)

    async def _command(self, sequence: bytes) -> None:
        for byte in sequence:
            await self._bus.write(self._settings.address, bytes((_COMMAND_REGISTER, byte)))
            await asyncio.sleep(_COMMAND_GAP_S)
