"""Finds algorithms and drivers by name: built in, from an installed package, or ``"module:attribute"``.

A third party adds an algorithm with an entry point in the group ``wayfarer.algorithms`` and a driver with one in
``wayfarer.drivers``; no file of wayfarer is touched.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from wayfarer.errors import BadInput, UnknownName, WayfarerError, kind_and_text, one_line
from wayfarer.escape.catalogue import BUILT_IN, Algorithm

ALGORITHM_GROUP = "wayfarer.algorithms"
DRIVER_GROUP = "wayfarer.drivers"

# Built-in drivers, by the name that a rover file uses. The module is imported when the part is chosen, never before.
BUILT_IN_DRIVERS: Mapping[str, str] = {
    "bumper": "wayfarer.drivers.bumper:Bumper",
    "camera_motion": "wayfarer.drivers.camera_motion:CameraMotion",
    "cmps14": "wayfarer.drivers.cmps14:CMPS14",
    "gpio_light": "wayfarer.drivers.gpio_light:GpioLight",
    "gpio_motors": "wayfarer.drivers.gpio_motors:GpioMotors",
    "gpsd": "wayfarer.drivers.gpsd:Gpsd",
    "pmw3901": "wayfarer.drivers.pmw3901:PMW3901",
    "roboclaw": "wayfarer.drivers.roboclaw:RoboClaw",
    "roboclaw_wheels": "wayfarer.drivers.roboclaw_wheels:RoboClawWheels",
    "sabertooth": "wayfarer.drivers.sabertooth:Sabertooth",
    "thunderborg": "wayfarer.drivers.thunderborg:ThunderBorg",
    "thunderborg_light": "wayfarer.drivers.thunderborg_board:ThunderBorgLight",
}
BUILT_IN_BUSES: Mapping[str, str] = {"linux": "wayfarer.drivers.linux:LinuxBuses"}


def algorithm_names() -> list[str]:
    """Return the names of all algorithms: built-in ones in the catalogue's order, then installed ones by name."""
    return [*BUILT_IN, *sorted(set(installed_points(ALGORITHM_GROUP)) - set(BUILT_IN))]


def find_algorithm(name: str) -> Algorithm:
    """Return an algorithm by name or ``"module:attribute"``.

    Raises:
        UnknownName: nothing of that name; the text offers the nearest ones.
        BadInput: the module cannot be imported, or what it gives is no ``Algorithm``.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    found, origin = _find("algorithm", name, installed_points(ALGORITHM_GROUP), algorithm_names())
    if not isinstance(found, Algorithm):
        raise BadInput(f"algorithm '{name}': {origin} is not a wayfarer.escape.catalogue.Algorithm")
    return replace(found, origin=origin)


def refuse_code(*names: str) -> None:
    """Refuse names that stand for code to import, in what somebody else may have written: a log, or results.

    Raises:
        BadInput: one is a ``"module:attribute"``; importing it would run code of the sender's choice.
    """
    for name in names:
        if ":" in name:
            raise BadInput(f"it names code to run, {name[:80]!a}: if you trust who wrote it, add --allow-code")


def driver_names() -> list[str]:
    """Return the names of all drivers, built in and installed."""
    return sorted({*BUILT_IN_DRIVERS, *installed_points(DRIVER_GROUP)})


def find_driver(name: str) -> Any:
    """Return a driver class by name or ``"module:attribute"``; its bus adapter is imported only now.

    Raises:
        UnknownName: nothing of that name; the text offers the nearest ones.
        BadInput: the module cannot be imported.
    """
    if name in BUILT_IN_DRIVERS:
        return load_path("driver", BUILT_IN_DRIVERS[name])
    return _find("driver", name, installed_points(DRIVER_GROUP), driver_names())[0]


def check_buses(name: str) -> str:
    """Return where the buses of that name are, as ``"module:attribute"``; nothing is imported.

    Raises:
        UnknownName: nothing of that name.
    """
    path = BUILT_IN_BUSES.get(name, name)
    if ":" not in path:
        raise UnknownName("buses", name, BUILT_IN_BUSES)
    return path


def make_buses(name: str) -> Any:
    """Return the ``drivers.buses.Buses`` of that name or ``"module:attribute"``.

    Raises:
        UnknownName: nothing of that name.
        BadInput: the module cannot be imported, or what it gives is no ``Buses``.
    """
    path = check_buses(name)
    make = load_path("buses", path)
    try:
        buses = make()
    except WayfarerError:
        raise
    except (Exception, SystemExit) as error:  # a third party's may raise anything; what is no function cannot be called
        raise BadInput(f"buses '{name}': {path} gives no buses: {kind_and_text(error)}") from error
    if not all(callable(getattr(buses, kind, None)) for kind in ("i2c", "spi", "serial", "camera", "close")):
        raise BadInput(f"buses '{name}': {path} gives no wayfarer.drivers.buses.Buses")
    return buses


def installed_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group in installed packages, by name."""
    return {point.name: point for point in entry_points(group=group)}


def _find(kind: str, name: str, installed: Mapping[str, EntryPoint], known: list[str]) -> tuple[Any, str]:
    if name in installed:
        point = installed[name]
        return load_path(kind, point.value), point.dist.name if point.dist else point.value
    if ":" in name:
        return load_path(kind, name), name
    raise UnknownName(kind, name, known)


def load_path(kind: str, path: str) -> Any:
    """Import ``"module:attribute"``.

    Raises:
        BadInput: it cannot be imported; the text names the kind of thing that was wanted.
    """
    module_name, _, attribute = path.partition(":")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # a third party's module may raise anything while it is imported
        reason = one_line(error) or type(error).__name__
        raise BadInput(f"{kind} '{path}': cannot import {module_name} ({reason}); is it installed?") from error
    try:
        return getattr(module, attribute)
    except AttributeError as error:
        raise BadInput(f"{kind} '{path}': module {module_name} has no '{attribute}'") from error
