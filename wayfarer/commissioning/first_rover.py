"""A first rover file: what answers on this computer's buses, in a copy of the shipped file that is nearest to it.

Each known part is asked for where it may be. Only registers that identify the part are read, at the addresses that
drivers know, and none is written. Other addresses are left alone: a scan of all can change an EEPROM. So are parts that
the kernel drives, and the buses of a PC's mainboard. Nothing is sent to a serial port, because a motor board may be
there, and no camera is opened.

The copy keeps the shipped file's comments. Its tables are paragraphs, so a part that is in another shipped file comes
with its comments too. Comments say what was found, and ``FILL IN`` marks what nobody but a person knows.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from typing import Any, Literal, NamedTuple, get_args

from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.commissioning.checks.system import DEVICE_KINDS, PI5_DEBUG_PORT, diagnose, system_text
from wayfarer.config.registry import driver_names, find_driver
from wayfarer.config.rover_file import parse_rover, rover_text
from wayfarer.config.rover_path import SCHEMA_ELSEWHERE
from wayfarer.drivers.buses import Buses
from wayfarer.errors import BadInput, DriverError, NotInstalled, NotResponding, kind_and_text, one_line
from wayfarer.hal import Recognised

Model = Literal["forestrover", "minirover"]
MODELS: tuple[Model, ...] = get_args(Model)  # the shipped rovers to begin from; the first if none is nearer

# In the order in which a motor board is likely to be there: an adapter by its name, which stays; the header's pins.
PORTS = ("dev/serial/by-id/*", "dev/serial0", "dev/ttyAMA0", "dev/ttyUSB*", "dev/ttyACM*")
MAINBOARD = re.compile("smbus", re.IGNORECASE)  # of a PC: memory modules and fans are on it


class FoundPart(NamedTuple):
    """A part that answered: its driver's name, the settings that say where it is, and its own name."""

    driver: str
    settings: Mapping[str, Any]
    name: str


@dataclass(slots=True)
class Inventory:
    """What is there.

    Attributes:
        seen: all that was looked for, as a verdict ("found", "nothing", "other", "skipped") and a text.
        parts: the first part of each kind that answered, such as ``compass``.
        ports: device files of serial ports that a motor board may be on, the likeliest first.
        cameras: models of the connected cameras, by number.
    """

    seen: list[tuple[str, str]] = field(default_factory=list)
    parts: dict[str, FoundPart] = field(default_factory=dict)
    ports: list[str] = field(default_factory=list)
    cameras: list[str] = field(default_factory=list)


# -- what is there -----------------------------------------------------------------------------------------------------


async def look(host: HostEnvironment, buses: Buses, cameras: Callable[[], Sequence[str]]) -> Inventory:
    """Return what is there.

    Args:
        host: whose device files are looked at.
        buses: what they are opened with; the caller closes them.
        cameras: lists the models of connected cameras; raises NotInstalled if that is not possible.
    """
    found = Inventory()
    i2c = _usable(host, i2c_buses(host), "/dev/i2c-*: there is no I2C bus", found)
    spi = _usable(host, _device_files(host, "dev/spidev*"), "/dev/spidev*: there is no SPI device", found)
    for name in driver_names():
        with suppress(BadInput):  # a package that cannot be imported
            driver = find_driver(name)
            if isinstance(driver, type) and issubclass(driver, Recognised):
                for places in _places(driver, i2c, spi):
                    await _ask(name, driver, places, host, buses, found)
    _list_ports(host, found)
    try:
        found.cameras.extend(cameras())
        listed = [f"camera {number}: {model}" for number, model in enumerate(found.cameras)]
        found.seen += [("found", text) for text in listed] or [("nothing", "cameras: libcamera lists none")]
    except NotInstalled as error:
        found.seen.append(("skipped", str(error)))
    return found


def i2c_buses(host: HostEnvironment) -> list[str]:
    """Return the device files of the I2C buses that parts may be on, without those of a PC's mainboard."""
    return [
        device
        for device in _device_files(host, "dev/i2c-*")
        if not MAINBOARD.search(system_text(f"/sys/class/i2c-dev/{device.removeprefix('/dev/')}/name", host.root) or "")
    ]


def motor_devices(host: HostEnvironment) -> list[str]:
    """Return the device files that motors may be on."""
    return [*i2c_buses(host), *(device for pattern in PORTS for device in _device_files(host, pattern))]


