"""Faults of buses and chips, below the real drivers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from random import Random
from struct import pack
from typing import Any

from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.config.wiring import I2C, SERIAL, SPI, buses_asked
from wayfarer.drivers.buses import Frame
from wayfarer.drivers.pmw3901_burst import MOTION_BIT
from wayfarer.simhal.chip_wiring import driver_name
from wayfarer.simhal.chips.pmw3901 import BURST
from wayfarer.simhal.faults.bus_hang import Hang
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.scoped import Effect, changed, listed
from wayfarer.simhal.faults.wires import FaultyBuses, FaultyWire
from wayfarer.simhal.mounting import mounted

_THUNDERBORG_FAILSAFE = 20
_DARK_SQUAL, _LONGEST_SHUTTER = 0, 0x1FFF

# What asks a part who it is, and which byte of the answer says so.
_IDENTITY = {"cmps14": (0x00, 0), "pmw3901": (0x00, 1), "thunderborg": (153, 1)}

# To what each kind can happen: any part on such a bus, or these drivers.
CAMERA = "a camera"
_ANSWERING = (I2C, SPI)
_CHIPS = (*_ANSWERING, SERIAL)
_FITS: dict[str, tuple[str, ...]] = {
    "nack": (*_CHIPS, CAMERA),
    "hang": (*_CHIPS, CAMERA),
    "flipped_bits": _CHIPS,
    "shifted_block": _ANSWERING,
    "wrong_id": tuple(_IDENTITY),
    "reset": _CHIPS,
    "all_00": _ANSWERING,
    "all_ff": _ANSWERING,
    "lost_bytes": (SERIAL,),
    "failsafe_off": ("thunderborg",),
    "board_fault": ("thunderborg",),
    "ignores": ("thunderborg", "sabertooth"),
    "dark": ("pmw3901", "camera_motion"),
    "spikes": ("pmw3901",),
    "same_picture": ("camera_motion",),
    "uncalibrated": ("cmps14",),
}


@dataclass(frozen=True, slots=True)
class WiredPart:
    """Where a part is: the kind of its bus, its chip (or camera), its wire, and the hang of its bus."""

    driver: str
    settings: Any
    bus: str
    chip: Any
    wire: FaultyWire
    hang: Hang


def misplaced(fault: Fault, config: RoverConfig) -> str | None:
    """Return why a fault of this layer does not apply to a rover, None where it can."""
    if fault.target not in config.parts:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    table = config.parts[fault.target]
    if {driver_name(table), _bus_of(fault.target, table)[0]} & set(_FITS[fault.kind]):
        return None
    return f"rover '{config.name}': '{fault.kind}' does not apply to driver = \"{table['driver']}\""


def _bus_of(part: str, table: Mapping[str, Any]) -> tuple[str, str, Any]:
    """Return the kind and name of the bus that a part is on, and the part's settings; no name where it is on none."""
    driver, settings = part_settings(part, table)
    for kind, name in buses_asked(driver, settings):
        if kind != I2C or hasattr(settings, "address"):
            return kind, name, settings
    name = getattr(settings, "camera", "")
    return CAMERA if name else "no bus", name, settings


def place_of(fault: Fault, config: RoverConfig, buses: FaultyBuses) -> WiredPart:
    """Return where a fault is to happen that is not ``misplaced``."""
    table = config.parts[fault.target]
    kind, name, settings = _bus_of(fault.target, table)
    driver = driver_name(table)
    if kind == I2C:
        i2c: Any = buses.i2c(name)
        wire = i2c.chip_at(settings.address)
        return WiredPart(driver, settings, kind, wire.chip, wire, i2c.hang)
    if kind == CAMERA:
        camera = buses.views[name]
        return WiredPart(driver, settings, kind, camera, camera.wire, camera.hang)
    line: Any = buses.spi(name) if kind == SPI else buses.serial(name)
    return WiredPart(driver, settings, kind, line.chip, line.wire, line.hang)


def _nack(wired: WiredPart, params: Any, rng: Random) -> AbstractContextManager[None]:
    left = params.most

    def is_lost() -> bool:
        nonlocal left
        lost: bool = left > 0 and rng.random() < params.chance
        left -= lost
        return lost

    return listed(wired.wire.unheard, is_lost)


