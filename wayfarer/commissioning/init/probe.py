"""What is on this computer's buses: asks for each known part where it may be, and lists ports, cameras and pins.

Only registers that tell which part it is are read, at the addresses that drivers know, and none is written. Other
addresses are left alone: a scan of all can change an EEPROM. So are parts that the kernel drives, and the buses of a
PC's mainboard. Nothing is sent to a serial port, because a motor board may be there, and no camera is opened.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Any, NamedTuple

from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.commissioning.checks.system import DEVICE_KINDS, PI5_DEBUG_PORT, diagnose, system_text
from wayfarer.config.registry import driver_names, find_driver
from wayfarer.config.wiring import I2C, SPI, required_buses
from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadInput, DriverError, NotResponding, kind_and_text, one_line
from wayfarer.hal import Recognised

PATTERNS = {I2C: "dev/i2c-*", SPI: "dev/spidev*"}
# In the order in which a motor board is likely to be there: an adapter by its name, which stays; the header's pins.
PORTS = ("dev/serial/by-id/*", "dev/serial0", "dev/ttyAMA0", "dev/ttyUSB*", "dev/ttyACM*")
MAINBOARD = re.compile("smbus", re.IGNORECASE)  # of a PC: memory modules and fans are on it


class Verdict(StrEnum):
    """What came of looking for something."""

    FOUND = "found"
    NOTHING = "nothing"
    OTHER = "other"
    LEFT_ALONE = "skipped"


class Sighting(NamedTuple):
    """What was looked for and where, in words, and what came of it."""

    verdict: Verdict
    text: str


class FoundPart(NamedTuple):
    """A part that answered: its capability, its driver's name, the settings that say where it is, and its own name."""

    part: str
    driver: str
    settings: Mapping[str, Any]
    name: str


@dataclass(frozen=True, slots=True)
class Inventory:
    """What is there.

    Attributes:
        sightings: all that was looked for, in this order.
        parts: the parts that answered.
        ports: device files of serial ports that a motor board may be on, the likeliest first.
        cameras: models of the connected cameras, by number.
    """

    sightings: list[Sighting] = field(default_factory=list)
    parts: list[FoundPart] = field(default_factory=list)
    ports: list[str] = field(default_factory=list)
    cameras: list[str] = field(default_factory=list)

    def note(self, verdict: Verdict, text: str) -> None:
        """Note a sighting."""
        self.sightings.append(Sighting(verdict, text))

    @property
    def is_empty(self) -> bool:
        """Whether nothing was found that a rover can be made of."""
        return not (self.parts or self.ports or self.cameras)


async def look(host: HostEnvironment, buses: Buses, cameras: Callable[[], Sequence[str]]) -> Inventory:
    """Return what is there.

    Args:
        host: whose device files are looked at.
        buses: what they are opened with; the caller closes them.
        cameras: lists the models of connected cameras; raises OSError where that is not possible.
    """
    found = Inventory()
    devices = {kind: _usable(host, kind, found) for kind in PATTERNS}
    for name, driver in _recognised():
        for places in _places(driver, devices):
            await _ask(name, driver, places, host, buses, found)
    _list_ports(host, found)
    _list_cameras(cameras, found)
    pins = _device_files(host, "dev/gpiochip*")
    found.note(*(Verdict.FOUND, f"pins: {', '.join(pins)}") if pins else (Verdict.NOTHING, "pins: no /dev/gpiochip*"))
    return found


def motor_devices(host: HostEnvironment) -> list[str]:
    """Return the device files that motors may be on."""
    return [*i2c_buses(host), *(device for pattern in PORTS for device in _device_files(host, pattern))]


def i2c_buses(host: HostEnvironment) -> list[str]:
    """Return the device files of the I2C buses that parts may be on, without those of a PC's mainboard."""
    return [
        device
        for device in _device_files(host, PATTERNS[I2C])
        if not MAINBOARD.search(system_text(f"/sys/class/i2c-dev/{device.removeprefix('/dev/')}/name", host.root) or "")
    ]


# -- parts that answer -------------------------------------------------------------------------------------------------


def _recognised() -> Iterator[tuple[str, Any]]:
    """Give name and class of each driver that can say whether its part is there, also of installed packages."""
    for name in driver_names():
        with suppress(BadInput):  # a package that cannot be imported
            driver = find_driver(name)
            if isinstance(driver, type) and issubclass(driver, Recognised):
                yield name, driver


