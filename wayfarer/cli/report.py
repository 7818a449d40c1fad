"""``wayfarer report``: an HTML page with figures, of a field run, a campaign or a sweep."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.options import AllowCode, LogDir, check_together, complete_runs, examples, log_folder
from wayfarer.cli.trial_options import Jobs
from wayfarer.errors import BadInput
from wayfarer.extras import require
from wayfarer.logview.terminal import say_next

EXAMPLES = examples(
    "wayfarer report",
    "wayfarer report 17",
    "wayfarer report 17 --out ~/run17/report.html",
    "wayfarer report results",
    "wayfarer report results --gallery 30 --jobs 2",
    "wayfarer report results --figure figure.pdf",
)
GALLERY = 6


def report(
    ctx: typer.Context,
    what: Annotated[
        str,
        typer.Argument(
            metavar="RUN|DIR",
            autocompletion=complete_runs,
            help="A run, or a folder that `wayfarer sim --out` or `wayfarer sweep --out` wrote.",
        ),
    ] = "last",
    *,
    gallery: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=1000,
            metavar="N",
            help=f"Number of trials of a campaign to run again and draw. (default: {GALLERY})",
        ),
    ] = None,
    jobs: Jobs = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            dir_okay=False,
            help="File name of the page. (default: report.html in the folder)",
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            dir_okay=False,
            help="Instead of the page of a campaign, draw the paper's figure of it: FILE.pdf, FILE.svg or FILE.png.",
        ),
    ] = None,
    allow_code: AllowCode = False,
    log_dir: LogDir = None,
) -> None:
    """Write report.html for a run (default: the newest), a campaign or a sweep."""
    check_together(ctx, excludes=(("figure", "out"), ("figure", "gallery"), ("figure", "jobs")))
    require("a report")
    if figure:
        require("--figure")
    from wayfarer.fieldlog.fields import escape_control_chars
    from wayfarer.reports.run import write_run_report

    folder = log_folder(log_dir)
    run = _run(what, folder)
    if figure:
        _draw(figure, Path(what) if run is None else run)
        print(f"the figure is {escape_control_chars(str(figure))}")
        say_next("xdg-open", figure)
        return
    page = write_run_report(run, out) if run else _of_trials(Path(what), out, gallery, jobs, allow_code=allow_code)
    print(f"the report is {escape_control_chars(str(page))}")
    say_next("xdg-open", page)


def _of_trials(folder: Path, out: Path | None, gallery: int | None, jobs: int | None, *, allow_code: bool) -> Path:
    """Write the report of a sweep or a campaign, and return the page's path."""
    from rich.console import Console

    from wayfarer.experiments.pool import cores
    from wayfarer.experiments.results import Results
    from wayfarer.logview.progress_bar import shown_progress
    from wayfarer.reports.campaign import write_report
    from wayfarer.reports.sweep import write_sweep_report

    results = Results.open(folder, unfinished=True)
    if results.plan.axes:
        return write_sweep_report(results, out)
    shown = GALLERY if gallery is None else gallery
    progress = partial(shown_progress, Console(stderr=True), 0)
    return write_report(results, out, gallery=shown, jobs=jobs or cores(), allow_code=allow_code, progress=progress)


def _draw(figure: Path, folder: Path) -> None:
    """Draw the paper's figure of a campaign.

    Raises:
        BadInput: the folder holds no finished campaign, or the figure cannot be written.
    """
    from wayfarer.experiments.recorded import SETTINGS
    from wayfarer.experiments.results import Results
    from wayfarer.reports.paper_figure import write_paper_figure

    results = Results.open(folder) if (folder / SETTINGS).exists() else None
    if results is None or results.plan.axes:
        raise BadInput(f"--figure draws a campaign, and {folder} is none: name a folder of `wayfarer sim --out`")
    write_paper_figure(results, figure)


def _run(what: str, logs: Path) -> Path | None:
    """Return the folder of the run that is meant, None for another folder; a run's number goes before its name.

    Raises:
        BadInput: there is no such run or folder.
    """
    from wayfarer.fieldlog.folders import find_run, is_run

    try:
        return find_run(what, logs)
    except BadInput:
        folder = Path(what)
        if folder.is_dir() and not is_run(folder):
            return None
        raise
