"""Drivers, over wires on which any answer may come: whole, flipped, shifted, of another, or none.

An answer has as many bytes as were asked for, because buses promise that. ``read`` gives a reading that is finite and
in the ranges of ``hal``, or raises a ``DriverError``. A Sabertooth says nothing, and pins have no bytes.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from math import isfinite
from struct import pack
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tests.fuzz.damage import Choices
from tests.fuzz.target import Target, Try, refused
from tests.kit.boards import now_s
from tests.simhal.clearing import steady_world
from wayfarer.drivers.bno055 import BNO055, BNO055Settings
from wayfarer.drivers.buses import ANSWER_WITHIN_S, Frame, Missing, whole
from wayfarer.drivers.camera_motion import CameraMotion, CameraMotionSettings
from wayfarer.drivers.cmps14 import CMPS14, CMPS14Settings
from wayfarer.drivers.pmw3901 import PMW3901, PMW3901Settings
from wayfarer.drivers.roboclaw import RoboClaw, RoboClawSettings
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.drivers.thunderborg_board import ThunderBorgLight, ThunderBorgLightSettings
from wayfarer.errors import DriverError, NotResponding
from wayfarer.hal import Colour, CompassReading, MotionReading, MotorHealth, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.roboclaw import RoboClawChip
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

READS = 6
PERIOD_S = 0.05
# What single transfers suffer, in their order. The first ones often nothing: a part that does not open is not read.
FAULTS = st.builds(
    lambda sound, faults: [b""] * sound + faults,
    st.sampled_from((0, 10, 30, 250)),  # an optical flow sensor takes 190 to open
    st.lists(st.binary(max_size=34), max_size=40),
)

# Of a part that makes three transfers in total, and of one that tries each up to four times.
FAULTS_AT_ONCE = st.lists(st.binary(min_size=1, max_size=34), min_size=1, max_size=40)

Answer = Callable[[bytes, int], bytes]
Use = Callable[[Any], Awaitable[object]]


class Wire:
    """A bus of which each transfer's answer suffers what ``faults`` tells of it; implements all of ``buses``' kinds.

    Args:
        answer: what the part would say to these bytes, in so many.
        faults: of each transfer, until they are used up.
    """

    name = "a wire"

    def __init__(self, answer: Answer, faults: list[bytes]) -> None:
        self._answer = answer
        self._faults = iter(faults)

    def __call__(self, name: str, **settings: Any) -> Wire:
        return self

    i2c = spi = serial = __call__

    async def write(self, address: int, data: bytes) -> None:
        self._suffered(b"")

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        return self._suffered(self._answer(data, count))

    write_then_read = write_read

    async def transfer(self, *pieces: bytes) -> tuple[bytes, ...]:
        return tuple(self._suffered(self._answer(piece, len(piece))) for piece in pieces)

    async def exchange(self, data: bytes, missing: Missing, *, within_s: float = ANSWER_WITHIN_S) -> bytes:
        answer = self._suffered(self._answer(data, data[-1]))
        return whole(self.name, answer, missing, within_s)

    def post(self, *data: Any) -> None:
        pass

    def _suffered(self, answer: bytes) -> bytes:
        choices, bits = Choices(next(self._faults, b"")), len(answer) * 8
        kind = choices.below(8)
        if kind == 1:
            raise NotResponding("no acknowledgement")
        if kind == 2:
            return choices.of((b"\x00", b"\xff")) * len(answer)
        if kind == 3:
            return choices.take(len(answer))
        number = int.from_bytes(answer, "big")
        if kind == 4 and bits:
            number = number << choices.of((1, 8, 4)) & ((1 << bits) - 1)
        elif kind == 5:
            number >>= choices.of((1, 8, 4))
        elif kind in (6, 7) and bits:
            for _ in range(1 + choices.below(kind)):
                number ^= 1 << choices.below(bits)
        return number.to_bytes(len(answer), "big")


@contextmanager
def _driven(make: Callable[[list[bytes]], Any], use: Use) -> Iterator[Try]:
    """Open a part over a wire with the faults of each case, and use it some times."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        yield lambda faults: runner.run(_used(make(faults), use))


