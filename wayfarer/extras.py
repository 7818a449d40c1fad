"""What is imported only if it is needed: the optional extras of the installation, and what a library would bring."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from typing import Any, NamedTuple

from wayfarer.errors import MissingPackage, how_to_install


class OptionalExtra(NamedTuple):
    """An extra of the installation, and which packages of it something imports, by module and by the index's name."""

    extra: str
    packages: dict[str, str]


NEEDS = {
    "simulating": OptionalExtra("sim", {"numpy": "numpy"}),
    "--spl": OptionalExtra("spl", {"skfmm": "scikit-fmm"}),
    "--site": OptionalExtra("sim", {"scipy": "scipy"}),
    "a cluster": OptionalExtra("cluster", {"distributed": "distributed"}),
    "--physics mujoco": OptionalExtra("physics", {"mujoco": "mujoco"}),
    "--figure": OptionalExtra("figures", {"matplotlib": "matplotlib"}),
    "a plot": OptionalExtra("sim", {"bokeh": "bokeh", "numpy": "numpy"}),
    "a report": OptionalExtra("sim", {"bokeh": "bokeh", "numpy": "numpy"}),
    "the live page": OptionalExtra("live", {"aiohttp": "aiohttp"}),
    "gpx": OptionalExtra("export", {"gpxpy": "gpxpy", "numpy": "numpy"}),
    "mcap": OptionalExtra("export", {"foxglove": "foxglove-sdk"}),
    "--mavlink": OptionalExtra("mavlink", {"pymavlink": "pymavlink"}),
}


def require(what: str) -> None:
    """Refuse to continue if packages of one of ``NEEDS`` are missing; called before they are imported.

    Raises:
        MissingPackage: a package is missing; the text says how to install it.
    """
    extra, packages = NEEDS[what]
    for module, package in packages.items():
        if find_spec(module) is None:
            raise MissingPackage(f"{what} needs {package}, which is not installed: {how_to_install(extra)}")


def import_structlog() -> None:
    """Import structlog without rich, which it takes for tracebacks that no command prints: 50 ms, and 4 MB of a daemon.

    For commands only: a program that imports wayfarer may want these tracebacks.
    """
    modules: dict[str, Any] = sys.modules
    rich = modules.get("rich")
    modules["rich"] = None  # it cannot be imported now, and structlog does without
    try:
        import structlog  # noqa: F401
    finally:
        del modules["rich"]
        if rich is not None:
            modules["rich"] = rich
