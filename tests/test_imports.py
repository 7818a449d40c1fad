"""The dependency directions of the design, checked by walking imports."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import wayfarer

ROOT = Path(wayfarer.__file__).parent
MODULES = {
    ".".join(["wayfarer", *path.relative_to(ROOT).with_suffix("").parts]).removesuffix(".__init__"): path
    for path in sorted(ROOT.rglob("*.py"))
}

# Lowest first: a module may import from its own layer and from those before it.
LAYERS = [
    ["angles", "bounds", "errors", "hal"],
    ["escape", "conditions", "latest"],
    ["detector", "safety", "records"],
    ["arming", "config", "registry", "pace"],
    ["helm", "fieldlog"],
    ["supervisor"],
]
PURE = ["angles", "bounds", "conditions", "hal", "escape", "detector", "latest", "safety", "arming"]
IMPURE = {"asyncio", "time", "datetime", "io", "os", "pathlib", "logging", "structlog", "socket", "threading", "numpy"}
HEAVY = {"numpy", "scipy", "skfmm", "matplotlib"}


def imports(path: Path) -> Iterator[str]:
    """Every module that a file imports, at the top or later, as a dotted name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def within(module: str, *parts: str) -> bool:
    """Whether a module is, or lies in, one of these parts of the package."""
    return any(module == f"wayfarer.{part}" or module.startswith(f"wayfarer.{part}.") for part in parts)


def modules_of(*parts: str) -> list[str]:
    found = [module for module in MODULES if within(module, *parts)]
    assert found, f"no module of {parts}: is this test out of date?"
    return found


def outside_simhal() -> list[str]:
    return [module for module in MODULES if not within(module, "simhal")]


def wayfarer_modules(module: str) -> set[str]:
    """The modules of wayfarer that one imports (names within a module count as the module)."""
    named = {name for name in imports(MODULES[module]) if name.startswith("wayfarer.")}
    return {name if name in MODULES else name.rpartition(".")[0] for name in named} - {"wayfarer"}


@pytest.mark.parametrize("level", range(len(LAYERS)))
def test_layers_import_only_downwards(level: int) -> None:
    allowed = [part for layer in LAYERS[: level + 1] for part in layer]
    for part in LAYERS[level]:
        for module in [each for each in MODULES if within(each, part)]:
            upwards = {name for name in wayfarer_modules(module) if not within(name, *allowed)}
            assert not upwards, f"{module} imports {upwards}"


def test_every_core_module_has_its_layer() -> None:
    core = {module.split(".")[1] for module in MODULES if module.count(".")}
    above = {"cli", "testing", "simhal", "drivers", "control", "watchdog", "replay", "__main__"}
    assert core - above <= {part for layer in LAYERS for part in layer}


def test_nothing_but_the_command_imports_the_simulator() -> None:
    users = {module for module in outside_simhal() if any(within(name, "simhal") for name in wayfarer_modules(module))}
    assert users == {"wayfarer.cli"}


@pytest.mark.parametrize("module", modules_of(*PURE))
def test_pure_modules_know_no_clock_no_loop_and_no_files(module: str) -> None:
    assert {name.partition(".")[0] for name in imports(MODULES[module])} & IMPURE == set()


@pytest.mark.parametrize("module", modules_of("escape", "detector", "safety", "arming"))
def test_pure_modules_draw_from_no_global_randomness(module: str) -> None:
    names = set(imports(MODULES[module]))
    assert {name for name in names if name.partition(".")[0] == "random"} <= {"random", "random.Random"}
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    attributes = {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    taken = {name for name in attributes if name.startswith("random.")}
    assert taken <= {"random.Random"}, "random.<function> is the global generator"


def test_drivers_see_only_the_contracts() -> None:
    seen = ("hal", "errors", "config", "registry", "drivers")
    for module in [each for each in MODULES if within(each, "drivers")]:
        others = {name for name in wayfarer_modules(module) if not within(name, *seen)}
        assert not others, f"{module} imports {others}"


@pytest.mark.parametrize("module", outside_simhal())
def test_arrays_stay_in_the_simulator(module: str) -> None:
    assert {name.partition(".")[0] for name in imports(MODULES[module])} & HEAVY == set()


@pytest.mark.parametrize(
    ("module", "kept_out"),
    [
        ("wayfarer.cli", {"numpy", "scipy", "pydantic", "asyncio"}),
        ("wayfarer.supervisor", HEAVY),
        ("wayfarer.testing", HEAVY),
    ],
)
def test_importing_stays_light(module: str, kept_out: set[str]) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert kept_out & set(loaded) == set()
