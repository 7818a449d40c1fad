"""What a shell offers for a value: runs, algorithms, rovers, fault scenarios. ``--install-completion`` sets it up.

What begins with none of these is completed as a file, by the shell itself. Nothing here may fail or print: it would
stand in the line that a person is typing.
"""

from __future__ import annotations

from collections.abc import Iterable

import typer

from wayfarer.cli.log_folder import log_folder
from wayfarer.errors import BadInput


def runs(ctx: typer.Context) -> list[str]:
    """Return the numbers of the runs in the folder that ``--logs`` names so far; a run without one has its name."""
    from wayfarer.fieldlog.folders import run_folders, short_name

    try:
        found = run_folders(log_folder(ctx.params.get("logs")))
    except BadInput:
        return []
    return [short_name(run) for run in found]


def rovers() -> list[str]:
    """Return the built-in rovers."""
    from wayfarer.config.rover_file import rover_names

    return rover_names()


def algorithm() -> list[str]:
    """Return all algorithms, also those of installed packages."""
    from wayfarer.config.registry import algorithm_names

    return algorithm_names()


def algorithms(incomplete: str) -> list[str]:
    """Return the lists of algorithms that go on from the one typed so far; ``paper`` is all ten of the paper."""
    return _next_in_list(incomplete, [*algorithm(), "paper"])


def fault_scenarios(incomplete: str) -> list[str]:
    """Return the lists of fault scenarios that go on from the one typed so far."""
    from wayfarer.fault_scenarios.catalogue import catalogue

    return _next_in_list(incomplete, [each.name for each in catalogue()])


def _next_in_list(incomplete: str, names: Iterable[str]) -> list[str]:
    before, comma, _ = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in names]