async def _used(part: Any, use: Use) -> str:
    outcomes = [await _refusal(part.open())]
    for _ in range(READS):
        await asyncio.sleep(PERIOD_S)
        outcomes.append(await _refusal(use(part)))
    await part.close()
    return " / ".join(sorted(set(outcomes)))


async def _refusal(step: Awaitable[object]) -> str:
    try:
        await step
    except DriverError as error:
        return refused(error)
    return "well"


def _check_now(t_s: float) -> None:
    assert t_s == asyncio.get_running_loop().time()


# -- compass ---------------------------------------------------------------------------------------------------------

BLOCK = pack(">BBHbb9h2xhhB", 7, 64, 900, 3, -2, 1, 2, 3, 4, 5, 1000, 7, 8, 9, 30, -20, 0xFF)


async def _read_compass(part: CMPS14 | BNO055) -> None:
    reading = await part.read()
    assert isinstance(reading, CompassReading)
    _check_now(reading.t_s)
    assert 0.0 <= reading.heading_deg < 360.0
    assert -180.0 <= reading.pitch_deg <= 180.0 and -180.0 <= reading.roll_deg <= 180.0
    assert reading.calibration in range(4)


COMPASS = Target(
    "cmps14",
    FAULTS,
    lambda: _driven(
        lambda faults: CMPS14(
            CMPS14Settings(heading_offset_deg=-180.0, reverse_pitch=True, swap_pitch_roll=bool(len(faults) % 2)),
            Wire(lambda data, count: BLOCK[:count], faults),  # type: ignore[arg-type]
        ),
        _read_compass,
    ),
)  # fmt: skip


# Registers 00 to 42 of a BNO055 whose fusion runs: a quarter turn clockwise, the right side 10 degrees down.
FUSED = bytes.fromhex(
    "A0 FB 32 0F" + "00" * 22 + "A0 05 00 00 00 00 41 2D 00 00 00 00 BF D2 00 00 00 00 00 00 56 FF 00 00 C6 03"
    "15 FF 0F 00 00 05 00 00 00 0C 00 00 01 24 00"
)


class LivelyBNO055:
    """What it answers; its raw axes change with each read."""

    def __init__(self) -> None:
        self._reads = 0

    def on_i2c(self, data: bytes, count: int) -> bytes:
        self._reads += 1
        return (FUSED[:8] + bytes((self._reads % 256,)) + FUSED[9:])[data[0] :][:count]

    def on_uart(self, data: bytes, count: int) -> bytes:
        return b"\xee\x01" if data[1] == 0 else bytes((0xBB, count)) + self.on_i2c(data[2:], count)


BNO055_ON_I2C, BNO055_ON_UART = (
    Target(
        f"bno055 {port}",
        cases,
        lambda port=port, line=line: _driven(  # type: ignore[misc]
            lambda faults: BNO055(
                BNO055Settings(port=port, heading_offset_deg=-180.0, swap_pitch_roll=bool(len(faults) % 2)),
                Wire(getattr(LivelyBNO055(), line), faults),  # type: ignore[arg-type]
            ),
            _read_compass,
        ),
    )
    for port, line, cases in (("", "on_i2c", FAULTS), ("/dev/serial0", "on_uart", FAULTS_AT_ONCE))
)


# -- optical flow ----------------------------------------------------------------------------------------------------

REGISTERS = {0x00: 0x49, 0x5F: 0xB6, 0x15: 0xBF, 0x47: 0x08, 0x67: 0x80, 0x70: 0x20, 0x71: 0x30}
BURST = pack("<BBhhB3xBB", 0x80, 0xBF, -40, 30, 90, 0x05, 0x10)


def _flow_answer(data: bytes, count: int) -> bytes:
    return b"\0" + BURST if data[0] == 0x16 else bytes((0, REGISTERS.get(data[0], 0)))


async def _read_motion(part: PMW3901 | CameraMotion) -> None:
    reading = await part.read()
    assert isinstance(reading, MotionReading)
    _check_now(reading.t_s)
    assert isfinite(reading.forward_m) and isfinite(reading.right_m)
    assert 0.0 <= reading.quality <= 1.0
    assert reading.quality == 0.0 or abs(reading.forward_m) < 100.0


