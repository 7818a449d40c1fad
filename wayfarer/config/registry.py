"""Finds algorithms and drivers by name.

A name is looked for in this order:

1. built in;
2. installed: an entry point in the group ``wayfarer.algorithms`` or ``wayfarer.drivers``;
3. a file, ``FILE.py`` or ``FILE.py:NAME``, in the rover file's folder, else in the current one (``own_file``);
4. ``"module:attribute"``.

So one's own needs no change in a file of wayfarer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, is_dataclass, replace
from importlib.metadata import EntryPoint, entry_points
from inspect import getattr_static, signature
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, get_args, get_type_hints

from wayfarer.config.own_file import attribute, beside, load, names_file, split, whole_name
from wayfarer.errors import BadInput, UnknownName, WayfarerError, kind_and_text, near_names
from wayfarer.escape.api import EscapeHandler
from wayfarer.escape.catalogue import BUILT_IN, Algorithm
from wayfarer.hal import Rover

ALGORITHM_GROUP = "wayfarer.algorithms"
DRIVER_GROUP = "wayfarer.drivers"
OPTIONAL_PARTS = {field.name for field in fields(Rover)} - {"compass", "motors"}

# Built-in drivers, by the name that a rover file uses. The module is imported when the part is chosen, never before.
BUILT_IN_DRIVERS: Mapping[str, str] = {
    "bno055": "wayfarer.drivers.bno055:BNO055",
    "bumper": "wayfarer.drivers.bumper:Bumper",
    "camera_motion": "wayfarer.drivers.camera_motion:CameraMotion",
    "cmps14": "wayfarer.drivers.cmps14:CMPS14",
    "encoders": "wayfarer.drivers.encoders:Encoders",
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


def find_algorithm(name: str, folder: Path | None = None) -> Algorithm:
    """Return an algorithm, under the name by which it was asked for; files are looked for in ``folder`` first.

    Raises:
        UnknownName: nothing of that name; the text offers the nearest ones.
        BadInput: it is not there, failed while it was loaded, or is not an algorithm.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    found, origin = _find("algorithm", name, installed_points(ALGORITHM_GROUP), algorithm_names(), folder)
    return replace(algorithm_of(found), name=name, origin=origin)


def algorithm_of(given: Any) -> Algorithm:
    """Return an algorithm that somebody has written as one, or as the class of its handlers.

    Of a class its attribute ``requires`` counts, and the first line of its docstring is its summary.
    """
    if isinstance(given, Algorithm):
        return given
    summary = (given.__doc__ or "").strip().partition("\n")[0]
    return Algorithm(given.__name__, "own", summary, given, frozenset(getattr(given, "requires", ())))


def names_code(name: str) -> bool:
    """Return whether a name stands for code to import, and not for something that is built in or installed."""
    return ":" in name or names_file(name)


def refuse_code(*names: str) -> None:
    """Refuse names that mean code to import, in what somebody else may have written: a log, or results.

    Raises:
        BadInput: one is a file or a ``"module:attribute"``; importing it would run code of the sender's choice.
    """
    for name in names:
        if names_code(name):
            raise BadInput(f"it names code to run, {name[:80]!a}: if you trust who wrote it, add --allow-code")


def driver_names() -> list[str]:
    """Return the names of all drivers, built in and installed."""
    return sorted({*BUILT_IN_DRIVERS, *installed_points(DRIVER_GROUP)})


def find_driver(name: str) -> Any:
    """Return a driver class; its bus adapter is imported only now.

    Raises:
        UnknownName: nothing of that name; the text offers the nearest ones.
        BadInput: it is not there, failed while it was loaded, or is not a driver.
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
        BadInput: the module cannot be imported, or what it gives is not a ``Buses``.
    """
    path = check_buses(name)
    make = load_path("buses", path)
    try:
        buses = make()
    except WayfarerError:
        raise
    except (Exception, SystemExit) as error:  # a third party's may raise anything, and not be a function at all
        raise BadInput(f"buses '{name}': {path} gives no buses: {kind_and_text(error)}") from error
    if not all(callable(getattr(buses, kind, None)) for kind in ("i2c", "spi", "serial", "camera", "close")):
        raise BadInput(f"buses '{name}': {path} does not give a wayfarer.drivers.buses.Buses")
    return buses


