"""Detects conflicts between parts that use the same device or chip address, when the rover file is read.

Each driver is made once over buses that only write down what it asks for. So the check holds for every driver, also a
third party's, and for every ``buses``. A driver says by ``chip`` which chip it speaks to; without it the driver has a
chip to itself. Two drivers of the same chip, such as a board's motors and its lights, may share an address.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import fields, is_dataclass
from posixpath import normpath
from typing import Any, NamedTuple

I2C, SPI, SERIAL = "an I2C bus", "an SPI device", "a serial port"


class BusRequest(NamedTuple):
    """A bus that a driver asked for: its kind, as a person calls it, and its device's name."""

    kind: str
    name: str


class RecordingBuses:
    """Implements ``drivers.buses.Buses`` for drivers that are made and never opened; ``asked`` is what they want."""

    def __init__(self) -> None:
        self.asked: list[BusRequest] = []

    def i2c(self, name: str) -> BusRequest:
        """Note an I2C bus."""
        return self._note(I2C, name)

    def spi(self, name: str, *, mode: int, speed_hz: int) -> BusRequest:  # noqa: ARG002 - as any Buses
        """Note a device on an SPI bus."""
        return self._note(SPI, name)

    def serial(self, name: str, *, baud: int) -> BusRequest:  # noqa: ARG002 - as any Buses
        """Note a serial port."""
        return self._note(SERIAL, name)

    def camera(self, name: str, **_: Any) -> BusRequest:
        """Note nothing: cameras are numbered, and their numbers are no device files."""
        return BusRequest("a camera", name)

    async def close(self, wait_s: float = 0.0) -> None:
        """Nothing to release."""

    def _note(self, kind: str, name: str) -> BusRequest:
        self.asked.append(BusRequest(kind, name))
        return self.asked[-1]


class _PartAddress(NamedTuple):
    """Where a part sits; ``address`` is None if the bus has none."""

    part: str
    chip: str
    key: str
    wire: BusRequest
    address: int | None


def wiring_conflict(parts: Iterable[tuple[str, Any, Any]]) -> str | None:
    """Say which two parts cannot share a wire, by the key to correct; None if all can.

    Args:
        parts: name, driver class and settings of each part.
    """
    placed: list[_PartAddress] = []
    for part, driver, settings in parts:
        for place in _places(part, driver, settings):
            if not place.wire.name:
                return f"key '{place.key}' = '': names no device; it needs {place.wire.kind}, such as /dev/..."
            for other in placed:
                if why := _conflict(place, other):
                    return why
            placed.append(place)
    return None


def required_buses(driver: Any, settings: Any) -> list[BusRequest]:
    """Return the buses that a driver asks for when it is made."""
    buses = RecordingBuses()
    with suppress(Exception):  # a third party's may fail without a real bus: what it asked for until then counts
        driver(settings, buses)
    return buses.asked


def _places(part: str, driver: Any, settings: Any) -> list[_PartAddress]:
    chip = getattr(driver, "chip", getattr(driver, "__name__", str(driver)))
    address = getattr(settings, "address", None)
    return [
        _PartAddress(part, chip, _key(part, settings, wire), wire, address if wire.kind == I2C else None)
        for wire in required_buses(driver, settings)
    ]


def _key(part: str, settings: Any, wire: BusRequest) -> str:
    """Return the key of a rover file that names a wire's device."""
    names = [field.name for field in fields(settings)] if is_dataclass(settings) else []
    return ".".join(["parts", part, *[name for name in names if getattr(settings, name) == wire.name][:1]])


def _conflict(place: _PartAddress, other: _PartAddress) -> str | None:
    """Say why two parts cannot be where they are, None if they can."""
    (kind, name), there = place.wire, f"parts.{other.part} ({other.chip})"
    if normpath(name) != normpath(other.wire.name):
        return None
    if kind != other.wire.kind:
        return f"key '{place.key}' = '{name}': {kind} here and {other.wire.kind} for '{other.key}'; correct one of them"
    if place.chip == other.chip or place.address != other.address:
        return None
    if kind != I2C:
        return f"key '{place.key}' = '{name}': {there} is on it already; two chips cannot share {kind}"
    if place.address is None:  # the driver has no address setting
        return None
    return (
        f"key 'parts.{place.part}.address' = 0x{place.address:02X}: {there} has this address on {name} already; "
        "correct the one that is wrong (i2cdetect shows which addresses answer), or set another on the chip"
    )
