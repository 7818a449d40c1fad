"""A dotted name in double backticks in the package is something that exists: of wayfarer, or of another library."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec

from tests.test_imports import MODULES
from wayfarer.config.registry import ALGORITHM_GROUP, DRIVER_GROUP
from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.api import Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.experiments.keys import FOREST, WORLD
from wayfarer.simhal.chip_wiring import CHIP_GROUP

NAME = re.compile(r"``([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)(?:\(\))?``")
FILE = re.compile(r".*\.(py|md|toml|json|jsonl|csv|yaml|html|css|js|c|service)")
GROUPS = {ALGORITHM_GROUP, DRIVER_GROUP, CHIP_GROUP}  # of entry points
REASONS = {f"{phase.value}.{what}" for phase in Phase for what in ["anomaly", *(event.value for event in PhaseEvent)]}
SWEPT = {WORLD + name for name in FOREST}
OF_OBJECTS = {"loop.time", "Generator.random"}  # of asyncio's event loop and of numpy

Definition = ast.ClassDef | ast.Module


@cache
def tree_of(module: str) -> ast.Module:
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


@cache
def modules_of_class() -> dict[str, list[str]]:
    """Return the modules that have a class of each name at their top level."""
    found: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        for name in re.findall(r"^class (\w+)", path.read_text(encoding="utf-8"), re.MULTILINE):
            found.setdefault(name, []).append(module)
    return found


def defined_in(place: Definition) -> Iterator[tuple[str, ast.AST]]:
    """Give what a module or a class defines, by name; what a module imports too, and ``self.name = ...`` in a class."""
    for node in place.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node
        elif isinstance(node, ast.ImportFrom):
            yield from ((alias.asname or alias.name, alias) for alias in node.names)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            inside = (each for target in targets for each in ast.walk(target))
            yield from ((each.id, each) for each in inside if isinstance(each, ast.Name))
    for inner in ast.walk(place) if isinstance(place, ast.ClassDef) else ():
        if isinstance(inner, ast.Attribute) and isinstance(inner.ctx, ast.Store):
            yield inner.attr, inner


def has(place: Definition, names: list[str]) -> bool:
    """Return whether a module or a class has an attribute, and that one the next; classes also inherit them."""
    if not names:
        return True
    first, *rest = names
    found = [node for name, node in defined_in(place) if name == first]
    if any(not rest or (isinstance(node, ast.ClassDef) and has(node, rest)) for node in found):
        return True
    bases = [base.id for base in place.bases if isinstance(base, ast.Name)] if isinstance(place, ast.ClassDef) else []
    return any(of_a_class([base, *names]) for base in bases)


def of_a_class(names: list[str]) -> bool:
    return any(has(tree_of(module), names) for module in modules_of_class().get(names[0], []))


def of_a_module(names: list[str]) -> bool:
    """Return whether some module has this path, or the end of this path, and then defines the rest."""
    for length in range(len(names), 0, -1):
        path = ".".join(names[:length]).removeprefix("wayfarer.")
        for module in MODULES:
            if module.endswith(f".{path}") and has(tree_of(module), names[length:]):
                return True
    return False


def is_setting(names: list[str]) -> bool:
    """Return whether this is a key of a rover file, with its table."""
    field = RoverConfig.model_fields.get(names[0])
    return field is not None and len(names) == 2 and names[1] in getattr(field.annotation, "__annotations__", {})


def is_elsewhere(name: str) -> bool:
    """Return whether a name is of an installed library, a file, or a name that is no Python."""
    library = name.partition(".")[0]
    return (
        name in GROUPS | REASONS | SWEPT | OF_OBJECTS
        or FILE.fullmatch(name) is not None
        or (library != "wayfarer" and find_spec(library) is not None)
    )


def exists(name: str) -> bool:
    names = name.split(".")
    return of_a_module(names) or of_a_class(names) or is_setting(names) or is_elsewhere(name)


def test_name_in_a_docstring_or_comment_exists() -> None:
    named = {module: set(NAME.findall(path.read_text(encoding="utf-8"))) for module, path in MODULES.items()}
    assert sum(map(len, named.values())) > 200
    assert not exists("hal.DriveMotors.brake"), "the test finds nothing"
    assert {module: gone for module in named if (gone := {name for name in named[module] if not exists(name)})} == {}
