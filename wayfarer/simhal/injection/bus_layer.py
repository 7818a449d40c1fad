"""Faults on the wires and in the chips, below the real drivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from random import Random
from typing import Any

from wayfarer.config import RoverConfig, part_settings
from wayfarer.drivers.cmps14 import CMPS14Settings
from wayfarer.drivers.pmw3901 import PMW3901Settings
from wayfarer.drivers.sabertooth import SabertoothSettings
from wayfarer.drivers.thunderborg import ThunderBorgSettings
from wayfarer.errors import BadInput
from wayfarer.simhal.fakebus import FakeI2C
from wayfarer.simhal.faults import Fault
from wayfarer.simhal.injection.hang import Hang
from wayfarer.simhal.injection.wires import TamperedBuses, Wire

_THUNDERBORG_ID, _THUNDERBORG_FAILSAFE = 153, 20
_PMW3901_PRODUCT = 0x00
_DARK_SQUAL, _LONGEST_SHUTTER = 0, 0x1FFF


@dataclass(frozen=True, slots=True)
class Place:
    """Where a part is: its chip, its wire, and the hang of its bus; ``settings`` are its driver's."""

    settings: Any
    chip: Any
    wire: Wire
    hang: Hang


def place_of(part: str, config: RoverConfig, buses: TamperedBuses) -> Place:
    """Return where a part of a rover is.

    Raises:
        BadInput: the rover has no such part, or it is on no bus.
    """
    if part not in config.parts:
        raise BadInput(f"rover '{config.name}' has no [parts.{part}] to inject a fault into")
    settings = part_settings(part, config.parts[part])[1]
    if isinstance(settings, CMPS14Settings | ThunderBorgSettings):
        i2c = buses.i2c(settings.bus)
        return Place(settings, FakeI2C.chip_at(i2c, settings.address), i2c.wire(settings.address), i2c.hang)
    if isinstance(settings, PMW3901Settings):
        spi = buses.spi(settings.bus)
        return Place(settings, spi.chip, spi.wire, spi.hang)
    if isinstance(settings, SabertoothSettings):
        port = buses.serial(settings.port)
        return Place(settings, port.chip, port.wire, port.hang)
    raise BadInput(f"rover '{config.name}': [parts.{part}] has no wires that a fault could be injected into")


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
    return _listed(place.wire.unheard, lambda: chance.random() < params.chance)


@contextmanager
def _hang(place: Place, _: object, __: Random) -> Iterator[None]:
    place.hang.begin()
    yield
    place.hang.end()


def _flipped_bits(place: Place, params: Any, chance: Random) -> AbstractContextManager[None]:
    def flip(_: bytes, answer: bytes) -> bytes:
        if chance.random() >= params.chance or not answer:
            return answer
        wrong: int = int.from_bytes(answer, "big")
        for bit in chance.sample(range(len(answer) * 8), min(params.bits, len(answer) * 8)):
            wrong ^= 1 << bit
        return wrong.to_bytes(len(answer), "big")

    return _listed(place.wire.answers, flip)


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
    for name in ("power_cycle", "lose_power", "reset"):
        if hasattr(place.chip, name):
            getattr(place.chip, name)()
            break
    yield


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


@contextmanager
def _dark(place: Place, _: object, __: Random) -> Iterator[None]:
    kept = place.chip.squal, place.chip.shutter
    place.chip.squal, place.chip.shutter = _DARK_SQUAL, _LONGEST_SHUTTER
    yield
    place.chip.squal, place.chip.shutter = kept


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
    "uncalibrated": _uncalibrated,
}
