"""The results of a campaign or a sweep: what decided them, a row for each trial, and the folder that keeps both.

``campaign.json`` is written first and says whose folder this is; ``forests.jsonl`` beside it is a copy of the forest
file, if there is one, so that trials can be run again, and ``runs.json`` says how they were made (``provenance``).
While trials run, each finished one is appended to ``trials.csv``. When none is missing the file is written again, by
point, algorithm and trial. A line that a crash cut short has no newline: it does not count, and its trial is run again.

The folder may have come from somebody else: only ordinary files are read, and nothing is written through a symlink.
"""

from __future__ import annotations

import fcntl
import json
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count, product
from pathlib import Path
from typing import Any, BinaryIO, Self

from wayfarer.config.messages import shortened, shown
from wayfarer.config.own_file import split
from wayfarer.config.rover_file import flat
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.experiments.campaign import Campaign, Plan, Task
from wayfarer.experiments.provenance import RecordedRun, read_runs, record_run
from wayfarer.experiments.recorded import FORESTS, MOST_BYTES, SETTINGS, read_plan, rebuild
from wayfarer.experiments.rows import COLUMNS, TrialRow, csv_line, parse_row
from wayfarer.experiments.settings import Value
from wayfarer.fieldlog.wording import plural
from wayfarer.files import open_regular, open_to_append, read_regular, write_atomically

TRIALS = "trials.csv"
MOST_LINE_BYTES = 100_000  # far more than any row: a file without line ends must not fill the memory