def _usable(host: HostEnvironment, kind: str, found: Inventory) -> list[str]:
    """Return the device files of a kind that this user may use, and note why others may not be."""
    devices = i2c_buses(host) if kind == I2C else _device_files(host, PATTERNS[kind])
    if not devices:
        pattern = f"/{PATTERNS[kind]}"
        enable = next((each.enable for each in DEVICE_KINDS if pattern.startswith(each.prefixes)), "")
        found.note(Verdict.NOTHING, f"{pattern}: there is no {kind.partition(' ')[2]}; to enable it: {enable}")
    usable = []
    for device in devices:
        if trouble := diagnose(host, device):
            found.note(Verdict.LEFT_ALONE, f"{trouble.found}: {trouble.cause}; {trouble.remedy}")
        else:
            usable.append(device)
    return usable


def _places(driver: Any, devices: Mapping[str, Sequence[str]]) -> Iterator[list[dict[str, Any]]]:
    """Give the settings that say where a driver may find its part, those on one device together."""
    try:
        default = driver.Settings()
    except (TypeError, ValueError):  # a person must say something of it first
        return
    wires = required_buses(driver, default)
    if not wires:  # a service of this computer, such as gpsd
        yield [{}]
    names = [each.name for wire in wires[:1] for each in fields(default) if getattr(default, each.name) == wire.name]
    for name in names[:1]:
        for device in devices.get(wires[0].kind, ()):
            addresses = getattr(driver, "addresses", ()) if wires[0].kind == I2C else ()
            yield [{name: device, "address": address} for address in addresses] or [{name: device}]


async def _ask(
    name: str, driver: Any, places: Sequence[dict[str, Any]], host: HostEnvironment, buses: Buses, found: Inventory
) -> None:
    """Ask at each of some places whether a driver's part is there; places where nothing is are noted together."""
    silent = []
    for place in places:
        try:
            there = driver(replace(driver.Settings(), **place), buses)
            if _is_the_kernels(host, place):
                found.note(Verdict.LEFT_ALONE, f"{there.name}: the kernel drives what is there")
                continue
            await there.identify()
        except NotResponding:
            silent.append(there.name)
        except DriverError as error:
            found.note(Verdict.OTHER, str(error))
        except Exception as error:  # a third party's driver
            found.note(Verdict.OTHER, f"an error in driver {name}: {kind_and_text(error)}")
        else:
            found.parts.append(FoundPart(driver.part, name, place, there.name))
            found.note(Verdict.FOUND, there.name)
    if silent:
        more = f", nor at {len(silent) - 1} more addresses up to 0x{places[-1]['address']:02X}" if silent[1:] else ""
        found.note(Verdict.NOTHING, silent[0] + more)


def _is_the_kernels(host: HostEnvironment, place: Mapping[str, Any]) -> bool:
    """Return whether a driver of the kernel has the part at an I2C address."""
    if "address" not in place:
        return False
    number = place["bus"].rpartition("-")[2]
    return host.path(f"/sys/bus/i2c/devices/{number}-{place['address']:04x}/driver").exists()


# -- what is only listed -----------------------------------------------------------------------------------------------


def _list_ports(host: HostEnvironment, found: Inventory) -> None:
    """List the serial ports; of several names of one port the first counts."""
    seen = set()
    for device in (device for pattern in PORTS for device in _device_files(host, pattern)):
        port = host.path(device).resolve()
        if port in seen:
            continue
        seen.add(port)
        if port.name == PI5_DEBUG_PORT:
            found.note(Verdict.LEFT_ALONE, f"{device}: {PI5_DEBUG_PORT}, the debug connector of a Pi 5")
        else:
            found.ports.append(device)
            found.note(Verdict.FOUND, f"serial port {device}; nothing is sent to it")
    if not found.ports:
        found.note(Verdict.NOTHING, f"serial ports: {', '.join(f'/{pattern}' for pattern in PORTS)}")


def _list_cameras(cameras: Callable[[], Sequence[str]], found: Inventory) -> None:
    try:
        found.cameras.extend(cameras())
    except OSError as error:
        found.note(Verdict.LEFT_ALONE, f"cameras: {one_line(error)}")
        return
    for number, model in enumerate(found.cameras):
        found.note(Verdict.FOUND, f"camera {number}: {model}")
    if not found.cameras:
        found.note(Verdict.NOTHING, "cameras: libcamera lists none")


def _device_files(host: HostEnvironment, pattern: str) -> list[str]:
    """Return the device files of a pattern, by their numbers."""
    found = (f"/{path.relative_to(host.root)}" for path in host.root.glob(pattern))
    return sorted(found, key=lambda device: (len(device), device))
