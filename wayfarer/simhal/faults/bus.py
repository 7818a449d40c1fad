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
from wayfarer.simhal.faults.wires import TamperedBuses, Wire

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
class Place:
    """Where a part is: its chip (or camera), its wire, and the hang of its bus; ``settings`` are its driver's."""

    settings: Any
    chip: Any
    wire: Wire
    hang: Hang


def misplaced(fault: Fault, config: RoverConfig) -> str | None:
    """Say why a fault of this layer cannot happen to a rover, None where it can."""
    if fault.target not in config.parts:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    table = config.parts[fault.target]
    if isinstance(part_settings(fault.target, table)[1], _FITS[fault.kind]):
        return None
    return f"rover '{config.name}': '{fault.kind}' cannot happen to driver = \"{table['driver']}\""


def place_of(fault: Fault, config: RoverConfig, buses: TamperedBuses) -> Place:
    """Return where a fault is to happen that is not ``misplaced``."""
    settings = part_settings(fault.target, config.parts[fault.target])[1]
    if isinstance(settings, CMPS14Settings | ThunderBorgSettings):
        i2c = buses.i2c(settings.bus)
        return Place(settings, FakeI2C.chip_at(i2c, settings.address), i2c.wire(settings.address), i2c.hang)
    if isinstance(settings, PMW3901Settings):
        spi = buses.spi(settings.bus)
        return Place(settings, spi.chip, spi.wire, spi.hang)
    if isinstance(settings, SabertoothSettings):
        port = buses.serial(settings.port)
        return Place(settings, port.chip, port.wire, port.hang)
    assert isinstance(settings, CameraMotionSettings)
    camera = buses.views[settings.camera]
    return Place(settings, camera, camera.wire, camera.hang)


def bus_fault(fault: Fault, place: Place, chance: Random) -> AbstractContextManager[None]:
    """Return what makes a fault of this layer happen."""
    effect: AbstractContextManager[None] = _EFFECTS[fault.kind](place, fault.params, chance)
    return effect


@contextmanager
def _listed(items: list[Any], item: Any) -> Iterator[None]:
    items.append(item)
    yield
    items.remove(item)


def _nack(place: Place, params: Any, chance: Random) -> AbstractContextManager[None]:
    left = params.most

    def is_lost() -> bool:
        nonlocal left
        lost: bool = left > 0 and chance.random() < params.chance
        left -= lost
        return lost

    return _listed(place.wire.unheard, is_lost)


@contextmanager
def _hang(place: Place, _: object, __: Random) -> Iterator[None]:
    place.hang.begin()
    yield
    place.hang.end()


def _flipped_bits(place: Place, params: Any, chance: Random) -> AbstractContextManager[None]:
    def flip(data: bytes) -> bytes:
        if chance.random() >= params.chance or not data:
            return data
        wrong: int = int.from_bytes(data, "big")
        for bit in chance.sample(range(len(data) * 8), min(params.bits, len(data) * 8)):
            wrong ^= 1 << bit
        return wrong.to_bytes(len(data), "big")

    if isinstance(place.settings, _ANSWERING):
        return _listed(place.wire.answers, lambda _, answer: flip(answer))
    return _listed(place.wire.writes, flip)


def _shifted_block(place: Place, params: Any, _: Random) -> AbstractContextManager[None]:
    def shift(_: bytes, answer: bytes) -> bytes:
        whole = int.from_bytes(answer, "big") << int(params.bits)
        return (whole & ((1 << len(answer) * 8) - 1)).to_bytes(len(answer), "big")

    return _listed(place.wire.answers, shift)


def _all(byte: int) -> Callable[..., AbstractContextManager[None]]:
    def effect(place: Place, _: object, __: Random) -> AbstractContextManager[None]:
        return _listed(place.wire.answers, lambda _, answer: bytes((byte,)) * len(answer))

    return effect


