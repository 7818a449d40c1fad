"""Tables of results as Markdown, from the folders of campaigns, in the places that the pages have for them.

A place is between ``<!-- measured KIND: NAME... -->`` and ``<!-- end of measured -->``. It is written whole, once all
its campaigns are measured, each with its command, version and time: no row of an older version stays in it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from wayfarer.experiments.measures import compare
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.provenance import read_runs
from wayfarer.experiments.results import Results
from wayfarer.experiments.tables import comparison_table, table_of
from wayfarer.reports.sweep import Grid, point_rows, point_titles

PLACE = re.compile(
    r"^<!-- measured (?P<kind>\w+): (?P<names>[^\n]+) -->\n(?P<content>.*?)^<!-- end of measured -->$", re.M | re.S
)
LIMITS_S = (90, 120, 200, 300)

Lines = Iterator[Sequence[str]]  # of a table, the titles first


@dataclass(frozen=True)
class Measured:
    """A campaign, and where its results are, finished or not: ``folder`` is that of a version.

    ``arguments`` are those of ``wayfarer``, with their number of trials unless ``other_trials`` replaces it.
    """

    folder: Path
    name: str
    arguments: str
    other_trials: int | None = None

    @property
    def words(self) -> list[str]:
        """The arguments of its command."""
        words = self.arguments.split()
        if self.other_trials is not None:
            words[words.index("--trials") + 1] = str(self.other_trials)
        return words

    @property
    def command(self) -> str:
        """Its command, without where the results go."""
        return f"wayfarer {' '.join(self.words)}"

    @property
    def results(self) -> Path:
        """The folder of its results; another number of trials has another one."""
        return self.folder / f"{self.name}-{self.words[self.words.index('--trials') + 1]}"

    @property
    def end(self) -> Path:
        """The file for what the command prints at its end: there, and only then, it is finished."""
        return self.results.with_suffix(".json")

    @property
    def printed(self) -> Mapping[str, Any] | None:
        """What the command printed; None if it is not finished."""
        return json.loads(self.end.read_text(encoding="utf-8")) if self.end.exists() else None

    @property
    def caption(self) -> str:
        """Where the table of a finished campaign comes from."""
        printed, version = self.printed, Results.open(self.results).plan.base.version
        assert printed is not None, "it is finished"
        run = printed["last_run"]
        minutes = "{:.1f} min, {:.1f} min of CPU".format(*(run[key] / 60 for key in ("wall_s", "cpu_s")))
        took = minutes if len(read_runs(self.results)) == 1 else "in several runs"
        return f"`{self.command}`, version {version} ({took}):"


# -- the tables, by their kind -----------------------------------------------------------------------------------------


def outcomes(folder: Path) -> Lines:
    """Yield the table of ``wayfarer sim``, with the paper's figures."""
    table = table_of(Results.open(folder))
    yield table.titles
    for kind, cells in table.rows:
        yield [f"*{cell.strip()}*" if cell else "" for cell in cells] if kind else cells


def gains(folder: Path) -> Lines:
    """Yield the table of ``wayfarer compare``."""
    table = comparison_table(compare(Results.open(folder).rows))
    yield table.titles
    yield from (cells for _, cells in table.rows)


def points(folder: Path) -> Lines:
    """Yield the table of a sweep's report, without a column of algorithms if there is one only."""
    results = Grid(Results.open(folder))
    first = 0 if len(results.algorithms) > 1 else 1
    yield point_titles(results)[first:]
    for name in results.algorithms:
        for cells in point_rows(results, name):
            yield [name, *cells][first:]


def limits(folder: Path) -> Lines:
    """Yield the successes in per cent for other time limits."""
    results = Results.open(folder)
    yield ["algorithm", *(f"{limit_s} s" for limit_s in LIMITS_S)]
    for name, rows in results.by_algorithm.items():
        times_s = [row.time_s for row in rows if row.outcome in SUCCESSES and row.time_s is not None]
        yield [name, *(f"{100 * sum(t_s <= limit_s for t_s in times_s) / len(rows):.0f}" for limit_s in LIMITS_S)]


KINDS: Mapping[str, Callable[[Path], Lines]] = {
    "outcomes": outcomes,
    "gains": gains,
    "points": points,
    "limits": limits,
}


def markdown(lines: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield a table as Markdown, line by line."""
    for number, cells in enumerate(lines):
        yield "| {} |".format(" | ".join(cell.replace("\n", " ") for cell in cells))
        if number == 0:
            yield "|" + "---|" * len(cells)


# -- their places ------------------------------------------------------------------------------------------------------


def write_pages(pages: Path, finished: Mapping[str, Measured]) -> Iterator[Path]:
    """Write the tables of these campaigns into the pages below a folder, and yield the pages that have changed."""
    for page in sorted(pages.rglob("*.md")):
        before = page.read_text(encoding="utf-8")
        after = PLACE.sub(partial(_written, finished), before)
        if after != before:
            page.write_text(after, encoding="utf-8")
            yield page


def _written(finished: Mapping[str, Measured], place: re.Match[str]) -> str:
    names = place["names"].split()
    if not set(names) <= set(finished):
        return place[0]
    table = KINDS[place["kind"]]
    blocks = ["\n".join([finished[name].caption, "", *markdown(table(finished[name].results))]) for name in names]
    return "\n\n".join([f"<!-- measured {place['kind']}: {place['names']} -->", *blocks, "<!-- end of measured -->"])
