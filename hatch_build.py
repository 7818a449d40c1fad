"""Build hook: writes the version into what is built, and compiles the wheel's control tick and simulated world.

mypyc compiles, where a C compiler works. Which modules, and into which shared libraries, is a table in
``pyproject.toml``. The environment variable ``WAYFARER_COMPILE`` decides: ``0`` installs pure Python, ``1`` fails where
nothing can be compiled; without it, pure Python is installed there, and where the compiler needs more memory than the
computer has. It does the same more slowly. An editable installation is pure. ``wayfarer --version`` says which it is.
What is built for many computers sets ``WAYFARER_OPTIMISE=2``: the compiler takes twice as long for a few per cent.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# Peaks of memory (x86_64, gcc 12): two libraries side by side take 0.72 GB, one after the other 0.4 GB, mypy before
# them 0.3 GB; the system needs the rest. A board of 1 GB has a MemTotal of some 0.95 GB, one of 2 GB some 1.9 GB.
LEAST_MEMORY_GB = 0.8
SIDE_BY_SIDE_GB = 1.5
MEMINFO = Path("/proc/meminfo")

# mypyc gets at its options through setuptools only. Types of libraries that are not there do not matter.
SETUP = """
import json, sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from setuptools import setup
import setuptools.command.build_py  # not in two compiling threads at once: one of them may get half of it, and fail

libraries, jobs, level = json.loads(sys.argv[1])

def generate():
    from mypyc.build import mypycify
    modules = [module for library in libraries.values() for module in library]
    return mypycify(
        # Libraries count as unknown, as where pip builds alone: reading their types takes minutes and gives nothing.
        ["--follow-imports=silent", "--ignore-missing-imports", "--no-site-packages", *modules],
        opt_level=level,
        debug_level="0",
        separate=[(library, name) for name, library in libraries.items()],
    )

# In a separate process, whose memory is free again when the compiler needs it.
with ProcessPoolExecutor(1, get_context("fork")) as apart:
    extensions = apart.submit(generate).result()
extensions.sort(key=lambda extension: not extension.name.endswith("__mypyc"))  # first what takes long: one a core
for extension in extensions:
    # A warning of another compiler is no reason for pure Python. aarch64 can multiply and add with one rounding, which
    # compilers may use unless told not to: a trial would not have the same bytes as on x86_64.
    flags = [flag for flag in extension.extra_compile_args if flag != "-Werror"]
    extension.extra_compile_args = [*flags, "-ffp-contract=off"]
setup(ext_modules=extensions, script_args=["-q", "build_ext", "--inplace", "--parallel", str(jobs)])
"""


class CompileHook(BuildHookInterface[Any]):
    """Puts the version in the place of ``wayfarer/version.py``, and adds the compiled modules to a wheel.

    The Python files stay in the wheel, for tracebacks.
    """

    PLUGIN_NAME = "custom"
    _outside: TemporaryDirectory[str] | None = None

    def dependencies(self) -> list[str]:
        """Return what compiling needs at build time, nothing for pure Python."""
        return list(self.config["requires"]) if self.target_name == "wheel" and self._why_pure() is None else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile a wheel, unless it is to be pure, and write the version.

        Raises:
            RuntimeError: ``WAYFARER_COMPILE=1`` and nothing can be compiled.
        """
        if version == "editable":
            return
        why_pure = (self._why_pure() or self._compile(build_data)) if self.target_name == "wheel" else None
        if why_pure is not None and _demand() == "1":
            raise RuntimeError(f"WAYFARER_COMPILE=1, but {why_pure}")
        if why_pure is not None:
            self.app.display_warning(f"wayfarer: pure Python, because {why_pure}")
        self._write_version(build_data)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove what was written and compiled."""
        shutil.rmtree(self._folder, ignore_errors=True)
        if self._outside is not None:
            self._outside.cleanup()

    @property
    def _folder(self) -> Path:
        return Path(self.directory) / "compiled"

    def _write_version(self, build_data: dict[str, Any]) -> None:
        # Hatchling replaces a file only by one from outside the checkout.
        self._outside = TemporaryDirectory()
        text = f'"""The version that this was built as."""\n\n__version__ = "{self.metadata.version}"\n'
        written = Path(self._outside.name, "version.py")
        written.write_text(text, encoding="utf-8")
        build_data["force_include"][str(written)] = "wayfarer/version.py"

    def _why_pure(self) -> str | None:
        if _demand() == "0":
            return "WAYFARER_COMPILE=0"
        return why_no_compiler() or (why_too_little_memory(MEMINFO) if _demand() == "" else None)

    def _compile(self, build_data: dict[str, Any]) -> str | None:
        """Compile and tell the wheel what to take; return why that failed, or None."""
        modules = sum(map(len, self.config["libraries"].values()))
        self.app.display_waiting(
            f"wayfarer: compiling {modules} modules, half a minute to some minutes on a small board"
        )
        error = compile_libraries(Path(self.root), self._folder, self.config["libraries"])
        if error is None:
            built = {path: path.relative_to(self._folder) for path in sorted(self._folder.rglob("*")) if path.is_file()}
            build_data["force_include"] |= {str(path): str(inside) for path, inside in built.items()}
            build_data |= {"pure_python": False, "infer_tag": True}
        return error


def why_no_compiler() -> str | None:
    """Return why C cannot be compiled here, None if it seems that it can."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]
    if shutil.which(compiler) is None:
        return f"there is no C compiler ({compiler})"
    if not Path(sysconfig.get_path("include"), "Python.h").exists():
        return "Python's header files are not installed (python3-dev)"
    return None