class Results:
    """The results of a campaign or a sweep.

    ``plan`` has all that decided them, ``settings`` the same as ``campaign.json`` has it: the same settings give the
    same rows, on any computer and with any number of processes. ``rows`` are named tuples, as ``Trial.row``. ``swept``
    has the values of the swept keys at each point, the last key varying fastest; a campaign is one point. ``columns``
    are those of ``trials.csv``: in a sweep the point and the swept keys come first, keys that are drawn last.
    """

    def __init__(self, plan: Plan, rows: Sequence[TrialRow] = (), folder: Path | None = None) -> None:
        self.plan = plan
        self.rows = list(rows)
        self.folder = folder
        keys = [axis.key for axis in plan.axes]
        points = product(*(axis.values for axis in plan.axes))  # of a campaign: one, without any value
        self.swept: list[dict[str, Value]] = [dict(zip(keys, values, strict=True)) for values in points]
        self.columns = (*(["point", *keys] if keys else []), *COLUMNS, *plan.base.ranges)
        self._file: int | None = None  # where rows are appended

    def __repr__(self) -> str:
        trials = plural(self.total, "trial") if self.finished else f"{len(self.rows)} of {self.total} trials"
        return f"<Results: {trials} of {', '.join(self.plan.base.algorithms)}>"

    @property
    def settings(self) -> dict[str, Any]:
        """All that decided the results, as ``campaign.json`` has it."""
        return self.plan.settings()

    @property
    def total(self) -> int:
        """How many trials there are when none is missing."""
        base = self.plan.base
        return len(base.algorithms) * base.trials * len(self.swept)

    @property
    def finished(self) -> bool:
        """Whether no trial is missing."""
        return len(self.rows) == self.total

    @property
    def cells(self) -> dict[tuple[int, str], list[TrialRow]]:
        """The rows of each algorithm, in a sweep at each point; none for one of which no trial has ended."""
        found: dict[tuple[int, str], list[TrialRow]] = {}
        for row in self.in_order():
            found.setdefault((row.point, row.algorithm), []).append(row)
        return found

    @property
    def by_algorithm(self) -> dict[str, list[TrialRow]]:
        """The rows of each algorithm of a campaign that has any, in the campaign's order."""
        return {name: rows for (_, name), rows in self.cells.items()}

    @property
    def shortest_paths_m(self) -> list[float]:
        """The shortest path of each trial, metres, as far as they are known."""
        return [row.shortest_path_m for row in self.rows if row.shortest_path_m]

    def in_order(self) -> list[TrialRow]:
        """Return the rows in the order of a finished ``trials.csv``: by point, algorithm as asked, and number."""
        place = {name: number for number, name in enumerate(self.plan.base.algorithms)}
        return sorted(self.rows, key=lambda row: (row.point, place.get(row.algorithm, len(place)), row.trial))

    def missing(self) -> list[Task]:
        """Return the trials that have no row, in the order of running: a forest serves all algorithms of a point."""
        base, points, done = self.plan.base, range(len(self.swept)), {row.key for row in self.rows}
        return [
            task for trial in range(base.trials) for point in points for name in base.algorithms
            if (task := Task(name, trial, point)) not in done
        ]  # fmt: skip

    @property
    def trials(self) -> list[dict[str, Any]]:
        """A row for each trial, with the columns of ``trials.csv``; those of a sweep begin with the swept values.

        Paths are in metres, times in simulated seconds, ``spl`` is 0 to 1, and ``outcome`` is ``escaped``,
        ``left_bounds``, ``entrapped``, ``tipped`` or ``fault``. What is not known is None.
        """
        all_values = (row.cells() | self.swept[row.point] for row in self.rows)
        return [{name: values[name] for name in self.columns} for values in all_values]

    @property
    def kind(self) -> str:
        """What errors call it: ``sweep`` or ``campaign``."""
        return "sweep" if self.plan.axes else "campaign"

    # -- the folder ----------------------------------------------------------------------------------------------------

    @classmethod
    def open(cls, folder: Path, *, unfinished: bool = False) -> Self:
        """Read what a folder holds; ``unfinished`` also if trials are missing.

        Raises:
            BadInput: no such folder, no campaign or sweep in it, not finished, or damaged; the text says what to do.
        """
        if not folder.is_dir():
            raise BadInput(f"{folder}: no such folder; give one that `wayfarer sim --out` has filled")
        if not (folder / SETTINGS).exists():
            raise BadInput(f"{folder} holds no campaign: {SETTINGS} is missing; give a folder of `wayfarer sim --out`")
        results = cls(read_plan(folder), folder=folder)
        try:
            with open_regular(folder / TRIALS) as file:
                results._read(file)
        except FileNotFoundError:
            pass  # it was stopped before its first trial
        except OSError as error:
            raise BadInput(f"{folder / TRIALS}: cannot be read: {error.strerror}") from None
        if not (results.finished or unfinished):
            command = "sweep" if results.plan.axes else "sim"
            raise BadInput(
                f"{folder}: its {results.kind} is not finished, it has {len(results.rows)} of {results.total} trials; "
                f"repeat its `wayfarer {command}` and add --resume to finish it first"
            )
        results.rows = results.in_order()
        return results

    @classmethod
    @contextmanager
    def kept(
        cls,
        plan: Plan,
        folder: Path | None,
        *,
        resume: bool = False,
        forests: bytes | None = None,
        command: Sequence[str] | None = None,
        notice: Callable[[str], object] = warnings.warn,
    ) -> Iterator[Self]:
        """Give results that a folder keeps while they come, locked meanwhile; without a folder they are in memory only.

        Args:
            plan: what is to be run.
            folder: new or empty; with ``resume`` the rows that are in it come first.
            resume: continue what is in the folder.
            forests: content of the campaign's forest file, of which the folder keeps a copy.
            command: the command line, which is noted if anything is missing.
            notice: gets a sentence if nothing keeps another campaign out.

        Raises:
            BadInput: the folder is not empty and not to be resumed, belongs to another campaign, is in use, damaged or
                cannot be written.
        """
        results = cls(plan, folder=folder)
        if folder is None:
            yield results
            return
        with ExitStack() as open_files:
            with _one_line_errors(folder):
                folder.mkdir(parents=True, exist_ok=True)
                open_files.callback(os.close, _locked(folder, results.kind, notice))
                results._claim(folder, resume)
                if forests is not None:
                    write_atomically(folder / FORESTS, forests)
                file = open_files.enter_context(open_to_append(folder / TRIALS))
                end = results._read(file)
                os.truncate(file.fileno(), end)  # nothing of a torn line may stay behind the next one
                os.lseek(file.fileno(), end, os.SEEK_SET)
                results._file = file.fileno()
                if not end:
                    results._write(csv_line(results.columns))
                if not results.finished or results.rows != results.in_order():
                    record_run(folder, command)
            yield results

    def add(self, row: TrialRow) -> None:
        """Keep a finished trial, safe from a crash of this process.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        if self._file is not None:
            with self._writing():
                self._write(self._line(row))
        self.rows.append(row)

    def finish(self) -> None:
        """Put all rows into their final order, also in the folder.

        Raises:
            WayfarerError: the folder cannot be written any more.
        """
        rows = self.in_order()
        if self.folder is not None and rows != self.rows:
            table = "".join([csv_line(self.columns), *map(self._line, rows)])
            with self._writing():
                write_atomically(self.folder / TRIALS, table.encode())
        self.rows = rows

    def _line(self, row: TrialRow) -> str:
        return csv_line(self.columns, row, self.swept[row.point])

    def _write(self, line: str) -> None:
        """Write a line at once: a buffer would try again when it is closed, on a disk that is still full."""
        assert self._file is not None
        rest = line.encode()
        while rest:
            rest = rest[os.write(self._file, rest) :]

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise WayfarerError(
                f"{self.folder} cannot be written any more: {error.strerror or error}; fix that, then use --resume"
            ) from error

    def _claim(self, folder: Path, resume: bool) -> None:
        """Make the folder this plan's.

        Raises:
            BadInput: it is not empty, or belongs to another one, or to another version's; the text names the first
                difference.
        """
        if not any(folder.iterdir()):
            write_atomically(folder / SETTINGS, (json.dumps(self.settings, indent=2, allow_nan=False) + "\n").encode())
            return
        if not resume:
            raise BadInput(f"{folder} is not empty; give a new folder, or add --resume to continue what is in it")
        here = _by_name(json.loads(json.dumps(self.settings)))
        try:
            there = _by_name(json.loads(read_regular(folder / SETTINGS, MOST_BYTES)))
        except (OSError, ValueError, AttributeError, TypeError, RecursionError):
            raise BadInput(
                f"{folder} cannot be resumed: it holds no campaign ({SETTINGS} is missing or damaged)"
            ) from None
        for name in (*here, *there):
            if here.get(name) != there.get(name):
                if name.startswith("files.") and name.endswith(".blake2b") and there.get(name) and here.get(name):
                    file = Path(split(name[len("files.") : -len(".blake2b")])[0]).name
                    raise BadInput(f"{folder}: {file} has changed since; restore it, or give another folder")
                raise BadInput(
                    f"{folder} belongs to another {self.kind}: {shortened(name)} is {shown(there.get(name))} there and "
                    f"{shown(here.get(name))} here; repeat its settings, or give another folder"
                )

    def _read(self, file: BinaryIO) -> int:
        """Read the rows of an open ``trials.csv``, and return where its last whole line ends.

        A last line that a crash cut short is left out, also if it is the first one.

        Raises:
            BadInput: the file has other columns, a line is not a row of these trials, or a trial is there twice; the
                text says in which line.
        """
        name, base, points = f"{self.folder}/{TRIALS}", self.plan.base, self.swept
        header, first = csv_line(self.columns).encode(), file.readline(MOST_LINE_BYTES)
        if first != header and header.startswith(first):
            return 0
        if first != header:
            raise BadInput(
                f"{name} is damaged, or was written by another version: its first line does not name its columns; "
                "run the trials again into another folder"
            )
        rows: dict[tuple[str, int, int], TrialRow] = {}
        end = len(header)
        for number in count(2):
            line = file.readline(MOST_LINE_BYTES)
            if not line.endswith(b"\n") and len(line) < MOST_LINE_BYTES:
                break
            row = parse_row(line, self.columns, f"{name}, line {number}", points[0])
            which = f"trial {row.trial} of {shown(row.algorithm)}"
            if row.algorithm not in base.algorithms or row.trial >= base.trials or row.point >= len(points):
                at = f" at point {row.point}" if row.point else ""
                raise BadInput(f"{name}, line {number} is damaged: there is no {which}{at}; remove the line")
            if rows.setdefault(row.key, row) is not row:
                raise BadInput(f"{name}, line {number} is damaged: it is a second row of {which}; remove one of them")
            end += len(line)
        self.rows = list(rows.values())
        return end

    @property
    def runs(self) -> list[RecordedRun]:
        """How the results were made, as far as their folder says."""
        return read_runs(self.folder) if self.folder else []

    def rebuild(self, *, allow_code: bool = False) -> Campaign:
        """Return the campaign, so that its trials can be run again; see ``recorded.rebuild``."""
        return rebuild(self.plan.base, self.folder or Path(), allow_code=allow_code)


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    try:
        if path.is_file():
            raise BadInput(f"{path} is a file; the output needs a new or empty folder")
        yield
    except OSError as error:
        where = error.filename or path
        raise BadInput(f"{where} cannot be used for the output: {error.strerror or error}") from error


def _locked(path: Path, kind: str, notice: Callable[[str], object]) -> int:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise BadInput(f"{path} is in use by another {kind}; wait for it, or give another folder") from None
    except OSError as error:  # some network filesystems have no locks
        notice(f"{path} cannot be locked ({error.strerror or error}): let no other {kind} write into it meanwhile")
    return descriptor


def _by_name(settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings by their dotted names, those of a sweep's axes by their numbers too.

    Of the version only the release counts: a commit between two releases does not end a campaign.
    """
    named = flat(settings | {"axes": dict(enumerate(settings.get("axes", ()), start=1))})
    return named | {"version": str(named.get("version")).partition("+")[0]}
