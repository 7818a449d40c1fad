"""The registers of a CMPS14: decodes a block of them, and checks whether it is plausible. Pure.

They are those of the CMPS14 data sheet, pages 2 to 4. The part has no checksum, but it gives bearing and tilt twice.
"""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple

from wayfarer.angles import wrap180

# version, bearing, bearing, pitch, roll, magnetometer, accelerometer, gyro, 2 unlisted, pitch, roll, calibration
_MAP: Final = Struct(">BBHbb3h3h3h2xhhB")
BLOCK_BYTES: Final = _MAP.size  # from register 0x00 on
SILENT_LINE: Final = (0x00, 0xFF)  # read from a line that nothing drives; no firmware has either number
# Earlier firmware has no 16-bit pitch at 0x1A: published drivers agree, the data sheet is silent.
_PITCH16_SINCE: Final = 5
# Whether the 8-bit values are rounded or truncated is not documented: they may differ by one of their own steps.
_BEARING_APART_DEG: Final = 360 / 256 + 0.1
_TILT_APART_DEG: Final = 1.5
_ROLL8_ENDS_DEG: Final = 89.0  # the 8-bit roll is documented for +-90 only, the 16-bit one for +-180

_CORRUPTED: Final = "bytes shifted or swapped on the bus; lower i2c_arm_baudrate in config.txt, use shorter wires"


class CalibrationLevels(NamedTuple):
    """Calibration as in register 0x1E, each 0 (none) to 3 (full); that of the gyro is useless, a bug of the sensor."""

    system: int
    gyro: int
    accel: int
    mag: int

    @property
    def heading(self) -> int:
        """The calibration level of the heading: that of the magnetometer, and 0 while that of the system is 0.

        The accelerometer's level is left out: the heading of a rover that is nearly level hardly depends on it. Even 3
        proves nothing: iron and motor currents beside the part change the bearing, but not the level.
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
    """Decode 31 bytes from register 0x00, plausible or not; pitch is in whole degrees before firmware 5."""
    said = _MAP.unpack(data)
    version, bearing8, bearing, pitch8, roll8 = said[:5]
    mag, accel, gyro = said[5:8], said[8:11], said[11:14]
    pitch, roll, levels = said[14:]
    return RegisterBlock(
        version,
        bearing / 10.0,
        bearing8 * 360 / 256,
        pitch / 10.0 if version >= _PITCH16_SINCE else float(pitch8),
        pitch8,
        roll / 10.0,
        roll8,
        mag,
        accel,
        gyro,
        CalibrationLevels(levels >> 6, levels >> 4 & 3, levels >> 2 & 3, levels & 3),
    )


def flaw(block: RegisterBlock, version: int) -> str | None:
    """Return why a block is implausible, or None. ``version`` is the value of register 0x00 when it was read alone."""
    if block.version in SILENT_LINE:
        return f"firmware reads 0x{block.version:02X}: the line is not driven, check power and wires"
    if not any(block.accel):
        return "the accelerometer measures no gravity: still booting, or a dead sensor; turn its power off and on"
    roll_deg = abs(block.roll_deg)
    if block.version != version:
        # All other values could agree: if each byte is shifted by one bit, both bearings and both pitches are doubled.
        garbled = f"firmware reads {block.version} and was {version} when opened"
    elif block.bearing_deg >= 360.0:
        garbled = f"bearing {block.bearing_deg:.1f} is beyond 359.9"
    elif abs(wrap180(block.bearing_deg - block.bearing8_deg)) > _BEARING_APART_DEG:
        garbled = f"bearing is {block.bearing_deg:.1f} in 16 bits and {block.bearing8_deg:.1f} in 8"
    elif has_strange_pitch(block):
        garbled = f"pitch is {block.pitch_deg:.1f} in 16 bits and {block.pitch8_deg} in 8"
    elif roll_deg > 180.0 or (roll_deg <= _ROLL8_ENDS_DEG and abs(block.roll_deg - block.roll8_deg) > _TILT_APART_DEG):
        garbled = f"roll is {block.roll_deg:.1f} in 16 bits and {block.roll8_deg} in 8"
    else:
        return None
    return f"{garbled}: {_CORRUPTED}"


def has_strange_pitch(block: RegisterBlock) -> bool:
    """Return whether the 16-bit pitch of a block is impossible, or differs from the 8-bit one."""
    return abs(block.pitch_deg) > 90.0 or abs(block.pitch_deg - block.pitch8_deg) > _TILT_APART_DEG
