"""Do the tests bite? Seeded mutants of what decides on the rover, and how many of them its unit tests kill.

A mutant is one small change of one line of code: a comparison, an operator, a number, a condition that is negated. It
is killed if a test fails: first the tests of its package run, then the tests of the other packages here. What
survives is printed; some of it is equivalent to the original. The same seed draws the same mutants of the same code.

Each mutant runs in a separate process, forked from one that has imported libraries. It exists only in memory.
"""

from __future__ import annotations

import ast
import os
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from random import Random
from typing import NamedTuple

from benchmarks.figures import print_table

ROOT = Path(__file__).parents[1]
PACKAGES = ("escape", "safety", "detector", "control", "drivers")
MUTANTS = 200
LONGEST_S = 600  # a mutant that loops for ever is killed by this; the tests of all packages take one to two minutes
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Lt, ast.Gt: ast.LtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip


class Mutant(NamedTuple):
    """A changed module: its package, its dotted name, the changed line, and the whole source."""

    package: str
    module: str
    line: int
    change: str
    source: str


def print_mutants(count: int = MUTANTS) -> int:
    """Try so many mutants, print the survivors and a table; return 0."""
    for library in ("numpy", "pydantic", "msgspec", "structlog", "pytest"):  # once here, not in each process
        import_module(library)
    if is_killed(Mutant(PACKAGES[0], "", 0, "nothing", "")):
        raise SystemExit("the tests fail without a mutant: pytest -n 0 -m unit " + " ".join(map(tests_of, PACKAGES)))
    killed: Counter[str] = Counter()
    tried: Counter[str] = Counter()
    for mutant in draw(count):
        tried[mutant.package] += 1
        if is_killed(mutant):
            killed[mutant.package] += 1
        else:
            print(f"survives: {mutant.module}:{mutant.line}: {mutant.change}", flush=True)
    rows = [(name, str(tried[name]), str(killed[name])) for name in PACKAGES]
    total = f"{killed.total()} ({100 * killed.total() / tried.total():.1f} %)"
    print_table(("package", "mutants", "killed"), [*rows, ("all", str(tried.total()), total)])
    return 0


def draw(count: int) -> list[Mutant]:
    """Return so many mutants, any line of code of any package as likely as another."""
    sites = [
        (package, path, index)
        for package in PACKAGES
        for path in sorted((ROOT / "wayfarer" / package).rglob("*.py"))
        for index in range(sum(1 for _ in _sites(ast.parse(path.read_text(encoding="utf-8")))))
    ]
    return [_mutant(*site) for site in Random(43).sample(sites, count)]


def _sites(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield every node that can be changed, in functions only: constants of a module are seldom decisions."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            for node in (inner for statement in function.body for inner in ast.walk(statement)):
                if (
                    (isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS)
                    or (isinstance(node, ast.BinOp) and type(node.op) in OPERATORS)
                    or isinstance(node, ast.BoolOp)
                    or (isinstance(node, ast.Constant) and type(node.value) in {int, float})
                    or (isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub))
                ):
                    yield node


def _mutant(package: str, path: Path, index: int) -> Mutant:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    node = list(_sites(tree))[index]
    before = ast.unparse(node)
    line: int = vars(node)["lineno"]
    if isinstance(node, ast.Compare):
        node.ops[0] = COMPARISONS[type(node.ops[0])]()
    elif isinstance(node, ast.BinOp):
        node.op = OPERATORS[type(node.op)]()
    elif isinstance(node, ast.BoolOp):
        node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    elif isinstance(node, ast.Constant):
        assert isinstance(node.value, int | float)
        node.value = node.value + 1
    elif isinstance(node, ast.UnaryOp):
        node.op = ast.UAdd() if isinstance(node.op, ast.USub) else ast.Not()
        if isinstance(node.op, ast.Not):
            node.operand = ast.UnaryOp(ast.Not(), node.operand)
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    return Mutant(package, module, line, f"{before}  ->  {ast.unparse(node)}", ast.unparse(tree))


def is_killed(mutant: Mutant) -> bool:
    """Return whether a test fails, an import does, or the tests do not end."""
    child = os.fork()
    if child == 0:
        os.setsid()
        signal.alarm(LONGEST_S)
        quiet = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(quiet, descriptor)
        os._exit(_try(mutant))
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status) != 0


def _try(mutant: Mutant) -> int:
    import pytest

    for name in [name for name in sys.modules if name.partition(".")[0] in {"wayfarer", "tests", "benchmarks"}]:
        del sys.modules[name]
    sys.meta_path.insert(0, _Mutated(mutant))
    packages = sorted(PACKAGES, key=lambda name: name != mutant.package)  # its own first
    options = ["-q", "-x", "-n", "0", "-p", "no:cacheprovider", "-m", "unit", "--hypothesis-seed=0"]
    return int(pytest.main([*options, *map(tests_of, packages)]))


def tests_of(package: str) -> str:
    """Return the folder of a package's tests."""
    return f"tests/{package}"


class _Mutated(MetaPathFinder, InspectLoader):
    """Finds the one module that is changed, and gives its changed source."""

    def __init__(self, mutant: Mutant) -> None:
        self._mutant = mutant
        place = ROOT.joinpath(*mutant.module.split("."))
        self._package = place if place.is_dir() else None
        self._path = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")

    def find_spec(self, fullname: str, *_: object) -> ModuleSpec | None:
        """Return the spec of the changed module, None of any other."""
        if fullname != self._mutant.module:
            return None
        inside = None if self._package is None else [str(self._package)]
        return spec_from_file_location(fullname, self._path, loader=self, submodule_search_locations=inside)

    def get_source(self, fullname: str) -> str:
        """Return the changed source."""
        del fullname
        return self._mutant.source
