"""``wayfarer report``: a folder of results as one HTML page with figures."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.errors import WayfarerError

EXAMPLES = """Examples:

wayfarer report results

wayfarer report results --gallery 30 --jobs 2
"""


def report(
    path: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `wayfarer sim --out DIR` has filled.")],
    *,
    gallery: Annotated[
        int, typer.Option(min=0, max=1000, metavar="N", help="How many trials to run again and draw.")
    ] = 12,
    jobs: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processes; without it one for each core.")
    ] = None,
) -> None:
    """Make report.html in a folder of results: table, figures and drawings of trials; the figures as files too."""
    require_matplotlib()
    from wayfarer.report.campaign import write_report
    from wayfarer.simhal.command import cores

    print(f"the report is {write_report(path, gallery=gallery, jobs=jobs or cores())}")


def require_matplotlib() -> None:
    """Refuse to draw without what that needs.

    Raises:
        WayfarerError: a package is missing; the text says how to install it.
    """
    missing = [name for name in ("matplotlib", "numpy") if find_spec(name) is None]
    if missing:
        remedy = "pip install '.[sim]' in wayfarer's checkout"
        raise WayfarerError(f"a report needs {missing[0]}, which is not installed: {remedy}")
