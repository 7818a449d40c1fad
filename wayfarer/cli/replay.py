"""``wayfarer replay``: a field log as a regression test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.cli.rover import Logs, log_folder

if TYPE_CHECKING:
    from wayfarer.replay import Replay

DIFFERS = 1
EXAMPLES = """Examples:

wayfarer replay

wayfarer replay 17 18 field_logs/00019-20261121T061405Z

wayfarer replay 17 --config my_rover.toml
"""


def replay(
    runs: Annotated[
        list[str] | None, typer.Argument(metavar="[RUN]...", help="Numbers or folders. (default: the newest run)")
    ] = None,
    *,
    config: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="Try a rover file's settings instead of those in the log."),
    ] = None,
    logs: Logs = None,
) -> None:
    """Put a run's readings through today's code: do the same decisions come out? Exit code 1 where they differ."""
    from wayfarer.config import load_rover
    from wayfarer.fieldlog.folders import find_run
    from wayfarer.replay import replay as replay_run

    settings = load_rover(config) if config else None
    folders = [find_run(run, log_folder(logs)) for run in runs or ["last"]]
    exit_code = 0
    for folder in folders:
        result = replay_run(folder, settings)
        print(told(folder, result))
        exit_code = DIFFERS if result.difference else exit_code
    raise typer.Exit(exit_code)


def told(run: Path, result: Replay) -> str:
    """Return a replay in a line."""
    so_far = f"{run.name}: {result.ticks} decisions as logged"
    if result.difference is not None:
        t_s, number, key, logged, today = result.difference
        return f"{so_far}, then at t_s {t_s:.3f} (n {number}) {key} was {_short(logged)} and is {_short(today)} today"
    if result.cut_t_s is not None:
        return f"{so_far}; records are missing before t_s {result.cut_t_s:.3f}, what follows cannot be replayed"
    return so_far


def _short(value: object) -> str:
    if isinstance(value, list):
        return " + ".join(map(str, value)) or "nothing"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