def installed_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group in installed packages, by name."""
    return {point.name: point for point in entry_points(group=group)}


def _find(
    kind: str, name: str, installed: Mapping[str, EntryPoint], known: list[str], folder: Path | None = None
) -> tuple[Any, str]:
    """Return what a name means, if it fits, and where it comes from."""
    if name in installed:
        point = installed[name]
        path, origin = point.value, point.dist.name if point.dist else point.value
    elif names_code(name):
        path = origin = whole_name(kind, name, folder)
    else:
        raise UnknownName(kind, name, known, beside(name, folder))
    module, misfit = load(kind, path), MISFITS[kind]
    if not split(path)[1]:
        path = _only_one(kind, path, module, misfit)
    found = attribute(kind, path, module)
    if why := misfit(found):
        raise BadInput(f"{kind} '{name}': {path} {why}; {MORE[kind]}")
    return found, origin


def _only_one(kind: str, path: str, module: ModuleType, misfit: Callable[[Any], str]) -> str:
    """Return the name of the one thing in a file that fits; an algorithm counts before the classes it is made of.

    Raises:
        BadInput: several fit, or none.
    """
    own = {
        name: each for name, each in vars(module).items()
        if isinstance(each, Algorithm) or (isinstance(each, type) and each.__module__ == module.__name__)
    }  # fmt: skip
    fit = [name for name, each in own.items() if not misfit(each)]
    rows = [name for name in fit if isinstance(own[name], Algorithm)]
    file = Path(path).name
    if len(found := rows or fit) == 1:
        return f"{path}:{found[0]}"
    if found:
        raise BadInput(f"{kind} '{path}': several in it fit; write {' or '.join(f'{file}:{each}' for each in found)}")
    settings = [getattr(each, "Settings", None) for each in own.values()]
    missing = [f"{name} {misfit(each)}" for name, each in own.items() if each not in settings]
    seen = "; ".join(sorted(missing, key=lambda text: text.count(","))) or "no class is in it"  # what lacks least first
    raise BadInput(f"{kind} '{path}': nothing in it fits: {seen}; {MORE[kind]}")


def _algorithm_misfit(found: Any) -> str:
    """Return why something is not an algorithm; empty if it can be one."""
    if isinstance(found, Algorithm):
        return _requires_misfit(found.requires)
    if not isinstance(found, type):
        return f"is a {type(found).__name__}, neither a class nor a wayfarer.escape.catalogue.Algorithm"
    if lacks := _lacks(found, EscapeHandler):
        return f"lacks {lacks}"
    decide = getattr_static(found, "decide")
    if isinstance(decide, FunctionType) and _call_misfit(decide, "self", "observation"):
        return "has a decide() that cannot be called with (observation)"
    return _requires_misfit(getattr(found, "requires", ())) or _call_misfit(found, "settings", "vehicle", "rng")


def _requires_misfit(requires: object) -> str:
    if isinstance(requires, str) or not isinstance(requires, Collection):
        return f"has requires = {requires!r}, which is not a tuple of names, such as ('contact',)"
    if unknown := [name for name in requires if name not in OPTIONAL_PARTS]:
        return f"has {unknown[0]!r} in requires, and a rover can have {', '.join(sorted(OPTIONAL_PARTS))}"
    return ""


def _driver_misfit(found: Any) -> str:
    """Return why something is not a driver; empty if it can be one."""
    kinds = get_type_hints(Rover)
    if not isinstance(found, type):
        return f"is a {type(found).__name__}, not a class"
    if (part := getattr(found, "part", None)) not in list(kinds):
        if part is None:
            return f"lacks the class attribute part, one of {', '.join(kinds)}"
        near = near_names(str(part), kinds)
        return f"has part = {part!r}; " + (f"did you mean '{near[0]}'?" if near else f"it is one of {', '.join(kinds)}")
    protocol = next(each for each in (*get_args(kinds[part]), kinds[part]) if each is not type(None))
    settings = "" if is_dataclass(getattr(found, "Settings", None)) else "the dataclass Settings"
    if lacks := ", ".join(filter(None, (settings, _lacks(found, protocol)))):
        return f"lacks {lacks}, as its part is '{part}'"
    return _call_misfit(found, "settings", "buses")


# What somebody's own may be; each says why something is not.
MISFITS: Mapping[str, Callable[[Any], str]] = {"algorithm": _algorithm_misfit, "driver": _driver_misfit}
MORE = {
    "algorithm": "write that, then check_algorithm of wayfarer.testing says more",
    "driver": "write that, then the checks of wayfarer.testing say more",
}


def _lacks(found: type, protocol: type) -> str:
    needed = {name for base in protocol.__mro__ for name in vars(base) if not name.startswith("_")}
    return ", ".join(f"{name}()" for name in sorted(needed) if not callable(getattr(found, name, None)))


def _call_misfit(found: Callable[..., Any], *names: str) -> str:
    try:
        signature(found).bind(*names)
    except TypeError:
        return f"cannot be made with ({', '.join(names)})"
    except ValueError:  # written in C
        pass
    return ""


def load_path(kind: str, path: str) -> Any:
    """Import ``FILE.py:NAME`` or ``"module:attribute"``.

    Raises:
        BadInput: it cannot be imported; the text names the kind of thing that was wanted.
    """
    return attribute(kind, path, load(kind, path))
