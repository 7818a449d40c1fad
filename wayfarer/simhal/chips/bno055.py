"""Simulated BNO055 on I2C or on a serial line: heading and tilt of the simulated world.

Registers, modes, times and the serial protocol are those of the data sheet (BST-BNO055-DS000, revision 1.4). If it is
silent the chip takes the harder case: what is written to a setting outside of the mode CONFIG is ignored without a word
(adafruit/Adafruit_BNO055 #95), a reset makes it mute for 650 ms and leaves nothing of what was set or learnt, and a
magnetometer's radius of 0 stops the fusion (Bosch's forum). Made up: the noise, and the field that the magnetometer
feels. Self-test, interrupts, other units than metric ones and the modes without fusion are not simulated.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians, sin
from struct import pack
from typing import Final

from wayfarer.errors import NotResponding
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.sensor_models import HeadingSensorModel

BOOT_S: Final = 0.65
CALIBRATED: Final = 0xFF
IDENTITY: Final = bytes((0xA0, 0xFB, 0x32, 0x0F, 0x11, 0x03))  # and software 3.11

CONFIG, IMU, NDOF_FMC_OFF, NDOF = 0x00, 0x08, 0x0B, 0x0C
_FUSED: Final = (IMU, NDOF_FMC_OFF, NDOF)
_TO_CONFIG_S, _FROM_CONFIG_S = 0.019, 0.007
_ERROR, _RUNS, _FUSION_CONFIGURATION = 1, 5, 9

PAGE, UNITS, MODE, POWER, TRIGGER, AXES, OFFSETS = 0x07, 0x3B, 0x3D, 0x3E, 0x3F, 0x41, 0x55
_END: Final = {0: 0x6B, 1: 0x80}
_MEASURED: Final = range(0x08, 0x36)
_FUSION: Final = range(0x1A, 0x34)
_WRITABLE: Final = (PAGE, *range(UNITS, 0x43), *range(OFFSETS, 0x6B))
_RESET: Final = 0x20
_ANDROID: Final = 0x80  # the bit of the units that remains free here
# Radius of the accelerometer and of the magnetometer at the end of the offsets.
_AT_POWER_UP: Final = {UNITS: _ANDROID, AXES: 0x24, 0x67: 0xE8, 0x68: 0x03, 0x69: 0xE0, 0x6A: 0x01}
_FIELD_LEVEL, _FIELD_DOWN = 20.0 * 16, 45.0 * 16  # microtesla, as in central Europe


class BNO055Chip:
    """Implements ``buses.I2CChip`` and ``buses.SerialChip``; the sensor is sampled once for each read of the fusion.

    Args:
        sense: what it feels: heading, pitch with y up, and roll with x down, once its axes are set as it is mounted.
        clock: seconds on the clock of the world.

    Attributes:
        calibration: register 35.
        registers: page 0, as it was written.
        busy: so many of the next commands on the serial line are refused with *bus over run*.
        frozen: the sensors measure nothing new.
    """

    def __init__(self, sense: HeadingSensorModel, clock: Callable[[], float]) -> None:
        self.busy = 0
        self.frozen = False
        self._sense, self._clock = sense, clock
        self._samples = 0
        self._felt = (0, 0, 0)
        self._forget()
        self._awake_s = clock()
        self.calibration = CALIBRATED

    def power_cycle(self) -> None:
        """Lose power for a moment, as its own reset does too."""
        self._forget()
        self._awake_s = self._clock() + BOOT_S

    def _forget(self) -> None:
        self.registers = bytearray(_END[0])
        self.registers[: len(IDENTITY)] = IDENTITY
        for register, value in _AT_POWER_UP.items():
            self.registers[register] = value
        self.calibration = 0
        self._pointer = self._page = 0
        self._mode, self._mode_since_s = CONFIG, 0.0
        self._line = b""

    # -- I2C -----------------------------------------------------------------------------------------------------

    def write(self, data: bytes) -> None:
        """Set the register that is read next, and write what follows from there on."""
        self._wake()
        if not data or not self._is_there(data[0], max(1, len(data) - 1)):
            raise ChipMisuse(f"BNO055: wrote {data.hex(' ') or 'nothing'}; no such registers on page {self._page}")
        self._pointer = data[0]
        if len(data) > 1:
            if not self._are_writable(data[0], len(data) - 1):
                raise ChipMisuse(f"BNO055: wrote {data.hex(' ')}; these registers are read only")
            self._write(data[0], data[1:])

    def read(self, count: int) -> bytes:
        """Give registers from the one that was set on; it moves along."""
        self._wake()
        if not self._is_there(self._pointer, count):
            raise ChipMisuse(f"BNO055: read {count} bytes from {self._pointer:02x} on page {self._page}")
        answer = self._read(self._pointer, count)
        self._pointer += count
        return answer

    def _wake(self) -> None:
        if self._clock() < self._awake_s:
            raise NotResponding("BNO055: no acknowledgement, it is starting up")

    # -- the serial line -----------------------------------------------------------------------------------------

    def receive(self, data: bytes) -> bytes:
        """Take bytes of commands, in pieces of any length, and give what is answered to those that are whole."""
        if self._clock() < self._awake_s:
            self._line = b""
            return b""
        self._line += data
        answers = b""
        while self._line:
            if self._line[0] != 0xAA:
                self._line = self._line[1:]
                answers += b"\xee\x06"
                continue
            if len(self._line) < 4:
                break
            writes, (register, count) = self._line[1] == 0, self._line[2:4]
            end = 4 + count if writes else 4
            if len(self._line) < end:
                break
            given, self._line = self._line[4:end], self._line[end:]
            answers += self._answer(register, count, given if writes else None)
        return answers

    def _answer(self, register: int, count: int, given: bytes | None) -> bytes:
        if self.busy:
            self.busy -= 1
            return b"\xee\x07"
        if not 1 <= count <= 128:
            return b"\xee\x09" if count < 1 else b"\xee\x08"
        if not self._is_there(register, count):
            return b"\xee\x04"
        if given is None:
            return bytes((0xBB, count)) + self._read(register, count)
        if not self._are_writable(register, count):
            return b"\xee\x05"
        self._write(register, given)
        return b"\xee\x01"

    # -- registers -----------------------------------------------------------------------------------------------

    def _is_there(self, register: int, count: int) -> bool:
        return count >= 1 and register + count <= _END[self._page]

    def _are_writable(self, register: int, count: int) -> bool:
        return self._page == 1 or all(each in _WRITABLE for each in range(register, register + count))

    def _write(self, register: int, data: bytes) -> None:
        for at, value in enumerate(data, register):
            if at == PAGE:
                self._page = value & 1
            elif self._page == 0:
                self._set(at, value)

    def _set(self, register: int, value: int) -> None:
        now_s = self._clock()
        if register == TRIGGER:
            if value & _RESET:
                self.power_cycle()
        elif register == MODE:
            if value not in (CONFIG, *_FUSED):
                raise ChipMisuse(f"BNO055: mode {value:02x} is not simulated")
            if value != self._mode:
                self._mode_since_s = now_s + (_FROM_CONFIG_S if self._mode == CONFIG else _TO_CONFIG_S)
            self._mode = self.registers[MODE] = value
        elif self._mode == CONFIG and now_s >= self._mode_since_s:
            if register == UNITS and value & ~_ANDROID:
                raise ChipMisuse(f"BNO055: units {value:02x} are not simulated")
            if register != AXES or len({value & 3, value >> 2 & 3, value >> 4 & 3}) == 3:  # else it keeps the old ones
                self.registers[register] = value

    def _read(self, register: int, count: int) -> bytes:
        wanted = range(register, register + count)
        if self._page == 1:
            return bytes(1 if at == PAGE else 0 for at in wanted)
        if register < _MEASURED.stop and wanted.stop > _MEASURED.start:
            self._measure(is_asked=register < _FUSION.stop and wanted.stop > _FUSION.start)
        runs, error = self._state()
        state = bytes((0x0F, 0, 0, runs, error))  # its self-test passed
        self.registers[0x35:0x3B] = bytes((self.calibration, *state))
        return bytes(self.registers[register : wanted.stop])

    def _state(self) -> tuple[int, int]:
        """Return status and error."""
        if self._mode == CONFIG or self._clock() < self._mode_since_s:
            return 0, 0
        return (_RUNS, 0) if any(self.registers[0x69:0x6B]) else (_ERROR, _FUSION_CONFIGURATION)

    def _measure(self, *, is_asked: bool) -> None:
        """Put into the registers what the sensors and, if its registers are asked for, the fusion say now."""
        if self._mode == CONFIG or self.frozen:
            return
        self._samples += 1
        if is_asked and self._state()[0] == _RUNS:
            self._felt = self._sense.sample(self._clock())
            self.registers[_FUSION.start : _FUSION.stop] = self._fusion(*self._felt)
        heading_rad, pitch_rad, roll_rad = (radians(tenths / 10.0) for tenths in self._felt)
        noise = self._samples % 3 - 1
        field = _FIELD_LEVEL * sin(-heading_rad), _FIELD_LEVEL * cos(heading_rad), -_FIELD_DOWN
        x, y, z = _gravity(pitch_rad, roll_rad)
        self.registers[0x08:0x1A] = pack("<9h", x + noise, y, z - noise, *map(round, field), noise, 0, -noise)
        self.registers[0x34] = 21

    def _fusion(self, heading: int, pitch: int, roll: int) -> bytes:
        """Return heading, roll, pitch; quaternion; acceleration without gravity; gravity."""
        heading_rad, pitch_rad, roll_rad = (radians(tenths / 20.0) for tenths in (-heading, pitch, roll))  # halved
        ch, sh = cos(heading_rad), sin(heading_rad)
        cp, sp = cos(pitch_rad), sin(pitch_rad)
        cr, sr = cos(roll_rad), sin(roll_rad)
        quaternion = (
            ch * cp * cr - sh * sp * sr,
            ch * sp * cr - sh * cp * sr,
            ch * cp * sr + sh * sp * cr,
            sh * cp * cr + ch * sp * sr,
        )
        pitch16 = round(pitch * 1.6) * (-1 if self.registers[UNITS] & _ANDROID else 1)
        return pack(
            "<3h4h3h3h",
            round(heading * 1.6), round(roll * 1.6), pitch16,
            *(round(each * 16384) for each in quaternion),
            0, 0, 0,
            *_gravity(2.0 * pitch_rad, 2.0 * roll_rad),
        )  # fmt: skip


def _gravity(pitch_rad: float, roll_rad: float) -> tuple[int, int, int]:
    """Return what an accelerometer at rest measures, in hundredths of m/s²: x to the right, y ahead, z up."""
    x, y, z = -cos(pitch_rad) * sin(roll_rad), sin(pitch_rad), cos(pitch_rad) * cos(roll_rad)
    return round(981 * x), round(981 * y), round(981 * z)