@contextmanager
def _hang(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    wired.hang.begin()
    yield
    wired.hang.end()


def _flipped_bits(wired: WiredPart, params: Any, rng: Random) -> AbstractContextManager[None]:
    def flip(data: bytes) -> bytes:
        if rng.random() >= params.chance or not data:
            return data
        wrong: int = int.from_bytes(data, "big")
        for bit in rng.sample(range(len(data) * 8), min(params.bits, len(data) * 8)):
            wrong ^= 1 << bit
        return wrong.to_bytes(len(data), "big")

    if wired.bus in _ANSWERING:
        return listed(wired.wire.answers, lambda _, answer: flip(answer))
    return listed(wired.wire.writes, flip)


def _shifted_block(wired: WiredPart, params: Any, _: Random) -> AbstractContextManager[None]:
    def shift(_: bytes, answer: bytes) -> bytes:
        whole = int.from_bytes(answer, "big") << int(params.bits)
        return (whole & ((1 << len(answer) * 8) - 1)).to_bytes(len(answer), "big")

    return listed(wired.wire.answers, shift)


def _all(byte: int) -> Effect:
    return lambda wired, _, __: listed(wired.wire.answers, lambda _, answer: bytes((byte,)) * len(answer))


def _answering(wired: WiredPart, question: int, at: int, says: int) -> AbstractContextManager[None]:
    """Change a byte of the answer to a question."""

    def lie(asked: bytes, answer: bytes) -> bytes:
        return answer[:at] + bytes((says,)) + answer[at + 1 :] if asked[:1] == bytes((question,)) else answer

    return listed(wired.wire.answers, lie)


@contextmanager
def _reset(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    """Take the power away: the part is silent for as long, and restarts after that."""
    power_cycle = getattr(wired.chip, "power_cycle", lambda: None)  # a third party's chip may have nothing to forget
    power_cycle()
    with ExitStack() as silence:
        if wired.bus == I2C:
            silence.enter_context(listed(wired.wire.unheard, lambda: True))
        else:
            silence.enter_context(listed(wired.wire.writes, lambda _: None))
            silence.enter_context(listed(wired.wire.answers, lambda _, answer: b"\xff" * len(answer)))
        yield
    power_cycle()


def _lost_bytes(wired: WiredPart, params: Any, rng: Random) -> AbstractContextManager[None]:
    def lose(data: bytes) -> bytes:
        return bytes(byte for byte in data if rng.random() >= params.chance)

    return listed(wired.wire.writes, lose)


@contextmanager
def _board_fault(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    wired.chip.drive_faults.add(0)
    yield
    wired.chip.drive_faults.discard(0)


def _ignores(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    """Let requests through and nothing that drives: the board continues with what it had."""
    return listed(wired.wire.writes, lambda data: data if len(data) == 1 else None)


def _dark(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    if wired.bus == CAMERA:
        return listed(wired.chip.shows, lambda frame: frame._replace(luma=frame.luma * 0))
    return changed(wired.chip, squal=_DARK_SQUAL, shutter=_LONGEST_SHUTTER)


def _spikes(wired: WiredPart, params: Any, _: Random) -> AbstractContextManager[None]:
    x, y = mounted(wired.settings)(params.counts, 0)
    bursts = 0

    def spike(asked: bytes, answer: bytes) -> bytes:
        nonlocal bursts
        bursts += asked[:1] == bytes((BURST,))
        if asked[:1] != bytes((BURST,)) or bursts % params.every:
            return answer
        motion, observation = answer[1] | MOTION_BIT, answer[2]
        return answer[:1] + pack("<BBhh", motion, observation, x, y) + answer[7:]

    return listed(wired.wire.answers, spike)


def _same_picture(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    def show(frame: Frame) -> Frame:
        last: Frame | None = wired.chip.last
        return frame if last is None else last._replace(t_s=frame.t_s)

    return listed(wired.chip.shows, show)


EFFECTS: Mapping[str, Effect] = {
    "nack": _nack,
    "hang": _hang,
    "flipped_bits": _flipped_bits,
    "shifted_block": _shifted_block,
    "wrong_id": lambda wired, params, _: _answering(wired, *_IDENTITY[wired.driver], params.says),
    "reset": _reset,
    "all_00": _all(0x00),
    "all_ff": _all(0xFF),
    "lost_bytes": _lost_bytes,
    "failsafe_off": lambda wired, _, __: _answering(wired, _THUNDERBORG_FAILSAFE, 1, 0),
    "board_fault": _board_fault,
    "ignores": _ignores,
    "dark": _dark,
    "spikes": _spikes,
    "same_picture": _same_picture,
    "uncalibrated": lambda wired, _, __: changed(wired.chip, calibration=0),
}
