"""``wayfarer logs``: list, follow, show, summarise, check and export field logs."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli.extras import require
from wayfarer.cli.options import AsJson, Logs, examples, log_folder
from wayfarer.errors import BadInput
from wayfarer.views.export.formats import ExportFormat, Output

if TYPE_CHECKING:
    from wayfarer.fieldlog.reader import Damage
    from wayfarer.views.text.run_narrator import Line

POLL_S = 0.3  # how long a line waits until it is shown, at most
STDOUT = Path("-")

# The terminal's colours (SGR codes), by the tone of a line; they follow the user's colour scheme.
COLOURS = {"quiet": "2", "phase": "36", "person": "1", "warning": "33", "fault": "1;31", "end": "1;32"}

EXAMPLES = examples(
    "wayfarer logs list",
    "wayfarer logs follow",
    "wayfarer logs summary 17",
    "wayfarer logs export 17 --format csv",
    "wayfarer logs export 17 --format gpx",
)
app = typer.Typer(no_args_is_help=True, epilog=EXAMPLES)

FORMATS_HELP = f"{'; '.join(f'{form}: {form.meaning}' for form in ExportFormat)}. (default: by FILE's ending, or csv)"

Run = Annotated[
    str | None, typer.Argument(metavar="RUN", help="Number, folder or file of a run. (default: the newest run)")
]


@app.callback()
def _root() -> None:
    """Read the logs of runs: what happened, what is happening, and where the rover is likely to be."""


@app.command("list")
def list_runs(*, logs: Logs = None) -> None:
    """List all runs, the newest last."""
    from wayfarer.fieldlog.clock import wall_clock
    from wayfarer.views.text.listing import lines, rows

    folder = log_folder(logs)
    found = rows(folder, wall_clock(0.0))
    if not found:
        raise BadInput(f"{folder} holds no run; say where runs are logged with --logs DIR")
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    with _until_closed():
        print("\n".join(lines(found, width)))


@app.command()
def follow(run: Run = None, *, logs: Logs = None) -> None:
    """Show events as they happen, of this run and the next ones; with RUN until that run ends. Ctrl-C ends it."""
    from wayfarer.fieldlog.folders import find_run, run_folders
    from wayfarer.views.text.run_narrator import RunNarrator
    from wayfarer.views.text.tail import follow as follow_records
    from wayfarer.views.text.verdict import NO_OUTCOME

    folder = log_folder(logs)
    chosen = None if run in (None, "last") else find_run(run, folder)
    if chosen is None and not run_folders(folder):
        print(f"waiting for a run in {folder}", file=sys.stderr)
    told: Path | None = None
    waits_for = "" if chosen is None else f"{NO_OUTCOME}; waiting for more (Ctrl-C ends)"

    def wait() -> None:
        nonlocal waits_for
        if waits_for:
            print(waits_for, file=sys.stderr)
            waits_for = ""
        Event().wait(POLL_S)  # there is no event loop that sleeping could hold up

    with suppress(KeyboardInterrupt), _until_closed():
        for path, record in follow_records(folder, chosen, wait):
            if path != told:
                told, narrator = path, RunNarrator()
                print(_titled(path), flush=True)
            _tell(narrator.take(record), flush=True)
        if chosen is not None:
            _tell_damage(_damage_of(chosen))


@app.command()
def show(
    run: Run = None,
    *,
    logs: Logs = None,
    ticks: Annotated[bool, typer.Option("--ticks", help="Print every control tick.")] = False,
) -> None:
    """Show all events of a run, from its beginning."""
    from wayfarer.fieldlog.folders import find_run
    from wayfarer.fieldlog.reader import Damage, RunReader
    from wayfarer.views.text.run_narrator import RunNarrator
    from wayfarer.views.text.verdict import NO_OUTCOME, readable

    narrator, ended = RunNarrator(ticks=ticks), False
    reader = RunReader(find_run(run, log_folder(logs)))
    with _until_closed():
        for record in readable(reader):
            _tell(narrator.take(record))
            ended = record["record"] == "outcome"
        if not ended:
            print(NO_OUTCOME)
        if reader.damage != Damage():
            print(reader.damage)


@app.command()
def summary(
    run: Run = None,
    *,
    logs: Logs = None,
    as_json: AsJson = False,
) -> None:
    """Summarise a run: distance, duration, anomalies, and where the rover is likely to be."""
    from wayfarer.fieldlog.folders import find_run
    from wayfarer.fieldlog.reader import RunReader
    from wayfarer.views.text.run_summariser import summarise
    from wayfarer.views.text.verdict import readable

    reader = RunReader(find_run(run, log_folder(logs)))
    found = summarise(readable(reader))
    title = _titled(reader.run)
    if as_json:
        import json
        from dataclasses import asdict

        text = json.dumps({"run": title, **asdict(found), "damage": asdict(reader.damage)})
    else:
        from wayfarer.views.text.summary_text import summary_text

        text = summary_text(title, found, reader.damage)
    with _until_closed():
        print(text)


@app.command(
    epilog="Exit code: 0 if every log is complete, 3 if records of one are lost, 1 if one cannot be read at all."
)
def check(
    runs: Annotated[
        list[str] | None,
        typer.Argument(metavar="RUN", help="Numbers, folders or files of runs. (default: the newest run)"),
    ] = None,
    *,
    logs: Logs = None,
) -> None:
    """Read logs completely, and report lost or damaged records."""
    from wayfarer.fieldlog.folders import find_run
    from wayfarer.views.text.verdict import judge

    folder = log_folder(logs)
    verdicts = []
    for run in [find_run(name, folder) for name in runs or ["last"]]:
        verdict = judge(run)
        verdicts.append(verdict)
        with _until_closed():
            print(f"{_titled(run)}: {verdict}")
    raise typer.Exit(max(verdict.integrity for verdict in verdicts).exit_code)


@app.command()
def export(
    run: Run = None,
    *,
    form: Annotated[ExportFormat | None, typer.Option("--format", help=FORMATS_HELP)] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Output file, for rosbag2 a folder; - is stdout. (default: here, named as the run)"
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    logs: Logs = None,
) -> None:
    """Convert a run's log to a format of other tools, as a file or, for rosbag2, a folder."""
    from wayfarer.fieldlog.folders import find_run
    from wayfarer.views.export.export import export as export_run

    found = find_run(run, log_folder(logs))
    form = _form(form, out)
    if out == STDOUT and form.output is not Output.TEXT:
        raise BadInput(f"{form} is no text for a terminal: name a file with --out, or leave it out")
    if form.needs:
        require(form.needs)
    if out == STDOUT:
        with _until_closed():
            _tell_damage(form.write(found, sys.stdout))
        return
    file = out or Path(f"{_titled(found)}.{form}")
    damage = export_run(found, form, file, overwrite=force)
    print(f"the run is in {file}")
    _tell_damage(damage)


