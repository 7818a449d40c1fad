"""The dependency directions of the design, checked by walking imports."""

from __future__ import annotations

import ast
import os
import socket
import subprocess
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import wayfarer
from tests import children

ROOT = Path(wayfarer.__file__).parent
MODULES = {
    ".".join(["wayfarer", *path.relative_to(ROOT).with_suffix("").parts]).removesuffix(".__init__"): path
    for path in sorted(ROOT.rglob("*.py"))
}

# The package from the top: each line may import from the lines below it, and what stands on one line may not know
# each other.
PICTURE = """
    __main__
    cli
    api         testing     demo    gym     run_sim
    reports
    experiments
    remote      export  simhal
    daemon
    commissioning
    logview
    fieldlog
    control
    config
    drivers
    detector
    vocabulary
    escape
    safety
    hal         files   extras
    readings    setting_ranges  waiting_thread
    angles      errors  version
"""
LAYERS = [line.split() for line in PICTURE.split("\n") if line.strip()]
PURE = [
    "angles", "setting_ranges", "readings", "hal", "escape", "detector", "safety", "control.modes",
    "control.status_light", "api.failsafe",
]  # fmt: skip
IMPURE = {"asyncio", "time", "datetime", "io", "os", "pathlib", "logging", "structlog", "socket", "threading", "numpy"}
BUS_LIBRARIES = {"cv2", "smbus2", "spidev", "serial", "gpiozero", "picamera2"}
# Figures are made of arrays.
ARRAYS_IN = ("reports", "logview.receiver_fit")
SIMULATING = ("simhal", "experiments", "reports", "api", "testing", "demo", "gym", "run_sim")
RUN_REPORT = ("reports.run", "reports.data", "reports.map", "reports.panels", "reports.page")
HEAVY = {"numpy", "scipy", "skfmm", "bokeh"} | BUS_LIBRARIES


def named_by(node: ast.AST) -> Iterator[str]:
    """The modules that an import statement names, dotted; nothing for another statement."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        assert node.level == 0, "relative import"
        assert node.module is not None
        yield node.module
        yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def named_in(text: str) -> frozenset[str]:
    """Every module that a source text imports, at the top or later; most tests here ask this of all modules."""
    return frozenset(name for node in ast.walk(ast.parse(text)) for name in named_by(node))


def imports(module: str) -> frozenset[str]:
    """Every module that one imports, as a dotted name."""
    return named_in(MODULES[module].read_text(encoding="utf-8"))


def imports_when_run(node: ast.AST, *, in_functions: bool) -> Iterator[str]:
    """The modules that code really imports: not under ``if TYPE_CHECKING``, and in functions only if asked for."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        if not in_functions and isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        yield from named_by(child)
        yield from imports_when_run(child, in_functions=in_functions)


def roots(modules: Iterable[str]) -> set[str]:
    """The top packages of these modules."""
    return {module.partition(".")[0] for module in modules}


def within(module: str, *parts: str) -> bool:
    """Whether a module is, or lies in, one of these parts of the package."""
    return any(module == f"wayfarer.{part}" or module.startswith(f"wayfarer.{part}.") for part in parts)


def modules_of(*parts: str) -> list[str]:
    found = [module for module in MODULES if within(module, *parts)]
    assert found, f"no module of {parts}: is this test out of date?"
    return found


def outside_simhal() -> list[str]:
    """Field code and what shows its logs; of the pages that is the report of a run."""
    return [module for module in MODULES if not within(module, *SIMULATING) or within(module, *RUN_REPORT)]


def wayfarer_modules(module: str) -> set[str]:
    """The modules of wayfarer that one imports (names within a module count as the module)."""
    named = {name for name in imports(module) if name.startswith("wayfarer.")}
    return {name if name in MODULES else name.rpartition(".")[0] for name in named} - {"wayfarer"}


def part_of(module: str) -> str:
    """Return the entry of the picture that a module belongs to; empty for ``wayfarer`` itself."""
    return f"{module}.".split(".")[1]


