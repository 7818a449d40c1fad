"""``wayfarer report``: an HTML page with figures, of a field run, a campaign or a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.cli.options import AllowCode, LogDir, complete_runs, examples, log_folder
from wayfarer.cli.trial_options import Jobs
from wayfarer.errors import BadInput
from wayfarer.extras import require
from wayfarer.views.text.scripting import say_next

EXAMPLES = examples(
    "wayfarer report",
    "wayfarer report 17",
    "wayfarer report 17 --out ~/run17/report.html",
    "wayfarer report results",
    "wayfarer report results --gallery 30 --jobs 2",
    "wayfarer report results --figures figures",
)


def report(
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
        int, typer.Option(min=0, max=1000, metavar="N", help="Number of trials of a campaign to run again and draw.")
    ] = 12,
    jobs: Jobs = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            dir_okay=False,
            help="File name of the page. (default: report.html in the folder)",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            file_okay=False,
            help="Of a campaign: write its figures there too, as SVG and PDF for papers, for one column and for two.",
        ),
    ] = None,
    allow_code: AllowCode = False,
    log_dir: LogDir = None,
) -> None:
    """Write report.html for a run (default: the newest), a campaign or a sweep."""
    require("a report")
    if figures:
        require("--figures")
    from wayfarer.fieldlog.fields import escape_control_chars
    from wayfarer.views.run_report.run import write_run_report

    folder = log_folder(log_dir)
    if run := _run(what, folder):
        _refuse(figures)
        page = write_run_report(run, out)
    else:
        page = _of_trials(Path(what), out, gallery, jobs, figures, allow_code=allow_code)
    print(f"the report is {escape_control_chars(str(page))}")
    say_next("xdg-open", page)


def _of_trials(
    folder: Path, out: Path | None, gallery: int, jobs: int | None, figures: Path | None, *, allow_code: bool
) -> Path:
    """Write the report of a sweep or a campaign, and return the page's path."""
    require("comparing")
    from wayfarer.experiments.commands import cores
    from wayfarer.experiments.report.campaign import write_report
    from wayfarer.experiments.report.sweep import write_sweep_report
    from wayfarer.experiments.report.sweep_results import is_sweep
    from wayfarer.fieldlog.fields import escape_control_chars

    if is_sweep(folder):
        _refuse(figures)
        return write_sweep_report(folder, out)
    if figures:
        from wayfarer.experiments.report.load_results import read_results
        from wayfarer.experiments.report.paper_figures import write_figures

        write_figures(read_results(folder), figures)
        print(f"the figures are in {escape_control_chars(str(figures))}")
    return write_report(folder, out, gallery=gallery, jobs=jobs or cores(), allow_code=allow_code)


def _refuse(figures: Path | None) -> None:
    if figures:
        raise BadInput("--figures draws a campaign: name a folder that `wayfarer sim --out` wrote, or leave it out")


def _run(what: str, logs: Path) -> Path | None:
    """Return the folder of the run that is meant, None for another folder; a run's number goes before its name.

    Raises:
        BadInput: there is neither such a run nor such a folder.
    """
    from wayfarer.fieldlog.folders import find_run, is_run

    try:
        return find_run(what, logs)
    except BadInput:
        folder = Path(what)
        if folder.is_dir() and not is_run(folder):
            return None
        raise
