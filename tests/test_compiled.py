"""What is compiled: the list in ``pyproject.toml`` keeps to what mypyc can do, and the build hook falls back."""

from __future__ import annotations

import ast
import os
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterator
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import hatch_build
from hatch_build import CompileHook, compile_libraries, jobs_for, why_no_compiler, why_too_little_memory
from tests import compiled

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
HOOK = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]
COMPILED = [path for library in HOOK["libraries"].values() for path in library]
SUBCLASSED = "mypyc_attr(allow_interpreted_subclasses=True)"


def trees(compiled: bool) -> Iterator[tuple[str, ast.Module]]:
    for path in sorted((ROOT / "wayfarer").rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if (name in COMPILED) is compiled:
            yield name, ast.parse(path.read_text(encoding="utf-8"))


def test_each_module_is_there_and_listed_once() -> None:
    assert len(set(COMPILED)) == len(COMPILED)
    assert all((ROOT / path).is_file() for path in COMPILED)


def test_libraries_are_of_one_size() -> None:
    """So two cores have as much to compile; a C compiler takes as long as there are expressions and statements."""

    def size(path: str) -> int:
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        return sum(isinstance(node, ast.expr | ast.stmt) for node in ast.walk(tree))

    sizes = [sum(map(size, library)) for library in HOOK["libraries"].values()]
    assert max(sizes) < 1.2 * min(sizes)


def waits_in_a_handler(function: ast.AsyncFunctionDef) -> bool:
    """Whether a coroutine waits while it handles an exception: compiled, it would show that exception to all others."""
    for node in ast.walk(function):
        if isinstance(node, ast.AsyncWith):
            return True
        if isinstance(node, ast.Try):
            handling = [*node.finalbody, *(line for handler in node.handlers for line in handler.body)]
            if any(isinstance(inner, ast.Await) for line in handling for inner in ast.walk(line)):
                return True
    return False


def test_no_compiled_coroutine_waits_while_it_handles_an_exception() -> None:
    found = {
        f"{name}: {node.name}"
        for name, tree in trees(compiled=True)
        for node in ast.walk(tree)
        if isinstance(node, ast.AsyncFunctionDef) and waits_in_a_handler(node)
    }
    assert found == set()


def test_compiled_class_that_plain_python_inherits_from_says_so() -> None:
    may_inherit = {
        node.name: SUBCLASSED in map(ast.unparse, node.decorator_list)
        for _, tree in trees(compiled=True)
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    inherited = {
        base.id
        for _, tree in trees(compiled=False)
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for base in node.bases
        if isinstance(base, ast.Name)
    }
    assert {name for name in inherited if may_inherit.get(name) is False} == set()
    assert may_inherit["World"], "the test finds nothing"


def test_constants_of_compiled_modules_are_final() -> None:
    found = {
        f"{name}: {target.id}"
        for name, tree in trees(compiled=True)
        for node in tree.body
        if isinstance(node, ast.Assign)
        or (isinstance(node, ast.AnnAssign) and not ast.unparse(node.annotation).startswith("Final"))
        for whole in (node.targets if isinstance(node, ast.Assign) else [node.target])
        for target in ast.walk(whole)
        if isinstance(target, ast.Name) and target.id.isupper() and len(target.id) > 1  # a single letter is a type
    }
    assert found == set(), "compiled code looks them up by name at each use; say NAME: Final = value"


# -- the build hook ----------------------------------------------------------------------------------------------------


def hook(target: str = "wheel") -> CompileHook:
    metadata: Any = SimpleNamespace(version="9.8.7")
    return CompileHook(str(ROOT), HOOK, None, metadata, str(ROOT / "nowhere"), target)


def test_what_is_built_has_its_version_in_the_place_of_the_checkouts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WAYFARER_COMPILE", "1")  # which is about wheels
    source = hook("sdist")
    assert source.dependencies() == []
    build_data: dict[str, Any] = {"force_include": {}}
    source.initialize("standard", build_data)
    ((written, place),) = build_data["force_include"].items()
    assert place == "wayfarer/version.py"
    found: dict[str, Any] = {}
    exec(Path(written).read_text(encoding="utf-8"), found)
    assert found["__version__"] == "9.8.7"
    source.finalize("standard", build_data, "")
    assert not Path(written).exists()


def test_missing_compiler_means_pure_python_unless_it_is_demanded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.delenv("WAYFARER_COMPILE", raising=False)
    assert why_no_compiler() == "there is no C compiler (no-such-compiler)"
    assert hook().dependencies() == []
    told: list[str] = []
    build_data: dict[str, Any] = {"force_include": {}}
    pure = hook()
    monkeypatch.setattr(type(pure), "app", type("App", (), {"display_warning": staticmethod(told.append)}))
    pure.initialize("standard", build_data)
    assert told == ["wayfarer: pure Python, because there is no C compiler (no-such-compiler)"]
    assert list(build_data["force_include"].values()) == ["wayfarer/version.py"]
    assert list(build_data) == ["force_include"]
    pure.finalize("standard", build_data, "")
    monkeypatch.setenv("WAYFARER_COMPILE", "1")
    with pytest.raises(RuntimeError, match="WAYFARER_COMPILE=1, but there is no C compiler"):
        hook().initialize("standard", {"force_include": {}})


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[int], None]:
    """Give this computer another memory, in kB."""
    meminfo = tmp_path / "meminfo"
    monkeypatch.setattr("hatch_build.MEMINFO", meminfo)

    def has(memory_kb: int) -> None:
        meminfo.write_text(f"MemTotal:         {memory_kb} kB\nMemFree:          100000 kB\n", encoding="ascii")

    return has


def test_board_with_little_memory_compiles_only_on_demand(
    board: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    board(437_248)  # a Zero 2 W
    monkeypatch.setattr("hatch_build.why_no_compiler", lambda: None)
    monkeypatch.delenv("WAYFARER_COMPILE", raising=False)
    assert hook().dependencies() == []
    why = "compiling needs 0.8 GB of memory, not 0.4 GB; WAYFARER_COMPILE=1 tries it"
    assert why_too_little_memory(hatch_build.MEMINFO) == why
    monkeypatch.setenv("WAYFARER_COMPILE", "1")
    assert hook().dependencies() == HOOK["requires"]


@pytest.mark.parametrize(
    ("memory_kb", "side_by_side"), [(942_344, False), (1_886_820, True)], ids=["Pi 3, 1 GB", "Pi 4, 2 GB"]
)
def test_board_of_1_gb_compiles_one_library_after_the_other(
    board: Callable[[int], None], memory_kb: int, side_by_side: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    board(memory_kb)
    assert why_too_little_memory(hatch_build.MEMINFO) is None
    assert jobs_for(hatch_build.MEMINFO) == (4 if side_by_side else 1)


def test_other_demand_than_0_and_1_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WAYFARER_COMPILE", "yes")
    with pytest.raises(RuntimeError, match="WAYFARER_COMPILE=yes: possible are 0"):
        hook().initialize("standard", {"force_include": {}})


@pytest.mark.parametrize("version", ["editable", "standard"])
def test_editable_installation_and_one_that_is_to_be_pure_compile_nothing(
    version: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WAYFARER_COMPILE", "1" if version == "editable" else "0")
    monkeypatch.setattr("hatch_build.compile_libraries", lambda *_: pytest.fail("it compiles"))
    quiet = hook()
    monkeypatch.setattr(type(quiet), "app", type("App", (), {"display_warning": staticmethod(lambda _: None)}))
    build_data: dict[str, Any] = {"force_include": {}}
    quiet.initialize(version, build_data)
    written = [] if version == "editable" else ["wayfarer/version.py"]
    assert list(build_data.pop("force_include").values()) == written
    assert build_data == {}
    quiet.finalize(version, build_data, "")


@pytest.mark.process
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_module_that_cannot_be_compiled_is_told_in_one_line(tmp_path: Path) -> None:
    pytest.importorskip("mypyc")
    (tmp_path / "wayfarer").mkdir()
    (tmp_path / "wayfarer" / "bad.py").write_text("def f() -> int:\n    return 'no number'\n", encoding="utf-8")
    why = compile_libraries(tmp_path, tmp_path / "built", {"wayfarer_bad": ["wayfarer/bad.py"]})
    assert why is not None
    assert why.startswith("compiling failed: ")
    assert "\n" not in why
    assert not (tmp_path / "built").exists()


# -- libraries for the tests -------------------------------------------------------------------------------------------

TABLE = "[tool.hatch.build.targets.wheel.hooks.custom.libraries]\nwayfarer_tick = ['wayfarer/tick.py']\n"


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One with a compiled module, what that imports, and what it does not; the compiler writes an empty library."""

    def compiles(root: Path, into: Path, libraries: object) -> None:
        (into / "wayfarer").mkdir(parents=True)
        (into / f"wayfarer/tick{EXTENSION_SUFFIXES[0]}").touch()

    monkeypatch.setattr("hatch_build.compile_libraries", compiles)
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path])
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    monkeypatch.delenv("WAYFARER_COMPILE", raising=False)
    (tmp_path / "wayfarer").mkdir()
    for name, text in {
        "tick": "from wayfarer.safety import x",
        "safety": "from wayfarer.hal import y",
        "cli": "",
    }.items():
        (tmp_path / f"wayfarer/{name}.py").write_text(text, encoding="utf-8")
    (tmp_path / "wayfarer/hal.py").write_text("y: int", encoding="utf-8")
    (tmp_path / "hatch_build.py").touch()
    (tmp_path / "pyproject.toml").write_text(TABLE, encoding="utf-8")
    assert compiled.make(tmp_path, tmp_path / "made") is None
    return tmp_path


def test_fresh_libraries_are_taken_by_this_process_and_those_that_it_starts(checkout: Path) -> None:
    made = checkout / "made"
    (checkout / "wayfarer/cli.py").write_text("is_not_compiled = True", encoding="utf-8")
    assert compiled.take(checkout, made) == f"compiled ({made})"
    assert os.environ["PYTHONPATH"] == f"{made}{os.pathsep}elsewhere"
    found = find_spec("wayfarer.tick")
    assert found is not None
    assert found.origin == str(made / f"wayfarer/tick{EXTENSION_SUFFIXES[0]}")
    assert sys.meta_path[0].find_spec("wayfarer", None) is None, "a folder of libraries is no package"
    assert sys.meta_path[0].find_spec("wayfarer.hal", None) is None


@pytest.mark.parametrize("path", ["wayfarer/tick.py", "wayfarer/safety.py", "wayfarer/hal.py", "hatch_build.py"])
@pytest.mark.parametrize("change", [lambda path: path.write_text("#", "utf-8"), Path.unlink], ids=["edited", "gone"])
def test_libraries_are_never_taken_after_a_change_of_what_they_were_made_of(
    checkout: Path, path: str, change: Callable[[Path], object]
) -> None:
    finders = [*sys.meta_path]
    change(checkout / path)
    assert compiled.take(checkout, checkout / "made") == f"pure Python ({path} has changed)"
    assert (sys.meta_path, os.environ["PYTHONPATH"]) == (finders, "elsewhere")


def test_libraries_of_another_table_another_python_or_of_none_are_not_taken(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finders, made = [*sys.meta_path], checkout / "made"
    assert compiled.take(checkout, checkout / "nowhere") == "pure Python (python -m tests.compiled has not been run)"
    for what in ("version", "prefix"):
        with monkeypatch.context() as other:
            other.setattr(sys, what, "another")
            assert compiled.take(checkout, made) == "pure Python (Python has changed)"
    with monkeypatch.context() as other:
        other.setenv("WAYFARER_COMPILE", "0")
        assert compiled.take(checkout, made) == "pure Python (WAYFARER_COMPILE=0)"
    (checkout / "pyproject.toml").write_text(TABLE.replace("']", "', 'wayfarer/cli.py']"), encoding="utf-8")
    assert compiled.take(checkout, made) == "pure Python (pyproject.toml has changed)"
    assert sys.meta_path == finders
