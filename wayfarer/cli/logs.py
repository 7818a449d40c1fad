"""``wayfarer logs``: list, follow, show, summarise, check, export and delete field logs."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli.help_texts import HelpCommand, HelpGroup
from wayfarer.cli.options import AsJson, LogDir, examples, log_folder, run_argument
from wayfarer.errors import BadInput
from wayfarer.export import ExportFormat
from wayfarer.export import export as export_run
from wayfarer.extras import require
from wayfarer.fieldlog.folders import find_run, newest_run, run_title
from wayfarer.logview.terminal import painted

if TYPE_CHECKING:
    from wayfarer.fieldlog.reader import Damage
    from wayfarer.logview.narrator import Line
    from wayfarer.logview.summary import LogVerdict

POLL_S = 0.3  # how long a line waits until it is shown, at most
STDOUT = Path("-")

# What became of a run or its log, by the tone in which it is shown.
TONES = {
    "running": "phase", "cut off": "warning", "unreadable": "fault",
    "COMPLETE": "good", "PARTIAL": "warning", "UNREADABLE": "fault",
}  # fmt: skip

EXAMPLES = examples(
    "wayfarer logs list",
    "wayfarer logs follow",
    "wayfarer logs summary 17",
    "wayfarer logs export 17 --format csv",
    "wayfarer logs export 17 --format gpx",
    "wayfarer logs prune --keep-mb 8000 --dry-run",
)
app = typer.Typer(cls=HelpGroup, no_args_is_help=True, suggest_commands=False, epilog=EXAMPLES)
command = partial(app.command, cls=HelpCommand)

FORMATS_HELP = f"{'; '.join(f'{form}: {form.meaning}' for form in ExportFormat)}. (default: by FILE's ending, or csv)"

Run = Annotated[
    str | None,
    run_argument("Number, folder or file of a run. (default: the newest run)"),
]


@app.callback()
def _root() -> None:
    """Read the logs of runs: what happened, what is happening, and where the rover is likely to be."""


@command("list")
def list_runs(*, log_dir: LogDir = None, as_json: AsJson = False) -> None:
    """List all runs, the newest last."""
    from wayfarer.fieldlog.clock import wall_clock
    from wayfarer.logview.listing import lines, rows
    from wayfarer.logview.terminal import print_json

    folder = log_folder(log_dir)
    found = rows(folder, wall_clock(0.0))
    if not found:
        raise BadInput(f"{folder} holds no run; give their folder with --log-dir DIR")
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    if as_json:
        print_json({"runs": found})
        return
    titles, *shown = lines(found, width)
    print(titles)
    for line, row in zip(shown, found, strict=True):
        print(painted(line, TONES.get(row.outcome, "")))


@command()
def follow(run: Run = None, *, log_dir: LogDir = None) -> None:
    """Show events as they happen, of this run and the next ones; with RUN until that run ends. Ctrl-C ends it."""
    from wayfarer.fieldlog.run_fold import RunFold
    from wayfarer.logview.narrator import RunNarrator, Verbosity
    from wayfarer.logview.summary import NO_OUTCOME
    from wayfarer.logview.tail import follow as follow_records

    folder = log_folder(log_dir)
    chosen = None if run in (None, "last") else find_run(run, folder)
    if chosen is None and newest_run(folder) is None:
        print(f"waiting for a run in {folder}", file=sys.stderr)
    followed: Path | None = None
    waits_for = "" if chosen is None else f"{NO_OUTCOME}; waiting for more (Ctrl-C ends)"

    def wait() -> None:
        nonlocal waits_for
        if waits_for:
            print(waits_for, file=sys.stderr)
            waits_for = ""
        Event().wait(POLL_S)  # there is no event loop that sleeping could hold up

    with suppress(KeyboardInterrupt):
        for path, record in follow_records(folder, chosen, wait):
            if path != followed:
                followed, fold, narrator = path, RunFold(), RunNarrator(Verbosity.STATUS)
                print(run_title(path), flush=True)
            _tell(narrator.tell(fold.add(record)), flush=True)
        if chosen is not None:
            _tell_damage(_damage_of(chosen))


@command()
def show(
    run: Run = None,
    *,
    log_dir: LogDir = None,
    ticks: Annotated[bool, typer.Option("--ticks", help="Print every control tick.")] = False,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print each line as a JSON object for scripts."),
    ] = False,
) -> None:
    """Show all events of a run, from its beginning."""
    import msgspec

    from wayfarer.fieldlog.reader import RunReader
    from wayfarer.fieldlog.run_fold import RunFold
    from wayfarer.logview.narrator import RunNarrator, Verbosity
    from wayfarer.logview.summary import NO_OUTCOME
    from wayfarer.logview.terminal import print_json

    fold, narrator = RunFold(), RunNarrator(Verbosity.TICKS if ticks else Verbosity.STATUS)
    notes = sys.stderr if as_json else sys.stdout
    reader = RunReader(find_run(run, log_folder(log_dir)))
    for record in reader:
        lines = narrator.tell(fold.add(record))
        if as_json:
            for line in lines:
                row = {"elapsed_s": line.elapsed_s, "tone": line.tone, "text": line.text}
                print_json({**row, "record": msgspec.to_builtins(record)})
        else:
            _tell(lines)
    if fold.state.ended is None:
        print(NO_OUTCOME, file=notes)
    if reader.damage:
        print(reader.damage, file=notes)


@command()
def summary(
    run: Run = None,
    *,
    log_dir: LogDir = None,
    as_json: AsJson = False,
) -> None:
    """Summarise a run: distance, duration, anomalies, and where the rover is likely to be."""
    from wayfarer.fieldlog.reader import RunReader
    from wayfarer.logview.summary import summarise, summary_text
    from wayfarer.logview.terminal import print_json

    reader = RunReader(find_run(run, log_folder(log_dir)))
    found = summarise(reader)
    title = run_title(reader.run)
    if as_json:
        print_json({"run": title, **asdict(found), "damage": reader.damage})
    else:
        print(summary_text(title, found, reader.damage))


@command(epilog="Exit code: 0 if all runs together are within the limit now, 1 if not.")
def prune(
    *,
    keep_mb: Annotated[
        float | None,
        typer.Option(metavar="MB", min=10, help="Delete the oldest runs beyond this size of all together."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be deleted.")] = False,
    log_dir: LogDir = None,
) -> None:
    """Delete the oldest runs, but never the newest, one that is being written, or one with a file keep in it."""
    from wayfarer.fieldlog.retention import prune as delete_old_runs
    from wayfarer.fieldlog.wording import plural

    if keep_mb is None:
        raise BadInput("say how much to keep: give --keep-mb MB")
    folder = log_folder(log_dir)
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; give that of the logs with --log-dir DIR")
    found = delete_old_runs(folder, keep_mb, dry_run=dry_run)
    print(*found.deleted, sep="\n", end="\n" if found.deleted else "")
    done = "would be deleted" if dry_run else "deleted"
    print(f"{plural(len(found.deleted), 'run')} {done}, {found.deleted_mb:.1f} MB; {found.left_mb:.1f} MB are left")
    if found.trouble is not None:
        print(found.trouble, file=sys.stderr)
        raise typer.Exit(1)


@command(epilog="Exit code: 0 if every log is complete, 3 if records of one are lost, 1 if one cannot be read at all.")
def check(
    runs: Annotated[
        list[str] | None,
        run_argument("Numbers, folders or files of runs. (default: the newest run)"),
    ] = None,
    *,
    log_dir: LogDir = None,
    as_json: AsJson = False,
) -> None:
    """Read logs completely, and report lost or damaged records."""
    from wayfarer.logview.summary import check_log
    from wayfarer.logview.terminal import print_json

    folder = log_folder(log_dir)
    found = [find_run(name, folder) for name in runs or ["last"]]
    verdicts = []
    for run in found:
        verdicts.append(check_log(run))
        if not as_json:
            print(f"{run_title(run)}: {painted(str(verdicts[-1]), TONES[verdicts[-1].integrity.name])}")
    if as_json:
        print_json({"logs": [_as_object(run, verdict) for run, verdict in zip(found, verdicts, strict=True)]})
    raise typer.Exit(max(verdict.integrity for verdict in verdicts).exit_code)


@command()
def export(
    run: Run = None,
    *,
    form: Annotated[ExportFormat | None, typer.Option("--format", metavar="FORMAT", help=FORMATS_HELP)] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Output file; - is stdout. (default: here, named as the run)"),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    origin: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON", help="gpx: where a run without a receiver began, degrees: 50.937,-1.397."),
    ] = None,
    log_dir: LogDir = None,
) -> None:
    """Convert a run's log to a file for other tools."""
    from wayfarer.logview.terminal import say_next

    found = find_run(run, log_folder(log_dir))
    form = _form(form, out)
    if out == STDOUT and not form.is_text:
        raise BadInput(f"{form} is not text: give a file with --out, or leave out --out")
    if form.needs:
        require(form.needs)
    if out == STDOUT:
        _tell_damage(form.write(found, sys.stdout, origin))
        return
    file = out or Path(f"{run_title(found)}.{form}")
    damage = export_run(found, form, file, overwrite=force, follow_symlink=out is not None, origin=origin)
    print(f"the export is in {file}")
    _tell_damage(damage)
    say_next("xdg-open", file)


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
        raise BadInput(
            f"--out {out}: a run is written as {', '.join(ExportFormat)}; use one of these endings, or give --format"
        )
    return wanted or named or ExportFormat.csv


def _as_object(run: Path, verdict: LogVerdict) -> dict[str, object]:
    return {"run": run_title(run), **verdict._asdict(), "integrity": verdict.integrity.name.lower()}


def _damage_of(run: Path) -> Damage:
    """Return what of a run cannot be read, from its first record to its last."""
    from wayfarer.fieldlog.reader import RunReader

    reader = RunReader(run)
    for _ in reader:
        pass
    return reader.damage


def _tell_damage(damage: Damage) -> None:
    """Say what of a log could not be read, if that is anything; stdout is for the run itself."""
    if damage:
        print(damage, file=sys.stderr)


def _tell(lines: Iterable[Line], *, flush: bool = False) -> None:
    for line in lines:
        print(painted(str(line), line.tone.value), flush=flush)
