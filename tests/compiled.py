"""Compiled libraries for the tests, in the folder ``.compiled`` of the checkout: taken while they are fresh.

``python -m tests.compiled`` makes them, as an installation does, in some 70 s of a core. A run of pytest, and each
process that it starts, then imports them in the place of their sources; nothing else does. They are fresh as long as
nothing has changed of what they were made of: this environment (``.ci/run`` has others), the build hook and its table
in ``pyproject.toml``, the compiled modules and what these import, from whose types C is made. Otherwise the sources
run, and the head of pytest's output says what has changed. ``WAYFARER_COMPILE=0 pytest`` takes the sources in any case.
"""

from __future__ import annotations

import json
import os
import runpy
import sys
import tomllib
from collections.abc import Iterable
from hashlib import sha256
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / ".compiled" / str(sys.implementation.cache_tag)
MADE_OF = "made_of.json"
# Each process of Python that has this folder on PYTHONPATH runs it first.
FINDER = '''"""Finds compiled modules of wayfarer; see tests/compiled.py."""
import sys
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, FileFinder
from pathlib import Path

class Compiled:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0].startswith("wayfarer"):
            folder = Path(__file__).parent.joinpath(*name.split(".")[:-1])
            found = FileFinder(str(folder), (ExtensionFileLoader, EXTENSION_SUFFIXES)).find_spec(name)
            return found if found is not None and found.loader is not None else None

sys.meta_path.insert(0, Compiled())
'''


def libraries(root: Path) -> dict[str, list[str]]:
    """Return the modules of each library, as the build hook's table has them."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    found: dict[str, list[str]] = project["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]["libraries"]
    return found


def with_imported(root: Path, paths: Iterable[str]) -> set[str]:
    """Return modules, and all modules of wayfarer that they import, directly or not, as paths."""
    from tests.test_imports import named_in

    waiting, found = list(paths), set[str]()
    while waiting:
        if (path := waiting.pop()) not in found:
            found.add(path)
            for name in named_in((root / path).read_text(encoding="utf-8")):
                inside = name.replace(".", "/")
                waiting += [each for each in (f"{inside}.py", f"{inside}/__init__.py") if (root / each).is_file()]
    return {path for path in found if path.startswith("wayfarer/")}


def made_of(root: Path, paths: Iterable[str]) -> dict[str, str]:
    """Return what libraries are made of: a checksum of each file, and of all else that counts."""
    sums = {path: sha256((root / path).read_bytes()).hexdigest() if (root / path).is_file() else "" for path in paths}
    return {**sums, "pyproject.toml": json.dumps(libraries(root)), "Python": f"{sys.version} in {sys.prefix}"}


def changed(root: Path = ROOT, folder: Path = FOLDER) -> str | None:
    """Return what makes the libraries useless, None if they are fresh."""
    try:
        noted: dict[str, str] = json.loads((folder / MADE_OF).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return "python -m tests.compiled has not been run"
    now = made_of(root, [path for path in noted if path.endswith(".py")])
    return next((f"{name} has changed" for name in noted if noted[name] != now[name]), None)


def make(root: Path = ROOT, folder: Path = FOLDER) -> str | None:
    """Compile; return why that failed, or None."""
    from hatch_build import compile_libraries

    table = libraries(root)
    sources = made_of(root, ["hatch_build.py", *sorted(with_imported(root, chain(*table.values())))])
    if (error := compile_libraries(root, folder, table)) is None:
        (folder / "sitecustomize.py").write_text(FINDER, encoding="utf-8")
        (folder / MADE_OF).write_text(json.dumps(sources), encoding="utf-8")
    return error


def take(root: Path = ROOT, folder: Path = FOLDER) -> str:
    """Have this process and those that it starts import the libraries if they are fresh; say what runs."""
    if os.environ.get("WAYFARER_COMPILE") == "0":
        return "pure Python (WAYFARER_COMPILE=0)"
    if (why := changed(root, folder)) is not None:
        return f"pure Python ({why})"
    before = os.environ.get("PYTHONPATH", "")
    if str(folder) not in before.split(os.pathsep):  # as in a worker, which has begun with it
        os.environ["PYTHONPATH"] = f"{folder}{os.pathsep}{before}".rstrip(os.pathsep)
        runpy.run_path(str(folder / "sitecustomize.py"))
    return f"compiled ({folder})"


def pytest_report_header() -> str:
    """Say what runs."""
    return f"wayfarer: {TAKEN}"


if __name__ == "__main__":
    sys.exit(make())
TAKEN = take()
