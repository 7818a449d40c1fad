"""Faults of buses and chips, below the real drivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from random import Random
from struct import pack
from typing import Any

from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.drivers.buses import Frame
from wayfarer.drivers.camera_motion import CameraMotionSettings
from wayfarer.drivers.cmps14 import CMPS14Settings
from wayfarer.drivers.pmw3901 import MOTION_BIT, PMW3901Settings
from wayfarer.drivers.sabertooth import SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorgSettings
from wayfarer.simhal.build_rover import mounted
from wayfarer.simhal.buses import FakeI2C
from wayfarer.simhal.chips.pmw3901 import BURST
from wayfarer.simhal.faults.bus_hang import Hang
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.wires import FaultyWire, TamperedBuses

_THUNDERBORG_ID, _THUNDERBORG_FAILSAFE = 153, 20
_PMW3901_PRODUCT = 0x00
_DARK_SQUAL, _LONGEST_SHUTTER = 0, 0x1FFF


# To what each kind can happen, by the settings of its driver.
_ANSWERING = (CMPS14Settings, PMW3901Settings, ThunderBorgSettings)
_CHIPS = (*_ANSWERING, SabertoothSettings)
_FITS: dict[str, tuple[type, ...]] = {
    "nack": (*_CHIPS, CameraMotionSettings),
    "hang": (*_CHIPS, CameraMotionSettings),
    "flipped_bits": _CHIPS,
    "shifted_block": _ANSWERING,
    "wrong_id": _ANSWERING,
    "reset": _CHIPS,
    "all_00": _ANSWERING,
    "all_ff": _ANSWERING,
    "lost_bytes": (SabertoothSettings,),
    "failsafe_off": (ThunderBorgSettings,),
    "board_fault": (ThunderBorgSettings,),
    "ignores": (ThunderBorgSettings, SabertoothSettings),
    "dark": (PMW3901Settings, CameraMotionSettings),
    "spikes": (PMW3901Settings,),
    "same_picture": (CameraMotionSettings,),
    "uncalibrated": (CMPS14Settings,),
}


@dataclass(frozen=True, slots=True)
class WiredPart:
    """Where a part is: its chip (or camera), its wire, and the hang of its bus; ``settings`` are its driver's."""

    settings: Any
    chip: Any
    wire: FaultyWire
    hang: Hang


def misplaced(fault: Fault, config: RoverConfig) -> str | None:
    """Say why a fault of this layer cannot happen to a rover, None where it can."""
    if fault.target not in config.parts:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    table = config.parts[fault.target]
    if isinstance(part_settings(fault.target, table)[1], _FITS[fault.kind]):
        return None
    return f"rover '{config.name}': '{fault.kind}' cannot happen to driver = \"{table['driver']}\""


def place_of(fault: Fault, config: RoverConfig, buses: TamperedBuses) -> WiredPart:
    """Return where a fault is to happen that is not ``misplaced``."""
    settings = part_settings(fault.target, config.parts[fault.target])[1]
    if isinstance(settings, CMPS14Settings | ThunderBorgSettings):
        i2c = buses.i2c(settings.bus)
        return WiredPart(settings, FakeI2C.chip_at(i2c, settings.address), i2c.wire(settings.address), i2c.hang)
    if isinstance(settings, PMW3901Settings):
        spi = buses.spi(settings.bus)
        return WiredPart(settings, spi.chip, spi.wire, spi.hang)
    if isinstance(settings, SabertoothSettings):
        port = buses.serial(settings.port)
        return WiredPart(settings, port.chip, port.wire, port.hang)
    assert isinstance(settings, CameraMotionSettings)
    camera = buses.views[settings.camera]
    return WiredPart(settings, camera, camera.wire, camera.hang)


def bus_fault(fault: Fault, wired: WiredPart, chance: Random) -> AbstractContextManager[None]:
    """Return what makes a fault of this layer happen."""
    effect: AbstractContextManager[None] = _EFFECTS[fault.kind](wired, fault.params, chance)
    return effect


@contextmanager
def _listed(items: list[Any], item: Any) -> Iterator[None]:
    items.append(item)
    yield
    items.remove(item)


def _nack(wired: WiredPart, params: Any, chance: Random) -> AbstractContextManager[None]:
    left = params.most

    def is_lost() -> bool:
        nonlocal left
        lost: bool = left > 0 and chance.random() < params.chance
        left -= lost
        return lost

    return _listed(wired.wire.unheard, is_lost)


