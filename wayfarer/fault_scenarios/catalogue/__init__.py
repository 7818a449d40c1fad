"""The field catalogue's faults as scenarios: TOML files beside this one, and procedures for what needs a process."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from wayfarer.fault_scenarios import process_tests
from wayfarer.fault_scenarios.result import Procedure
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.fault_scenarios.scenario_file import read_scenarios

ROWS = 60  # of the field catalogue


def catalogue() -> tuple[Scenario | Procedure, ...]:
    """Return everything that tries a row of the field catalogue, in the order of rows."""
    return tuple(sorted([*_scenarios(), *_procedures()], key=lambda each: each.row or 0))


def _scenarios() -> Iterator[Scenario]:
    for path in sorted(Path(__file__).parent.glob("*.toml")):
        yield from read_scenarios(path)


def _procedures() -> Iterator[Procedure]:
    """Give the procedures that stand in the modules of ``process_tests``, in the order of each file."""
    found: dict[str, Procedure] = {}
    for module in pkgutil.iter_modules(process_tests.__path__, f"{process_tests.__name__}."):
        standing = vars(import_module(module.name)).values()
        found |= {each.name: each for each in standing if isinstance(each, Procedure)}
    yield from found.values()
