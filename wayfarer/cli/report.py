"""``wayfarer report``: a campaign, or a run in the field, as one HTML page with figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.extras import require
from wayfarer.cli.rover import Logs, log_folder

EXAMPLES = """Examples:

wayfarer report

wayfarer report 17

wayfarer report results

wayfarer report results --gallery 30 --jobs 2
"""


def report(
    what: Annotated[
        str,
        typer.Argument(metavar="[DIR|RUN]", help="What `wayfarer sim --out DIR` has filled, or a run."),
    ] = "last",
    *,
    gallery: Annotated[
        int, typer.Option(min=0, max=1000, metavar="N", help="How many trials of a campaign to run again and draw.")
    ] = 12,
    jobs: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processes; without it one for each core.")
    ] = None,
    logs: Logs = None,
) -> None:
    """Make report.html of a campaign, or of a run (default: the newest one); the figures as files too."""
    require("a report")
    from wayfarer.fieldlog.folders import find_run, is_run

    folder = Path(what)
    if folder.is_dir() and not is_run(folder):
        from wayfarer.report.campaign import write_report
        from wayfarer.simhal.command import cores

        page = write_report(folder, gallery=gallery, jobs=jobs or cores())
    else:
        from wayfarer.report.run import write_run_report

        page = write_run_report(find_run(what, log_folder(logs)))
    print(f"the report is {page}")