def _usable(host: HostEnvironment, devices: list[str], none: str, found: Inventory) -> list[str]:
    """Return which of the device files this user may use, and note why others may not be, or that there are none."""
    troubles = {device: diagnose(host, device) for device in devices}
    found.seen += [("skipped", f"{each.text}: {each.remedy}") for each in troubles.values() if each]
    if not devices:
        enable = next(each.enable for each in DEVICE_KINDS if none.startswith(each.prefixes))
        found.seen.append(("nothing", f"{none}; to enable it: {enable}"))
    return [device for device, trouble in troubles.items() if trouble is None]


def _places(driver: Any, i2c: Sequence[str], spi: Sequence[str]) -> list[list[dict[str, Any]]]:
    """Return the settings that say where a driver may find its part, those on one device together."""
    if addresses := getattr(driver, "addresses", ()):
        return [[{"bus": bus, "address": address} for address in addresses] for bus in i2c]
    if any(each.name == "bus" for each in fields(driver.Settings)):
        return [[{"bus": device}] for device in spi]
    return [[{}]]  # a service of this computer, such as gpsd


async def _ask(
    name: str, driver: Any, places: Sequence[dict[str, Any]], host: HostEnvironment, buses: Buses, found: Inventory
) -> None:
    """Ask at each of some places whether a driver's part is there; places where nothing is are noted together."""
    silent = []
    for place in places:
        try:
            there = driver(driver.Settings(**place), buses)
            if _is_the_kernels(host, place):
                found.seen.append(("skipped", f"{there.name}: the kernel drives what is there"))
                continue
            await there.identify()
        except NotResponding as error:
            if not error.remedy:
                silent.append(there.name)
            elif ("skipped", str(error)) not in found.seen:  # the computer cannot ask: one reason for all places
                found.seen.append(("skipped", str(error)))
        except DriverError as error:
            found.seen.append(("other", str(error)))
        except Exception as error:  # a third party's driver
            found.seen.append(("other", f"an error in driver {name}: {kind_and_text(error)}"))
        else:
            found.parts.setdefault(driver.part, FoundPart(name, place, there.name))
            found.seen.append(("found", there.name))
    if silent:
        more = f"{len(silent) - 1} more addresses up to " if silent[2:] else ""
        more = f", nor at {more}0x{places[-1]['address']:02X}" if silent[1:] else ""
        found.seen.append(("nothing", silent[0] + more))


def _is_the_kernels(host: HostEnvironment, place: Mapping[str, Any]) -> bool:
    """Return whether a driver of the kernel has the part at an I2C address."""
    if "address" not in place:
        return False
    number = place["bus"].rpartition("-")[2]
    return host.path(f"/sys/bus/i2c/devices/{number}-{place['address']:04x}/driver").exists()


def _list_ports(host: HostEnvironment, found: Inventory) -> None:
    """List the serial ports; of several names of one port the first counts."""
    ports: dict[str, str] = {}
    for device in (device for pattern in PORTS for device in _device_files(host, pattern)):
        ports.setdefault(host.path(device).resolve().name, device)
    if debug := ports.pop(PI5_DEBUG_PORT, None):
        found.seen.append(("skipped", f"{debug}: {PI5_DEBUG_PORT}, the debug connector of a Pi 5"))
    found.ports.extend(ports.values())
    for device in (device for device in found.ports if "roboclaw" in device.lower()):  # its USB descriptor has its name
        found.parts.setdefault("motors", FoundPart("roboclaw", {"port": device}, f"RoboClaw at {device}, by that name"))
    found.seen += [("found", f"serial port {port}; nothing is sent to it") for port in found.ports] or [
        ("nothing", f"serial ports: {', '.join(f'/{pattern}' for pattern in PORTS)}")
    ]


def _device_files(host: HostEnvironment, pattern: str) -> list[str]:
    """Return the device files of a pattern, by their numbers."""
    found = (f"/{path.relative_to(host.root)}" for path in host.root.glob(pattern))
    return sorted(found, key=lambda device: (len(device), device))


# -- the file ----------------------------------------------------------------------------------------------------------

