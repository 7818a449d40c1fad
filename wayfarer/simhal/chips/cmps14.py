"""Simulated CMPS14 compass on I2C: heading and tilt of the simulated world.

Registers and commands are those of the CMPS14 data sheet, pages 2 to 4. Made up, where it is silent: the directions of
the raw axes, the magnetometer's counts, that an early byte breaks a command, and what is forgotten without power.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians, sin
from struct import Struct
from typing import Final

from mypy_extensions import mypyc_attr

from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.sensor_models import HeadingSensorModel

ADDRESS: Final = 0x60
FIRMWARE: Final = 7  # seen on parts that are sold
CALIBRATED: Final = 0b11_00_11_11  # system 3, gyro 0 as on real parts, accelerometer 3, magnetometer 3

_MAP: Final = Struct(">BBHbb3h3h3h2xhhB")  # registers 0x00 to 0x1E
_COMMAND: Final = 0x00
_REMEMBERED: Final = 20
_MEASURED: Final = range(0x01, 0x1E)  # all but the firmware and the calibration
_PITCH16_SINCE: Final = 5

_CONFIGURE: Final = b"\x98\x95\x99"  # an argument follows it, and the next one
_ADDRESS: Final = b"\xa0\xaa\xa5"
_STORE: Final = b"\xf0\xf5\xf6"
_ERASE: Final = b"\xe0\xe5\xe2"
_SEQUENCES: Final = (_CONFIGURE, _ADDRESS, _STORE, _ERASE)
_GAP_S: Final = 0.02
_ERASE_S: Final = 0.3
_CONFIG_OFF: Final = 0x80
_CONFIG_UNDEFINED: Final = 0x68
_ADDRESSES: Final = range(0xC0, 0xD0, 2)  # as 8-bit addresses

_COUNTS_PER_G: Final = 1000  # one of two published scales; the data sheet gives none
_FIELD_LEVEL: Final = 200  # counts; the field dips by 66 degrees, as in central Europe
_FIELD_DOWN: Final = 450


@mypyc_attr(allow_interpreted_subclasses=True)
class CMPS14Chip:
    """Implements ``buses.I2CChip``; the sensor is sampled once for each read of anything that is measured.

    Args:
        sense: what it feels.
        clock: seconds on the clock of the world.
        firmware: register 0x00; before 5 there is no 16-bit pitch.
        boot_s: for how long it reads zeros after ``power_cycle``.

    ``calibration`` is register 0x1E and can be set; ``profile`` is the one that is kept without power. ``config`` is
    the byte of the last configuration. ``address`` is where the part answers after its next power-up, for the bench to
    attach it there. ``ignored`` holds the latest command bytes that came too early.
    """

    def __init__(
        self, sense: HeadingSensorModel, clock: Callable[[], float], *, firmware: int = FIRMWARE, boot_s: float = 0.0
    ) -> None:
        self.firmware = firmware
        self.boot_s = boot_s
        self.address = ADDRESS
        self.profile = CALIBRATED
        self.ignored: list[int] = []
        self._sense = sense
        self._clock = clock
        self._booted_s = clock()
        self._power_up()

    def power_cycle(self) -> None:
        """Lose power for a moment: what is not stored is forgotten, and all reads zero while it boots."""
        self._power_up()
        self._booted_s = self._clock() + self.boot_s

    def _power_up(self) -> None:
        self.config = _CONFIG_OFF
        self.calibration = self.profile
        self._pointer = 0
        self._sequence = b""
        self._deaf_until_s = self._clock()

    def write(self, data: bytes) -> None:
        """Set the register that is read next or, with a second byte to register 0x00, take a byte of a command."""
        if not data or data[0] >= _MAP.size:
            raise ChipMisuse(f"CMPS14: wrote {data.hex(' ') or 'nothing'}; the registers are 00 to 1e")
        if len(data) > 2 or (len(data) == 2 and data[0] != _COMMAND):
            raise ChipMisuse(f"CMPS14: wrote {data.hex(' ')}; only register 00 takes bytes, one in each write")
        self._pointer = data[0]
        if len(data) == 2:
            self._take(data[1])

    def read(self, count: int) -> bytes:
        """Give registers from the one that was set on; it moves along."""
        start, end = self._pointer, self._pointer + count
        if count < 1 or end > _MAP.size:
            raise ChipMisuse(f"CMPS14: read {count} bytes from {start:02x}; the registers are 00 to 1e")
        self._pointer = end
        return self._registers(measured=start < _MEASURED.stop and end > _MEASURED.start)[start:end]

    def _registers(self, *, measured: bool) -> bytes:
        now_s = self._clock()
        if now_s < self._booted_s:
            return bytes((self.firmware, *bytes(30)))
        if not measured:
            return bytes((self.firmware, *bytes(29), self.calibration))
        heading, pitch, roll = self._sense.sample(now_s)
        pitch = max(-900, min(pitch, 900))
        return _MAP.pack(
            self.firmware,
            round(heading * 256 / 3600) % 256,
            heading,
            int(pitch / 10),
            max(-90, min(int(roll / 10), 90)),
            *_field(heading),
            *_gravity(pitch, roll),
            0,
            0,
            0,
            pitch if self.firmware >= _PITCH16_SINCE else 0,
            roll,
            self.calibration,
        )

    def _take(self, byte: int) -> None:
        """Take the next byte of a command: one that is early or out of place breaks it."""
        now_s = self._clock()
        begun, self._sequence = self._sequence + bytes((byte,)), b""
        early, self._deaf_until_s = now_s < self._deaf_until_s, max(self._deaf_until_s, now_s + _GAP_S)
        if early:
            self.ignored = [*self.ignored[-_REMEMBERED:], byte]
        elif len(begun) == 4:
            self._set(begun[:3], byte)
        elif begun in (_STORE, _ERASE):
            self._keep_profile(begun, now_s)
        elif any(sequence.startswith(begun) for sequence in _SEQUENCES):
            self._sequence = begun
        elif any(byte == sequence[0] for sequence in _SEQUENCES):
            self._sequence = bytes((byte,))
        elif not (_is_config(byte) or any(byte in sequence for sequence in _SEQUENCES)):
            raise ChipMisuse(f"CMPS14: {byte:02x} belongs to no command")

    def _set(self, sequence: bytes, value: int) -> None:
        """Do a command that has an argument."""
        if sequence == _CONFIGURE:
            if not _is_config(value):
                raise ChipMisuse(f"CMPS14: calibration config {value:02x} is not defined")
            self.config = value
        else:
            if value not in _ADDRESSES:
                raise ChipMisuse(f"CMPS14: {value:02x} is none of the addresses c0, c2 to ce")
            self.address = value >> 1

    def _keep_profile(self, sequence: bytes, now_s: float) -> None:
        """Store the calibration, or go back to none and settle."""
        if sequence == _STORE:
            self.profile = self.calibration
        else:
            self.profile = self.calibration = 0
            self._deaf_until_s = now_s + _ERASE_S


def _is_config(byte: int) -> bool:
    return not byte & _CONFIG_UNDEFINED and bool(byte & _CONFIG_OFF)


def _field(heading: int) -> tuple[int, int, int]:
    """Return the magnetometer of a level part, in counts: x forward, y right, z down."""
    heading_rad = radians(heading / 10)
    return round(_FIELD_LEVEL * cos(heading_rad)), round(-_FIELD_LEVEL * sin(heading_rad)), _FIELD_DOWN


def _gravity(pitch: int, roll: int) -> tuple[int, int, int]:
    """Return the accelerometer of a part at rest, in counts."""
    pitch_rad, roll_rad = radians(pitch / 10), radians(roll / 10)
    down = _COUNTS_PER_G * cos(pitch_rad)
    return (
        round(-_COUNTS_PER_G * sin(pitch_rad)),
        round(down * sin(roll_rad)),
        round(down * cos(roll_rad)),
    )
