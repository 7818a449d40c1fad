"""Bosch BNO055: compass, gyro and accelerometer that the part fuses itself, on a serial line (UART) or on I2C.

Registers, modes and times are those of its data sheet (BST-BNO055-DS000, revision 1.4); if it is silent, those of
docs/reference/hardware.md. The part has no checksum, and it stretches the I2C clock, which a Raspberry Pi up to 4 reads
wrongly: wire its UART there. On both lines a reading is one block that also has the quaternion, gravity, the state of
the fusion and what was set, and all of it must fit. A part that lost its power for a moment forgets without a word what
was set: the block shows that, and the part is opened again.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, degrees, hypot
from struct import Struct
from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Interval

from wayfarer.angles import wrap360
from wayfarer.drivers.buses import Buses, I2CBus, SerialPort
from wayfarer.drivers.cmps14_registers import CalibrationLevels
from wayfarer.errors import BadReading, DriverError, NotResponding, PowerLost, WrongPart
from wayfarer.hal import CompassReading

# -- registers -------------------------------------------------------------------------------------------------------

_IDS, _IDENTITY = 0x00, bytes((0xA0, 0xFB, 0x32, 0x0F))  # the part, its accelerometer, magnetometer and gyro
_RAW, _RAW_BYTES = 0x08, 18  # accelerometer, magnetometer, gyro as they measure
_UNITS, _MODE, _POWER, _AXES = 0x3B, 0x3D, 0x3E, 0x41
# Offsets of accelerometer, magnetometer and gyro, radius of the first two; 0 for the magnetometer's stops the fusion.
_OFFSETS, _OFFSETS_BYTES, _MAG_RADIUS = 0x55, 22, slice(20, 22)
_CONFIG = 0x00  # the mode in which settings can be written; elsewhere they are ignored
_MODES = {"ndof": 0x0C, "ndof_fmc_off": 0x0B}
_PLACEMENTS = {  # data sheet page 25: register 41, then 42
    "P0": (0x21, 0x04), "P1": (0x24, 0x00), "P2": (0x24, 0x06), "P3": (0x21, 0x02),
    "P4": (0x24, 0x03), "P5": (0x21, 0x01), "P6": (0x21, 0x07), "P7": (0x24, 0x05),
}  # fmt: skip
# m/s², degrees per second, degrees, °C. Written because the data sheet has two values for what holds at power-up.
_METRIC = 0x00
_AFTER_RESET = (_CONFIG, 0, *_PLACEMENTS["P1"])  # mode, power, axis map, axis signs
_FUSION_RUNS = 5

# Registers 1A to 42: heading; quaternion w, x, y, z; gravity x, y, z; calibration; status; error; units; mode; power;
# axis map and signs. Between them are Euler's pitch and roll, which are poor at a large tilt, and what is not used.
_BLOCK, _MAP = 0x1A, Struct("<H4x4h6x3hxB3x3BxBB2x2B")
_PER_DEGREE, _UNIT_QUATERNION, _GRAVITY = 16.0, 16384, 981
_FULL_TURN = 5760
# How far the lengths of quaternion and gravity may be off. Both are whole, so a hundredth is much; chosen by us.
_QUATERNION_OFF, _GRAVITY_OFF = 300, 50

_ERRORS = (
    "none", "a sensor did not start", "the system did not start", "self-test", "a value out of range",
    "an address out of range", "a register write", "low-power mode", "accelerometer's power mode",
    "the fusion's configuration: bad offsets?", "a sensor's configuration",
)  # fmt: skip
_SWITCH = "turn its power off and on"
CORRUPTED = "bytes shifted or swapped on the bus"

# -- times -----------------------------------------------------------------------------------------------------------

_TO_CONFIG_S, _FROM_CONFIG_S = 0.02, 0.01  # table 3-6: 19 ms and 7 ms
_LOOK_S = 0.02  # the sensors measure at 20 to 100 Hz
OPEN_S = _TO_CONFIG_S + _FROM_CONFIG_S + _LOOK_S
_START_TRIES, _START_PAUSE_S = 10, 0.1  # how long the fusion takes to start is not documented
# A command that came while the part was busy is refused; that passes in 100 to 400 ms (Bosch's forum).
_UART_TRIES, _UART_PAUSE_S = 4, 0.1


@dataclass(frozen=True, slots=True)
class BNO055Settings:
    """Where the compass is and how it is mounted."""

    port: str = ""
    """Serial port, if the part is wired as UART (its pin PS1 high, PS0 low); ``bus`` and ``address`` do not count
    then. On a Raspberry Pi the better choice: it reads the part wrongly on I2C."""
    bus: str = "/dev/i2c-1"
    """Device file of the I2C bus, if there is no ``port``."""
    address: Annotated[int, Interval(ge=0x28, le=0x29)] = 0x28
    """I2C address, 7-bit: 0x28 with its pin COM3 low, as on most boards."""
    placement: Literal["P0", "P1", "P2", "P3", "P4", "P5", "P6", "P7"] = "P1"
    """How the chip lies, as the data sheet names it (page 25). P1 is flat, as most boards are mounted."""
    mode: Literal["ndof", "ndof_fmc_off"] = "ndof"
    """Which fusion: ``ndof_fmc_off`` calibrates its magnetometer more slowly, and its heading jumps less by that."""
    heading_offset_deg: Annotated[float, Interval(ge=-180, le=180)] = 0.0
    """Added to the heading. Which axis points north at heading 0 is unconfirmed: compare with another compass, and
    expect -90, 90 or 180."""
    swap_pitch_roll: bool = False
    """The part is mounted across; applied before ``reverse_pitch`` and ``reverse_roll``."""
    reverse_pitch: bool = False
    """The part reads negative with the nose up; in P1 its y axis points ahead, ``check`` shows which way is up."""
    reverse_roll: bool = False
    """The part reads negative with the right side down; in P1 its x axis points to the right."""
    offsets: str = ""
    """What ``wayfarer calibrate`` found, 44 hexadecimal digits: the part forgets it without power. It begins with them,
    and still needs to be turned about until its level is 3."""

    def __post_init__(self) -> None:
        try:
            offsets = bytes.fromhex(self.offsets)
        except ValueError:
            raise ValueError(f"offsets '{self.offsets}': not hexadecimal digits") from None
        if offsets and (len(offsets) != _OFFSETS_BYTES or not any(offsets[_MAG_RADIUS])):
            raise ValueError(f"offsets '{self.offsets}': need {2 * _OFFSETS_BYTES} digits, the last four not all 0")


class Block(NamedTuple):
    """The registers 1A to 42, as far as they are used."""

    heading: int
    quaternion: tuple[int, int, int, int]
    gravity: tuple[int, int, int]
    levels: CalibrationLevels
    status: int
    error: int
    settings: tuple[int, int, int, int, int]  # units, mode, power, axis map, axis signs

    @property
    def tilt_deg(self) -> tuple[float, float]:
        """Pitch, positive with y up, and roll, positive with x down: what is up is where gravity is measured."""
        x, y, z = self.gravity
        return degrees(atan2(y, hypot(x, z))), degrees(atan2(-x, z))


def decode(data: bytes) -> Block:
    """Decode the bytes from register 1A on, plausible or not."""
    said = _MAP.unpack(data)
    levels = CalibrationLevels(*(said[8] >> shift & 3 for shift in (6, 4, 2, 0)))
    return Block(said[0], said[1:5], said[5:8], levels, said[9], said[10], said[11:])


def flaw(block: Block) -> str | None:
    """Return why the values of a block cannot be true, or None; what was set is not looked at."""
    if block.status != _FUSION_RUNS or block.error:
        why = _ERRORS[block.error] if block.error < len(_ERRORS) else f"0x{block.error:02X}"
        return f"its fusion does not run: status {block.status}, error {block.error} ({why})"
    if block.heading > _FULL_TURN:
        return f"heading {block.heading / _PER_DEGREE:.1f} is beyond 360: {CORRUPTED}"
    if abs(hypot(*block.quaternion) - _UNIT_QUATERNION) > _QUATERNION_OFF:
        return f"its quaternion has the length {hypot(*block.quaternion) / _UNIT_QUATERNION:.2f}, not 1: {CORRUPTED}"
    if abs(hypot(*block.gravity) - _GRAVITY) > _GRAVITY_OFF:
        return f"its gravity is {hypot(*block.gravity) / 100:.1f} m/s², not 9.8: {CORRUPTED}"
    return None


# -- transports ------------------------------------------------------------------------------------------------------


class _OnI2C:
    """Registers over I2C: a transfer that is not acknowledged is repeated once."""

    silent = "check power, wires and address, and that its pins PS1 and PS0 are low: else it is on a serial line"
    remedy = "it stretches the I2C clock: wire its UART (PS1 high, PS0 low), or set i2c_arm_baudrate=10000"
    note = "on I2C, where a Raspberry Pi up to 4 may read it wrongly; its UART avoids that"

    def __init__(self, bus: I2CBus, address: int) -> None:
        self._bus, self._address = bus, address

    async def read(self, register: int, count: int) -> bytes:
        """Read registers, from this one on."""
        try:
            return await self._bus.write_read(self._address, bytes((register,)), count)
        except NotResponding as error:
            if error.remedy:
                raise
            return await self._bus.write_read(self._address, bytes((register,)), count)

    async def write(self, register: int, data: bytes) -> None:
        """Write registers, from this one on."""
        await self._bus.write(self._address, bytes((register, *data)))


_WRITE, _READ, _ANSWER, _STATUS = b"\xaa\x00", b"\xaa\x01", 0xBB, 0xEE
_DONE, _BUSY = 0x01, 0x07
_REFUSALS = {
    0x02: "read failed", 0x03: "write failed", 0x04: "no such register", 0x05: "register cannot be written",
    0x06: "wrong start byte", 0x07: "it is busy", 0x08: "too long", 0x09: "too short", 0x0A: "a byte came too late",
}  # fmt: skip


_NO_UART = "stop what else is on this port, such as Linux's console (sudo raspi-config); PS1 must be high, PS0 low"


class _OnUart:
    """Registers over the serial line (data sheet page 94); what is refused or garbled is repeated."""

    silent = "check power, that TX is at RX, and that PS1 was high and PS0 low when it got power: else it is on I2C"
    remedy = ""
    note = ""

    def __init__(self, port: SerialPort, part: str) -> None:
        self._port, self._part = port, part

    async def read(self, register: int, count: int) -> bytes:
        """Read registers, from this one on."""
        return await self._asked(_READ + bytes((register, count)), bytes((_ANSWER, count)), count)

    async def write(self, register: int, data: bytes) -> None:
        """Write registers, from this one on."""
        await self._asked(_WRITE + bytes((register, len(data), *data)), bytes((_STATUS, _DONE)), 0)

    async def _asked(self, command: bytes, head: bytes, count: int) -> bytes:
        """Return what follows the head of an answer."""

        def missing(came: bytes) -> int:
            """Return how many bytes are still to come: of this answer, of a refusal, none after garbage."""
            if came[:2] == head[: len(came)]:
                return len(head) + count - len(came)
            return len(head) - len(came) if came[0] == _STATUS else 0

        failed: DriverError = NotResponding(f"{self._part}: no answer")
        for attempt in range(_UART_TRIES):
            if attempt:
                await asyncio.sleep(_UART_PAUSE_S)
            try:
                came = await self._port.exchange(command, missing)
            except NotResponding as error:
                if error.remedy:
                    raise
                failed = error
                continue
            if came[:2] == head:
                return came[2 : 2 + count]
            if came[0] == _STATUS and len(came) > 1 and came[1] in _REFUSALS:
                failed = BadReading(f"{self._part}: it refuses: {_REFUSALS[came[1]]}")
            else:
                failed = BadReading(
                    f"{self._part}: it answered {came[:8].hex(' ')}, which a BNO055 never sends", _NO_UART
                )
        raise failed


# -- the part --------------------------------------------------------------------------------------------------------


class BNO055:
    """The compass as ``hal.Compass``; ``error_counts`` counts the blocks that had to be read again."""

    part: ClassVar[str] = "compass"
    addresses: ClassVar[Sequence[int]] = (0x28, 0x29)
    Settings = BNO055Settings

    def __init__(self, settings: BNO055Settings, buses: Buses) -> None:
        self._settings = settings
        self._wire: _OnUart | _OnI2C
        if settings.port:
            self.name = f"BNO055 on {settings.port}"
            self._wire = _OnUart(buses.serial(settings.port, baud=115_200), self.name)
        else:
            self._wire = _OnI2C(buses.i2c(settings.bus), settings.address)
            self.name = f"BNO055 at 0x{settings.address:02X} on {settings.bus}"
        self.note = self._wire.note
        self._written = (_METRIC, _MODES[settings.mode], 0, *_PLACEMENTS[settings.placement])
        self.error_counts: Counter[str] = Counter()

    async def open(self) -> None:
        """Identify the part, see that its sensors measure, write its settings, and wait for its fusion; raises as that.

        What it has learnt of the field since it got power is kept.
        """
        await self.identify()
        units, mode, power, *axes = self._written
        await self._wire.write(_MODE, bytes((_CONFIG,)))
        await asyncio.sleep(_TO_CONFIG_S)
        await self._wire.write(_UNITS, bytes((units,)))
        await self._wire.write(_POWER, bytes((power,)))
        await self._wire.write(_AXES, bytes(axes))
        if self._settings.offsets:
            await self._wire.write(_OFFSETS, bytes.fromhex(self._settings.offsets))
        await self._wire.write(_MODE, bytes((mode,)))
        await asyncio.sleep(_FROM_CONFIG_S)
        await self._measures()
        for left in reversed(range(_START_TRIES)):
            if (failed := self._flaw(decode(await self._wire.read(_BLOCK, _MAP.size)))) is None:
                return
            if not left:
                raise failed
            await asyncio.sleep(_START_PAUSE_S)

    async def identify(self) -> None:
        """Read the four identities, and once more if they are others. Only reads.

        Raises:
            NotResponding: nothing answers.
            WrongPart: other identities.
            BadReading: only on the serial line: garbage.
        """
        try:
            if await self._wire.read(_IDS, len(_IDENTITY)) == _IDENTITY:
                return
            said = await self._wire.read(_IDS, len(_IDENTITY))
        except NotResponding as error:
            if error.remedy:  # no wire is the reason
                raise
            raise NotResponding(f"{self.name}: no answer ({error}); {self._wire.silent}") from error
        if said != _IDENTITY:
            raise WrongPart(self.name, f"the identities {_IDENTITY.hex(' ')} of a BNO055", said.hex(" "))

    async def close(self) -> None:
        """Nothing to release."""

    async def read(self) -> CompassReading:
        """Return heading and tilt; a block that cannot be true is read once more, within the same call.

        Raises:
            NotResponding: no answer, with its repetitions.
            BadReading: an implausible block, twice.
            PowerLost: the part has forgotten its settings.
        """
        block = await self._valid_block()
        t_s = asyncio.get_running_loop().time()
        settings, (pitch_deg, roll_deg) = self._settings, block.tilt_deg
        if settings.swap_pitch_roll:
            pitch_deg, roll_deg = roll_deg, pitch_deg
        return CompassReading(
            t_s,
            wrap360(block.heading / _PER_DEGREE + settings.heading_offset_deg),
            -pitch_deg if settings.reverse_pitch else pitch_deg,
            -roll_deg if settings.reverse_roll else roll_deg,
            block.levels.mag,  # that of the system goes up and down
        )

    async def calibration(self) -> CalibrationLevels:
        """Return all levels of calibration; raises as ``read`` does."""
        return (await self._valid_block()).levels

    async def offsets(self) -> str:
        """Return what it has learnt, as the setting ``offsets``; there is no heading for 30 ms. Raises as ``read``."""
        await self._wire.write(_MODE, bytes((_CONFIG,)))
        await asyncio.sleep(_TO_CONFIG_S)
        offsets = await self._wire.read(_OFFSETS, _OFFSETS_BYTES)
        await self._wire.write(_MODE, bytes((_MODES[self._settings.mode],)))
        await asyncio.sleep(_FROM_CONFIG_S)
        return offsets.hex()

    async def _valid_block(self) -> Block:
        block = decode(await self._wire.read(_BLOCK, _MAP.size))
        if self._flaw(block) is not None:
            self.error_counts["reads retried"] += 1
            await self.identify()
            block = decode(await self._wire.read(_BLOCK, _MAP.size))
            if block.settings[1:] == _AFTER_RESET:
                raise PowerLost(self.name)
            if (failed := self._flaw(block)) is not None:
                raise failed
        return block

    def _flaw(self, block: Block) -> BadReading | None:
        """Return why a block cannot be true, or is not of what was set; None if it can."""
        why = flaw(block)
        if why is None and block.settings != self._written:
            why = f"its settings read {' '.join(f'{value:02X}' for value in block.settings)}: {CORRUPTED}"
        return BadReading(f"{self.name}: {why}", self._wire.remedy if CORRUPTED in why else _SWITCH) if why else None

    async def _measures(self) -> None:
        """See that what the sensors measure changes, as even at rest it does by their noise.

        Raises:
            BadReading: it does not.
        """
        first = await self._wire.read(_RAW, _RAW_BYTES)
        for _ in range(_START_TRIES):
            await asyncio.sleep(_LOOK_S)
            if await self._wire.read(_RAW, _RAW_BYTES) != first:
                return
        raise BadReading(f"{self.name}: its sensors send nothing new, they repeat {first.hex()}", _SWITCH)