HEAD = """# Written by `wayfarer init`, from {model}.toml. Fill in what FILL IN marks;
# `wayfarer check` shows what is still wrong.
# The documentation's page "Rover file" lists all keys with their defaults and what they mean.
name = {name}"""
FILL_IN = {
    "vehicle": "{model}'s; measure your own",
    "chassis": "{model}'s; measure your own, or delete this table",
    "escape": "for {model}'s top speed",
}
# A part that did not answer, or cannot be asked, by its driver.
UNSEEN = {
    "sabertooth": "which serial port, and which board, such as a roboclaw; nothing is sent to a port to find out. "
    "Ports here: {ports}",
    "pmw3901": "it did not answer; correct where it is, or put in the driver that you have. A rover without motion "
    'sensor needs anomaly_source = "contact" at the top and a [parts.contact], or "wheels" and a [parts.wheels]',
    "camera_motion": "which camera, if not the first. Cameras here: {cameras}",
}
SILENT = "it did not answer; correct where it is, or put in the driver that you have"


def nearest(found: Inventory) -> Model:
    """Return the shipped rover most of whose parts answered; a listed camera counts as one."""
    there = {(part, each.driver) for part, each in found.parts.items()}
    if found.cameras:
        there.add(("motion", "camera_motion"))
    return max(MODELS, key=lambda model: len(there & set(_drivers(model).items())))


def first_rover_file(name: str, model: Model, found: Inventory) -> str:
    """Return the text of a rover file.

    Args:
        name: what the rover is called in logs and reports.
        model: the shipped rover whose file is copied.
        found: what is put in: the parts that answered, with where they are.

    Raises:
        BadConfig: it would not be a valid rover file, as with a name that is too long; the text says why.
    """
    tables = _tables(model)
    tables[""] = HEAD.format(model=model, name=json.dumps(name, ensure_ascii=False))
    for key, text in FILL_IN.items():
        tables[key] = _remarked(tables[key], f"FILL IN: {text.format(model=model)}")
    drivers = _drivers(model)
    known = {"ports": ", ".join(found.ports) or "none", "cameras": ", ".join(found.cameras) or "none"}
    for part in [*drivers, *(part for part in found.parts if part not in drivers)]:
        there = found.parts.get(part)
        if there is not None:
            table, place, remark = _table_of(model, part, there.driver), there.settings, f"Found: {there.name}"
        else:
            table, remark = tables[f"parts.{part}"], f"FILL IN: {UNSEEN.get(drivers[part], SILENT).format(**known)}"
            place = {"port": found.ports[0]} if drivers[part] == "sabertooth" and found.ports else {}
        tables[f"parts.{part}"] = _remarked(_placed(table, place), remark)
    text = SCHEMA_ELSEWHERE + "\n\n".join(tables.values()) + "\n"
    parse_rover("rover.toml", text)
    return text


def _drivers(model: Model) -> dict[str, str]:
    """Return the drivers of a shipped rover's parts."""
    return {part: table["driver"] for part, table in tomllib.loads(rover_text(model))["parts"].items()}


def _tables(model: Model) -> dict[str, str]:
    """Return the paragraphs of a shipped file by the table that each is, also if it is commented out.

    Others are under their own text, and the head, which ends with the rover's name, under an empty one.
    """
    head, *others = rover_text(model).rstrip("\n").split("\n\n")
    header = re.compile(r"(?:# )?\[([\w.]+)\]")
    return {"": head, **{match[1] if (match := header.match(text)) else text: text for text in others}}


def _table_of(model: Model, part: str, driver: str) -> str:
    """Return the table of a part with that driver: of a shipped file, this model's first, or else a short one."""
    for each in (model, *MODELS):
        if _drivers(each).get(part) == driver:
            return _tables(each)[f"parts.{part}"]
    return f'[parts.{part}]\ndriver = "{driver}"'


def _remarked(table: str, remark: str) -> str:
    """Return a table with a comment below its first line."""
    first, line_end, rest = table.partition("\n")
    return f"{first}\n# {one_line(remark)}{line_end}{rest}"


def _placed(table: str, settings: Mapping[str, Any]) -> str:
    """Return a part's table with some settings; what a comment says of a line stays."""
    for key, value in settings.items():
        text = f"0x{value:02X}" if key == "address" else json.dumps(value)
        line = re.compile(rf'^{key} = (?:"[^"]*"|[^ #\n]+)', re.MULTILINE).search(table)
        if line:
            table = f"{table[: line.start()]}{key} = {text}{table[line.end() :]}"
        else:
            table += f"\n{key} = {text}"
    return table