FLOW = Target(
    "pmw3901",
    FAULTS,
    lambda: _driven(lambda faults: PMW3901(PMW3901Settings(), Wire(_flow_answer, faults)), _read_motion),  # type: ignore[arg-type]
)  # fmt: skip


# -- motor board -----------------------------------------------------------------------------------------------------

REPLIES = {20: b"\x01", 21: b"\x01\x50", 153: b"\x15", 10: b"\x01\x40", 13: b"\x02\x40", 15: b"\x00", 16: b"\x00"}


def _board_answer(data: bytes, count: int) -> bytes:
    return (data[:1] + REPLIES.get(data[0], b"")).ljust(count, b"\0")


async def _use_board(part: ThunderBorg | RoboClaw) -> None:
    applied = await part.drive(WheelCommand(0.5, -0.25))
    assert applied.left <= 0.5 and applied.right >= -0.25
    said, health = await part.read_back(), await part.health()
    assert all(-1.0 <= duty <= 1.0 for duty in said), said
    assert isinstance(health, MotorHealth)
    assert health.battery_v is None or 0.0 <= health.battery_v < 37.0
    await part.stop()


async def _use_light(part: ThunderBorgLight) -> None:
    await part.show(Colour(1.0, 0.5, 0.0))
    await part.show(Colour(0.0, 0.0, 0.0))


BOARD = Target(
    "thunderborg",
    FAULTS,
    lambda: _driven(lambda faults: ThunderBorg(ThunderBorgSettings(), Wire(_board_answer, faults)), _use_board),  # type: ignore[arg-type]
)


def _claw() -> Answer:
    chip = RoboClawChip(steady_world(), now_s)
    return lambda data, _: chip.receive(data)


CLAW = Target(
    "roboclaw",
    FAULTS,
    lambda: _driven(
        lambda faults: RoboClaw(RoboClawSettings(), Wire(_claw(), faults)),  # type: ignore[arg-type]
        _use_board,
    ),
)
LIGHT = Target(
    "thunderborg-light",
    FAULTS_AT_ONCE,
    lambda: _driven(
        lambda faults: ThunderBorgLight(ThunderBorgLightSettings(), Wire(_board_answer, faults)),  # type: ignore[arg-type]
        _use_light,
    ),
)


# -- camera ----------------------------------------------------------------------------------------------------------

SHAPES = ((32, 48), (32, 48), (32, 48), (48, 32), (32, 48, 3), (0, 48), (), (1,), (33, 49))
KINDS = ("uint8", "uint8", "uint8", "float32", "float64", "int64", "bool", "uint16", "complex64", "object")
DOWN = CameraMotionSettings(width=48, height=32, m_per_pixel=0.002, forward="+x")
AHEAD = CameraMotionSettings(width=48, height=32, method="difference", difference_still=2.0, difference_moving=20.0)


def _picture(told: bytes) -> Any:
    choices = Choices(told)
    shape, kind = choices.of(SHAPES), choices.of(KINDS)
    fill = choices.below(5)
    if fill == 0:
        luma: Any = np.random.default_rng(choices.below(4)).integers(0, 256, shape)
    elif fill == 1:
        luma = np.full(shape, choices.below(256))
    elif fill == 2:
        luma = np.arange(int(np.prod(shape))).reshape(shape) % (1 + choices.below(256))
    else:
        luma = np.full(shape, 90.0)
        luma.flat[: choices.below(256)] = choices.of((np.nan, np.inf, -np.inf, 1e308)) if kind[0] == "f" else 255
    with np.errstate(all="ignore"):
        return np.asarray(luma, dtype=kind)


def _camera(told: list[bytes]) -> CameraMotion:
    buses, pictures = FakeBuses(), iter(told)

    def render(t_s: float, _width: int, _height: int) -> Frame:
        picture = next(pictures, b"")
        if picture == b"\x01":
            raise NotResponding("no picture")
        return Frame(t_s, _picture(picture))

    buses.cameras["0"] = render
    return CameraMotion(DOWN if len(told) % 2 else AHEAD, buses)


CAMERA = Target(
    "camera",
    st.lists(st.binary(max_size=6), max_size=READS),
    lambda: _driven(_camera, _read_motion),
)
