"""``open_run`` and ``replay``: the field log of a run, on a rover or simulated."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wayfarer.extras import require
from wayfarer.fieldlog.folders import default_log_folder, find_run, run_title
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.logview.summary import RunSummary, summarise

if TYPE_CHECKING:
    from wayfarer.config.rover_file import RoverConfig
    from wayfarer.fieldlog.replay import Replay
    from wayfarer.reports.page.html import Plot


class Run:
    """A run's field log.

    ``folder`` is where it is, ``summary`` what ``wayfarer logs summary`` says of it, and ``damage`` what could not be
    read, false if all could. ``ticks`` and ``events`` read the log again, row by row, each time that they are asked
    for.

    >>> run = open_run(1, log_dir="field_logs")
    >>> run
    <Run 00001-20261128T154531Z: 14 s, log complete>
    >>> ticks = list(run.ticks)
    >>> len(ticks), list(ticks[0])[:2]
    (270, ['elapsed_s', 't_s'])
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        reader = RunReader(folder)
        self.summary: RunSummary = summarise(reader)
        self.damage: Damage = reader.damage

    def __repr__(self) -> str:
        return f"<Run {run_title(self.folder)}: {self.summary.lasted_s:.0f} s, log {self.damage}>"

    @property
    def ticks(self) -> Iterator[dict[str, Any]]:
        """A row for each control tick, with the columns of ``wayfarer logs export``: readings, decisions, duties.

        What the log says after the last tick is in one more row.
        """
        from wayfarer.export.tables import COLUMNS, table_rows

        for row in table_rows(RunReader(self.folder)):
            yield dict.fromkeys(COLUMNS) | row

    @property
    def events(self) -> Iterator[dict[str, Any]]:
        """A row for each event: ``elapsed_s`` since the beginning, ``name``, and ``text``, what happened in words."""
        from wayfarer.fieldlog.record import Event

        for record in RunReader(self.folder):
            if isinstance(record, Event):
                yield {
                    "elapsed_s": record.elapsed_s, "t_s": record.t_s, "t_wall": record.t_wall, "name": record.name,
                    "text": record.text,
                }  # fmt: skip

    def plot(self) -> Plot:
        """Return the map of the run, as ``wayfarer report`` draws it, which a notebook shows and ``save`` writes.

        It has the path by dead reckoning in the colours of what the rover did, anomalies, marks and the receiver's
        fixes; of a simulated run also the forest and the true path. Bokeh's figure is ``figures[0]``.

        Raises:
            BadInput: the log has no path.
            MissingPackage: the extra ``sim`` is not installed.
        """
        require("a plot")
        from wayfarer.reports.run import run_plot

        return run_plot(self.folder)


def open_run(run: int | str | Path = "last", *, log_dir: str | Path | None = None) -> Run:
    """Open the field log of a run, and read it once.

    If something of the log is damaged, the rest of it is given, and a warning says what is missing.

    Args:
        run: its number, its folder or the folder's name; ``"last"`` is the newest run.
        log_dir: the folder of all runs; as for the commands by default.

    Raises:
        BadInput: there is no such run, or nothing in it can be read; the text says which runs there are.

    >>> run = open_run(1, log_dir="field_logs")
    >>> run.summary.rover, run.summary.episodes > 0
    ('sim', True)
    >>> [event["text"] for event in run.events if event["name"] == "mark"]
    ['Mark: hit log']
    """
    opened = Run(_find(run, log_dir))
    if opened.damage:
        warnings.warn(f"{opened.folder}: {opened.damage}; the other records are there", stacklevel=2)
    return opened


def replay(
    run: int | str | Path | Run = "last",
    *,
    rover: str | Path | RoverConfig | None = None,
    log_dir: str | Path | None = None,
    allow_code: bool = False,
) -> Replay:
    """Run the recorded readings through the installed code, and compare each decision with the log.

    The result has ``ticks``, how many decisions were as logged, and ``difference``, the first one that was not, None
    if there is none: its ``elapsed_s``, the ``key``, what was ``logged``, and what it is ``today``.

    Args:
        run: as of ``open_run``.
        rover: settings to try, as a rover's name, its file or what ``load_rover`` returned; as logged by default.
        log_dir: as of ``open_run``.
        allow_code: import the algorithm that the log names as a file or a module: only if you trust the writer.

    Raises:
        BadInput: there is no such run, or it cannot be replayed.

    >>> replay(1, log_dir="field_logs").difference is None
    True
    """
    from wayfarer.config.rover_file import RoverConfig, load_rover
    from wayfarer.fieldlog.replay import replay as replayed

    config = rover if rover is None or isinstance(rover, RoverConfig) else load_rover(str(rover))
    folder = run.folder if isinstance(run, Run) else _find(run, log_dir)
    return replayed(folder, config, allow_code=allow_code)


def _find(run: int | str | Path, log_dir: str | Path | None) -> Path:
    return find_run(str(run), default_log_folder() if log_dir is None else Path(log_dir))