def upwards(module: str) -> set[str]:
    """What a module imports from its own line of the picture, its own part excepted, or from a line above."""
    level = {part: depth for depth, line in enumerate(LAYERS) for part in line}
    own = part_of(module)
    return {name for name in wayfarer_modules(module) if part_of(name) != own and level[part_of(name)] <= level[own]}


def test_arrows_between_parts_point_downwards() -> None:
    assert {module: found for module in MODULES if part_of(module) and (found := upwards(module))} == {}


def test_picture_shows_the_whole_package() -> None:
    shown = [part for line in LAYERS for part in line]
    assert sorted(shown) == sorted({part_of(module) for module in MODULES} - {""})


def test_no_module_imports_itself_in_a_circle() -> None:
    graph = {
        module: {name for name in wayfarer_modules(module) if not f"{module}.".startswith(f"{name}.")}
        for module in MODULES
    }
    lowest_first = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert set(lowest_first) >= set(MODULES)


def test_no_field_code_and_no_viewer_of_a_log_imports_the_simulator() -> None:
    trials = {name for name in modules_of("simhal", "experiments", "reports") if not within(name, *RUN_REPORT)}
    users = {module for module in outside_simhal() if wayfarer_modules(module) & trials}
    assert users
    assert users <= {*modules_of("cli"), "wayfarer"}  # which imports what is asked of it


def test_of_the_simulator_only_what_builds_a_rover_knows_the_drivers() -> None:
    """They put the chips under them; chips and world know none."""
    users = {
        module
        for module in modules_of("simhal")
        if any(within(name, "drivers") and not within(name, "drivers.buses") for name in wayfarer_modules(module))
    }
    injected = {module for module in modules_of("simhal") if within(module, "simhal.faults")}
    assert users - injected == {"wayfarer.simhal.built_in_chips"}


def test_pure_modules_know_no_clock_no_loop_and_no_files() -> None:
    for module in modules_of(*PURE):
        assert roots(imports(module)) & IMPURE == set(), module