def _wrong_id(place: Place, params: Any, _: Random) -> AbstractContextManager[None]:
    """Change what the part says when it is asked who it is."""

    def lie(asked: bytes, answer: bytes) -> bytes:
        if isinstance(place.settings, CMPS14Settings) and asked == b"\x00":
            return bytes((params.says,)) + answer[1:]
        if isinstance(place.settings, ThunderBorgSettings) and asked[:1] == bytes((_THUNDERBORG_ID,)):
            return answer[:1] + bytes((params.says,)) + answer[2:]
        if isinstance(place.settings, PMW3901Settings) and asked[:1] == bytes((_PMW3901_PRODUCT,)):
            return answer[:1] + bytes((params.says,))
        return answer

    return _listed(place.wire.answers, lie)


@contextmanager
def _reset(place: Place, _: object, __: Random) -> Iterator[None]:
    """Take the power away: the part is silent for as long, and restarts after that."""
    _lose_power(place.chip)
    with ExitStack() as silence:
        if isinstance(place.settings, CMPS14Settings | ThunderBorgSettings):
            silence.enter_context(_listed(place.wire.unheard, lambda: True))
        else:
            silence.enter_context(_listed(place.wire.writes, lambda _: None))
            silence.enter_context(_listed(place.wire.answers, lambda _, answer: b"\xff" * len(answer)))
        yield
    _lose_power(place.chip)


def _lose_power(chip: Any) -> None:
    for name in ("power_cycle", "lose_power", "reset"):
        if hasattr(chip, name):
            getattr(chip, name)()
            return


def _lost_bytes(place: Place, params: Any, chance: Random) -> AbstractContextManager[None]:
    def lose(data: bytes) -> bytes:
        return bytes(byte for byte in data if chance.random() >= params.chance)

    return _listed(place.wire.writes, lose)


def _failsafe_off(place: Place, _: object, __: Random) -> AbstractContextManager[None]:
    def off(asked: bytes, answer: bytes) -> bytes:
        return answer[:1] + b"\0" + answer[2:] if asked == bytes((_THUNDERBORG_FAILSAFE,)) else answer

    return _listed(place.wire.answers, off)


@contextmanager
def _board_fault(place: Place, _: object, __: Random) -> Iterator[None]:
    place.chip.drive_faults.add(0)
    yield
    place.chip.drive_faults.discard(0)


def _ignores(place: Place, _: object, __: Random) -> AbstractContextManager[None]:
    """Let requests through and nothing that drives: the board goes on with what it had."""

    def drop(data: bytes) -> bytes | None:
        return data if len(data) == 1 else None

    return _listed(place.wire.writes, drop)


def _dark(place: Place, _: object, __: Random) -> AbstractContextManager[None]:
    if isinstance(place.settings, CameraMotionSettings):
        return _listed(place.chip.shows, lambda frame: frame._replace(luma=frame.luma * 0))
    return _dark_chip(place)


@contextmanager
def _dark_chip(place: Place) -> Iterator[None]:
    kept = place.chip.squal, place.chip.shutter
    place.chip.squal, place.chip.shutter = _DARK_SQUAL, _LONGEST_SHUTTER
    yield
    place.chip.squal, place.chip.shutter = kept


def _spikes(place: Place, params: Any, _: Random) -> AbstractContextManager[None]:
    x, y = mounted(place.settings)(params.counts, 0)
    bursts = 0

    def spike(asked: bytes, answer: bytes) -> bytes:
        nonlocal bursts
        bursts += asked[:1] == bytes((BURST,))
        if asked[:1] != bytes((BURST,)) or bursts % params.every:
            return answer
        motion, observation = answer[1] | MOTION_BIT, answer[2]
        return answer[:1] + pack("<BBhh", motion, observation, x, y) + answer[7:]

    return _listed(place.wire.answers, spike)


def _same_picture(place: Place, _: object, __: Random) -> AbstractContextManager[None]:
    def show(frame: Frame) -> Frame:
        last: Frame | None = place.chip.last
        return frame if last is None else last._replace(t_s=frame.t_s)

    return _listed(place.chip.shows, show)


@contextmanager
def _uncalibrated(place: Place, _: object, __: Random) -> Iterator[None]:
    kept = place.chip.calibration
    place.chip.calibration = 0
    yield
    place.chip.calibration = kept


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
