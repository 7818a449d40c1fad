"""wayfarer: an escape controller for ground rovers without vision.

The names below are the public Python API. Each is imported when it is first used, so that ``import wayfarer`` takes a
few milliseconds. For algorithms and drivers of your own ``wayfarer.escape``, ``wayfarer.hal``,
``wayfarer.drivers.buses``, ``wayfarer.errors`` and ``wayfarer.testing`` are public as well. All else may
change from one version to the next.

The package is laid out as the data flows: ``drivers`` (or ``simhal``) behind the protocols of ``hal``, the pure
``detector``, ``escape`` and ``safety``, and the ``supervisor`` that runs them. See ``ARCHITECTURE.md``.
"""

from __future__ import annotations

from wayfarer.version import __version__ as __version__

TYPE_CHECKING = False  # as in ``typing``, which takes longer to import than all of this
if TYPE_CHECKING:  # for type checkers and editors; ``_MODULES`` says the same to Python
    from wayfarer.api.campaigns import run_campaign, run_sweep
    from wayfarer.api.failsafe import FailSafe, StuckDetector
    from wayfarer.api.handlers import make_handler
    from wayfarer.api.results import Results, compare, open_results
    from wayfarer.api.runs import Run, open_run, replay
    from wayfarer.api.trials import Trial, run_trial
    from wayfarer.config.rover_file import load_rover
    from wayfarer.errors import WayfarerError
    from wayfarer.escape.api import Anomaly, Observation
    from wayfarer.escape.settings import EscapeSettings, Vehicle
    from wayfarer.reports.page.html import Plot

__all__ = [  # first what does something, then the types that it takes and gives
    "Anomaly",
    "EscapeSettings",
    "FailSafe",
    "Observation",
    "Plot",
    "Results",
    "Run",
    "StuckDetector",
    "Trial",
    "Vehicle",
    "WayfarerError",
    "compare",
    "load_rover",
    "make_handler",
    "open_results",
    "open_run",
    "replay",
    "run_campaign",
    "run_sweep",
    "run_trial",
]  # fmt: skip

_MODULES = {
    "wayfarer.api.campaigns": ["run_campaign", "run_sweep"],
    "wayfarer.api.failsafe": ["FailSafe", "StuckDetector"],
    "wayfarer.api.handlers": ["make_handler"],
    "wayfarer.api.results": ["Results", "compare", "open_results"],
    "wayfarer.api.runs": ["Run", "open_run", "replay"],
    "wayfarer.api.trials": ["Trial", "run_trial"],
    "wayfarer.config.rover_file": ["load_rover"],
    "wayfarer.errors": ["WayfarerError"],
    "wayfarer.escape.api": ["Anomaly", "Observation"],
    "wayfarer.escape.settings": ["EscapeSettings", "Vehicle"],
    "wayfarer.reports.page.html": ["Plot"],
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


if not TYPE_CHECKING:  # to a type checker it would make any name right

    def __getattr__(name: str) -> object:
        """Import a public name when it is first used."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module 'wayfarer' has no attribute '{name}'")
        from importlib import import_module

        module = import_module(_MODULE_OF[name])
        value: object = getattr(module, name)
        if not module.__file__.endswith(".py"):  # what is compiled keeps no docstring, and people ask help() for it
            import ast
            from pathlib import Path

            source = Path(module.__file__).with_name(module.__name__.rpartition(".")[2] + ".py")
            for node in ast.parse(source.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef) and node.name == name:
                    value.__doc__ = ast.get_docstring(node)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