def test_pure_modules_draw_from_no_global_randomness() -> None:
    for module in modules_of("escape", "detector", "safety"):
        named = {name for name in imports(module) if name.partition(".")[0] == "random"}
        assert named <= {"random", "random.Random"}, module
        tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
        attributes = {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        taken = {name for name in attributes if name.startswith("random.")}
        assert taken <= {"random.Random"}, f"{module}: random.<function> is the global generator"


def test_drivers_see_only_the_contracts() -> None:
    seen = ("hal", "readings", "errors", "angles", "setting_ranges", "waiting_thread", "drivers")
    for module in modules_of("drivers"):
        others = {name for name in wayfarer_modules(module) if not within(name, *seen)}
        assert not others, f"{module} imports {others}"


def test_arrays_and_bus_libraries_are_loaded_by_drivers_when_they_are_used_and_by_nobody_else() -> None:
    for module in outside_simhal():
        if within(module, *ARRAYS_IN) or not roots(imports(module)) & HEAVY:
            continue
        tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
        loaded = imports_when_run(tree, in_functions=not within(module, "drivers"))
        assert roots(loaded) & HEAVY == set(), module


def test_only_the_demo_arms_a_rover_by_itself_and_gives_a_page_buttons_for_the_clock() -> None:
    users = {module for module in MODULES if any(within(name, "demo") for name in wayfarer_modules(module))}
    assert users == {"wayfarer.cli.demo"}


@pytest.mark.process
@pytest.mark.parametrize(
    ("modules", "kept_out"),
    [
        (["wayfarer"], {"numpy", "pydantic", "typer", "structlog", "asyncio", "typing"}),
        (["wayfarer.api.handlers", "wayfarer.api.failsafe"], {"numpy", "pydantic", "asyncio"}),
        (["wayfarer.api.campaigns", "wayfarer.api.trials", "wayfarer.api.runs"], {"numpy"}),
        (
            ["wayfarer.cli"],
            {
                "numpy",
                "scipy",
                "pydantic",
                "asyncio",
                "aiohttp",
                "msgspec",
                "rich",
                "_hashlib",
                "wayfarer.remote.live.server",
            },
        ),
        (["wayfarer.cli.run_trials"], {"numpy"}),
        (["wayfarer.control.supervisor"], HEAVY),
        (["wayfarer.testing"], HEAVY),
        (["wayfarer.daemon.daemon"], HEAVY),
        (["wayfarer.daemon.stop_motors"], HEAVY),
        (modules_of("commissioning", "config"), HEAVY),
        (modules_of("drivers"), HEAVY),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_importing_stays_light(modules: list[str], kept_out: set[str]) -> None:
    code = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert set(modules) <= set(loaded)
    assert kept_out & set(loaded) == set()


# Of these, structlog alone takes rich's tracebacks, 50 ms and 4 MB, and faults know checks, drivers and chips.
ONLY_IF_NEEDED = HEAVY - {"numpy"} | {
    "rich.traceback", "pygments", "wayfarer.simhal.faults.injector", "wayfarer.simhal.faults.kinds",
    "wayfarer.simhal.mujoco", "wayfarer.commissioning.checks.motion", "wayfarer.remote.live.server",
}  # fmt: skip


def loaded_by(command: str) -> str:
    return f"import sys; from wayfarer.cli import run; run({command.split()}); print(*sys.modules)"


@pytest.mark.process
def test_campaign_imports_only_what_it_needs() -> None:
    code = loaded_by("sim --trials 1 --jobs 1")
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    loaded = set(told.splitlines()[-1].split())
    assert loaded >= {"structlog", "numpy", "rich"}
    assert loaded & (ONLY_IF_NEEDED | {"wayfarer.commissioning", "wayfarer.daemon.daemon"}) == set()


@pytest.mark.process
def test_daemon_imports_only_what_it_needs(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified:
        notified.bind(f"{tmp_path}/notify")
        notified.settimeout(30.0)
        environment = {**os.environ, "RUNTIME_DIRECTORY": f"{tmp_path}", "NOTIFY_SOCKET": f"{tmp_path}/notify"}
        command = [sys.executable, "-c", loaded_by(f"run --sim --log-dir {tmp_path}/logs")]
        with children.child(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as daemon:
            assert notified.recv(1000) == b"READY=1"
            daemon.terminate()
            loaded = set(daemon.communicate()[0].split())
    assert loaded >= {"structlog", "numpy"}
    assert loaded & (ONLY_IF_NEEDED | {"rich", "wayfarer.simhal.faults", "wayfarer.cli.run_trials"}) == set()


@pytest.mark.process
@pytest.mark.parametrize(
    "command",
    ["logs list", "logs summary 1", "logs show 1", "logs check 1", "logs export 1 --format csv --out {0}/run.csv",
     "logs export 1 --format gpx --origin 51,0 --out {0}/run.gpx", "logs export 1 --format mcap --out {0}/run.mcap",
     "report 1 --out {0}/page.html", "replay 1"],
)  # fmt: skip
def test_a_log_is_shown_without_the_simulator(command: str, tmp_path: Path) -> None:
    """``None`` in ``sys.modules`` lets an import of it fail."""
    arguments = [*command.format(tmp_path).split(), "--log-dir", str(ROOT.parent / "field_logs")]
    blocked = "import sys; sys.modules['wayfarer.simhal'] = sys.modules['wayfarer.experiments'] = None"
    code = f"{blocked}; from wayfarer.cli import main; sys.argv[1:] = {arguments}; main()"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr.count("Traceback")) == (0, 0), ran.stderr


@pytest.mark.process
def test_live_page_and_ground_station_need_no_simulator() -> None:
    modules = modules_of("remote", "logview", "export", *RUN_REPORT)
    blocked = "sys.modules['wayfarer.simhal'] = sys.modules['wayfarer.experiments'] = None"
    code = f"import sys; {blocked}; import {', '.join(modules)}; print(len(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0