def _form(wanted: ExportFormat | None, out: Path | None) -> ExportFormat:
    """Return the format that is wanted, or that the file's name ends in; csv for a name without an ending.

    Raises:
        BadInput: the two are not the same, or the ending is of no format and none is wanted.
    """
    ending = out.suffix.lower().removeprefix(".") if out else ""
    named = next((form for form in ExportFormat if form == ending), None)
    if wanted and named and wanted is not named:
        raise BadInput(f"--out {out} ends in .{ending}, --format is {wanted}: change one, or leave --format out")
    if ending and not (wanted or named):
        raise BadInput(f"--out {out}: a run is written as {', '.join(ExportFormat)}; end the name so, or say --format")
    return wanted or named or ExportFormat.csv


def _titled(run: Path) -> str:
    """Return the name of a run's folder, however it was given."""
    from wayfarer.fieldlog.printable import clean

    return clean(run.resolve().name)


def _damage_of(run: Path) -> Damage:
    """Return what of a run cannot be read, from its first record to its last."""
    from wayfarer.fieldlog.reader import RunReader

    reader = RunReader(run)
    for _ in reader:
        pass
    return reader.damage


def _tell_damage(damage: Damage) -> None:
    """Say what of a log could not be read, where that is anything; stdout is for the run itself."""
    from wayfarer.fieldlog.reader import Damage

    if damage != Damage():
        print(damage, file=sys.stderr)


def _tell(lines: Iterable[Line], *, flush: bool = False) -> None:
    for line in lines:
        print(_painted(str(line), line.tone.value), flush=flush)


def _painted(text: str, tone: str) -> str:
    """Give a text its colour, on a terminal whose owner wants any (no-color.org)."""
    wanted = sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return f"\x1b[{COLOURS[tone]}m{text}\x1b[0m" if wanted and tone in COLOURS else text


@contextmanager
def _until_closed() -> Iterator[None]:
    """End without an error when the output is closed, as by ``head``."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the interpreter flushes once more