def why_too_little_memory(meminfo: Path) -> str | None:
    """Return why compiling could exhaust the memory of a computer with this ``/proc/meminfo``, None if it fits."""
    memory_gb = _memory_gb(meminfo)
    if memory_gb < LEAST_MEMORY_GB:
        return f"compiling needs {LEAST_MEMORY_GB} GB of memory, not {memory_gb:.1f} GB; WAYFARER_COMPILE=1 tries it"
    return None


def jobs_for(meminfo: Path) -> int:
    """Return how many compilers may work at once on a computer with this ``/proc/meminfo``."""
    return 1 if _memory_gb(meminfo) < SIDE_BY_SIDE_GB else os.cpu_count() or 1


def _memory_gb(meminfo: Path) -> float:
    """Return a computer's memory; enough if it does not say it."""
    found = re.search(r"^MemTotal: +(\d+) kB$", meminfo.read_text(encoding="ascii"), re.MULTILINE)
    return int(found[1]) * 1024 / 1e9 if found else SIDE_BY_SIDE_GB


def compile_libraries(root: Path, into: Path, libraries: Mapping[str, Sequence[str]]) -> str | None:
    """Compile the modules of a checkout with mypyc; ``into`` gets the shared objects, at their places in the package.

    Args:
        root: the checkout.
        into: a folder, which is replaced.
        libraries: for each shared library its modules, as paths from the root.

    Returns:
        Why that failed, or None.
    """
    shutil.rmtree(into, ignore_errors=True)
    with TemporaryDirectory() as work:
        shutil.copytree(root / "wayfarer", Path(work, "wayfarer"), ignore=shutil.ignore_patterns("*.so", "__pycache__"))
        task = json.dumps([libraries, jobs_for(MEMINFO), os.environ.get("WAYFARER_OPTIMISE", "1")])
        command = [sys.executable, "-c", SETUP, task]
        environment = {**os.environ, "LDSHARED": _linker()}
        done = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
            return f"compiling failed: {' '.join(last)}"
        for path in Path(work).rglob("*.so"):
            inside = path.relative_to(work)
            if inside.parts[0] != "build":
                (into / inside).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, into / inside)
    return None


def _linker() -> str:
    """Return Python's command for linking, without the folder of this computer where it would look for libraries."""
    words = shlex.split(os.environ.get("LDSHARED") or sysconfig.get_config_var("LDSHARED") or "cc -shared")
    return shlex.join(word for word in words if not word.startswith(("-Wl,-rpath", "-Wl,-R")))


def _demand() -> str:
    """Return what ``WAYFARER_COMPILE`` asks for: ``0``, ``1`` or nothing."""
    demand = os.environ.get("WAYFARER_COMPILE", "")
    if demand not in {"", "0", "1"}:
        raise RuntimeError(f"WAYFARER_COMPILE={demand}: possible are 0 (pure Python) and 1 (compiled, or fail)")
    return demand