@contextmanager
def _hang(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    wired.hang.begin()
    yield
    wired.hang.end()


def _flipped_bits(wired: WiredPart, params: Any, chance: Random) -> AbstractContextManager[None]:
    def flip(data: bytes) -> bytes:
        if chance.random() >= params.chance or not data:
            return data
        wrong: int = int.from_bytes(data, "big")
        for bit in chance.sample(range(len(data) * 8), min(params.bits, len(data) * 8)):
            wrong ^= 1 << bit
        return wrong.to_bytes(len(data), "big")

    if isinstance(wired.settings, _ANSWERING):
        return _listed(wired.wire.answers, lambda _, answer: flip(answer))
    return _listed(wired.wire.writes, flip)


def _shifted_block(wired: WiredPart, params: Any, _: Random) -> AbstractContextManager[None]:
    def shift(_: bytes, answer: bytes) -> bytes:
        whole = int.from_bytes(answer, "big") << int(params.bits)
        return (whole & ((1 << len(answer) * 8) - 1)).to_bytes(len(answer), "big")

    return _listed(wired.wire.answers, shift)


def _all(byte: int) -> Callable[..., AbstractContextManager[None]]:
    def effect(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
        return _listed(wired.wire.answers, lambda _, answer: bytes((byte,)) * len(answer))

    return effect


def _wrong_id(wired: WiredPart, params: Any, _: Random) -> AbstractContextManager[None]:
    """Change what the part says when it is asked who it is."""

    def lie(asked: bytes, answer: bytes) -> bytes:
        if isinstance(wired.settings, CMPS14Settings) and asked == b"\x00":
            return bytes((params.says,)) + answer[1:]
        if isinstance(wired.settings, ThunderBorgSettings) and asked[:1] == bytes((_THUNDERBORG_ID,)):
            return answer[:1] + bytes((params.says,)) + answer[2:]
        if isinstance(wired.settings, PMW3901Settings) and asked[:1] == bytes((_PMW3901_PRODUCT,)):
            return answer[:1] + bytes((params.says,))
        return answer

    return _listed(wired.wire.answers, lie)


@contextmanager
def _reset(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    """Take the power away: the part is silent for as long, and restarts after that."""
    _lose_power(wired.chip)
    with ExitStack() as silence:
        if isinstance(wired.settings, CMPS14Settings | ThunderBorgSettings):
            silence.enter_context(_listed(wired.wire.unheard, lambda: True))
        else:
            silence.enter_context(_listed(wired.wire.writes, lambda _: None))
            silence.enter_context(_listed(wired.wire.answers, lambda _, answer: b"\xff" * len(answer)))
        yield
    _lose_power(wired.chip)


def _lose_power(chip: Any) -> None:
    for name in ("power_cycle", "lose_power", "reset"):
        if hasattr(chip, name):
            getattr(chip, name)()
            return


def _lost_bytes(wired: WiredPart, params: Any, chance: Random) -> AbstractContextManager[None]:
    def lose(data: bytes) -> bytes:
        return bytes(byte for byte in data if chance.random() >= params.chance)

    return _listed(wired.wire.writes, lose)


def _failsafe_off(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    def off(asked: bytes, answer: bytes) -> bytes:
        return answer[:1] + b"\0" + answer[2:] if asked == bytes((_THUNDERBORG_FAILSAFE,)) else answer

    return _listed(wired.wire.answers, off)


@contextmanager
def _board_fault(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    wired.chip.drive_faults.add(0)
    yield
    wired.chip.drive_faults.discard(0)


def _ignores(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    """Let requests through and nothing that drives: the board goes on with what it had."""

    def drop(data: bytes) -> bytes | None:
        return data if len(data) == 1 else None

    return _listed(wired.wire.writes, drop)


def _dark(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    if isinstance(wired.settings, CameraMotionSettings):
        return _listed(wired.chip.shows, lambda frame: frame._replace(luma=frame.luma * 0))
    return _dark_chip(wired)


@contextmanager
def _dark_chip(wired: WiredPart) -> Iterator[None]:
    kept = wired.chip.squal, wired.chip.shutter
    wired.chip.squal, wired.chip.shutter = _DARK_SQUAL, _LONGEST_SHUTTER
    yield
    wired.chip.squal, wired.chip.shutter = kept


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

    return _listed(wired.wire.answers, spike)


def _same_picture(wired: WiredPart, _: object, __: Random) -> AbstractContextManager[None]:
    def show(frame: Frame) -> Frame:
        last: Frame | None = wired.chip.last
        return frame if last is None else last._replace(t_s=frame.t_s)

    return _listed(wired.chip.shows, show)


@contextmanager
def _uncalibrated(wired: WiredPart, _: object, __: Random) -> Iterator[None]:
    kept = wired.chip.calibration
    wired.chip.calibration = 0
    yield
    wired.chip.calibration = kept


_EFFECTS: dict[str, Any] = {
    "nack": _nack,
    "hang": _hang,
    "flipped_bits": _flipped_bits,
    "shifted_block": _shifted_block,
    "wrong_id": _wrong_id,
    "reset": _reset,
    "all_00": _all(0x00),
    "all_ff": _all(0xFF),
    "lost_bytes": _lost_bytes,
    "failsafe_off": _failsafe_off,
    "board_fault": _board_fault,
    "ignores": _ignores,
    "dark": _dark,
    "spikes": _spikes,
    "same_picture": _same_picture,
    "uncalibrated": _uncalibrated,
}
