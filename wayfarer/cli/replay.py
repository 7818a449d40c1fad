"""``wayfarer replay``: recorded readings through the installed code, as a regression test."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli.options import AllowCode, AsJson, LogDir, examples, log_folder, rover_option, run_argument
from wayfarer.errors import BadInput
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.fieldlog.folders import find_run, run_title

if TYPE_CHECKING:
    from wayfarer.fieldlog.replay import Replay

# As wayfarer logs check: something is lost, so that not all of the run was compared.
DIFFERS, BAD_INPUT, CUT = 1, 2, 3
EXAMPLES = examples(
    "wayfarer replay",
    "wayfarer replay 17 18 field_logs/00019-20261121T061405Z",
    "wayfarer replay 17 --rover my_rover.toml",
)


def replay(
    runs: Annotated[
        list[str] | None,
        run_argument("Numbers or folders. (default: the newest run)"),
    ] = None,
    *,
    rover: Annotated[
        str | None,
        rover_option("Use the settings of this rover file instead of those in the log."),
    ] = None,
    allow_code: AllowCode = False,
    log_dir: LogDir = None,
    as_json: AsJson = False,
) -> None:
    """Run recorded readings through the installed code, and compare the decisions with the log.

    Exit code: 0 if all are the same, 1 if one differs, 3 if records are missing, 2 if a run cannot be replayed.
    """
    from wayfarer.config.rover_file import load_rover
    from wayfarer.fieldlog.replay import replay as replay_run
    from wayfarer.logview.terminal import painted, print_json

    settings = load_rover(rover) if rover else None
    folders = [find_run(run, log_folder(log_dir)) for run in runs or ["last"]]
    codes, replays = set(), []
    for folder in folders:
        try:
            result = replay_run(folder, settings, allow_code=allow_code)
        except BadInput as error:
            codes.add(BAD_INPUT)
            print("wayfarer:", escape_control_chars(str(error)), file=sys.stderr)
            continue
        replays.append({"run": run_title(folder), **result._asdict()})
        if not as_json:
            tone = "fault" if result.difference else "warning" if result.cut_elapsed_s is not None else "good"
            print(painted(replay_text(folder, result), tone))
        codes.add(DIFFERS if result.difference else CUT if result.cut_elapsed_s is not None or not result.ticks else 0)
    if as_json:
        print_json({"runs": replays})
    raise typer.Exit(next(code for code in (BAD_INPUT, DIFFERS, CUT, 0) if code in codes))


def replay_text(run: Path, result: Replay) -> str:
    """Return a replay in a line."""
    from wayfarer.fieldlog.wording import plural

    so_far = f"{run_title(run)}: {plural(result.ticks, 'decision')} as logged"
    if result.difference is not None:
        elapsed_s, number, key, *values = result.difference
        logged, today = map(_short, values) if _short(values[0]) != _short(values[1]) else map(repr, values)
        return f"{so_far}, then at {_moment(elapsed_s)}, n {number}, {key} was {logged} and is {today} today" + (
            f"; {result.changed_file} is not the file that was logged" if result.changed_file else ""
        )
    if result.cut_elapsed_s is not None:
        return f"{so_far}; records are missing before {_moment(result.cut_elapsed_s)}, what follows cannot be replayed"
    return so_far


def _moment(elapsed_s: float) -> str:
    """Return a moment as ``wayfarer logs show`` has it, and as exports have it."""
    from wayfarer.fieldlog.clock import duration_text

    return f"{duration_text(elapsed_s, 2)} (elapsed_s {elapsed_s:.3f})"


def _short(value: object) -> str:
    if isinstance(value, list | tuple):
        return " + ".join(map(str, value)) or "nothing"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
