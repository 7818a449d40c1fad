"""Where the part is to which a fault of a bus happens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.simhal.chip_wiring import driver_name
from wayfarer.simhal.faults.wires import FaultyBuses, FaultyWire, Hang

I2C, SPI, SERIAL, CAMERA = "an I2C bus", "an SPI device", "a serial port", "a camera"
ANSWERING = (I2C, SPI)
CHIPS = (*ANSWERING, SERIAL)


@dataclass(frozen=True, slots=True)
class WiredPart:
    """Where a part is: its driver and settings, the kind of its bus, its chip (or camera), its wire, its bus's hang."""

    driver: str
    settings: Any
    bus: str
    chip: Any
    wire: FaultyWire
    hang: Hang


def wired_part(part: str, config: RoverConfig, buses: FaultyBuses) -> WiredPart:
    """Return where a part of a rover is; it must be on a bus.

    Raises:
        NotResponding: no chip is at its address.
    """
    kind, name, settings = _bus_of(part, config.parts[part])
    driver = driver_name(config.parts[part])
    if kind == I2C:
        i2c: Any = buses.i2c(name)
        wire = i2c.chip_at(settings.address)
        return WiredPart(driver, settings, kind, wire.chip, wire, i2c.hang)
    if kind == CAMERA:
        camera = buses.views[name]
        return WiredPart(driver, settings, kind, camera, camera.wire, camera.hang)
    line: Any = buses.spi(name) if kind == SPI else buses.serial(name)
    return WiredPart(driver, settings, kind, line.chip, line.wire, line.hang)


def is_on(part: str, places: tuple[str, ...], config: RoverConfig) -> bool:
    """Return whether a part of a rover is on one of these kinds of buses, or has one of these drivers."""
    table = config.parts[part]
    return bool({driver_name(table), _bus_of(part, table)[0]} & set(places))


def _bus_of(part: str, table: Mapping[str, Any]) -> tuple[str, str, Any]:
    """Return the kind and name of the bus that a part is on, by its settings, and these; no name if it is on none."""
    _, settings = part_settings(part, table)
    for key, kind in (("bus", I2C if hasattr(settings, "address") else SPI), ("port", SERIAL), ("camera", CAMERA)):
        if isinstance(name := getattr(settings, key, None), str):
            return kind, name, settings
    return "no bus", "", settings
