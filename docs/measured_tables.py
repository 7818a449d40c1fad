"""Tables of results as Markdown, from the folders of campaigns, in the places that the pages have for them.

A place is between ``<!-- measured KIND: NAME... -->`` and ``<!-- end of measured -->``. It is written whole, once all
its campaigns are measured: each table with its command, its version (``trial_code``) and its time.
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
class Part:
    """A command whose results are in a folder, finished or not."""

    words: list[str]
    results: Path

    @property
    def end(self) -> Path:
        """The file for what the command prints at its end: there, and only then, it is finished."""
        return self.results.with_suffix(".json")

    @property
    def printed(self) -> Mapping[str, Any] | None:
        """What the command printed; None if it is not finished."""
        return json.loads(self.end.read_text(encoding="utf-8")) if self.end.exists() else None


@dataclass(frozen=True)
class Measured:
    """A campaign, and where its results are, finished or not: ``folder`` is that of a version.

    ``arguments`` are those of ``wayfarer``, with their number of trials unless ``other_trials`` replaces it. Of a list
    of seeds each is run apart, and the table is that of all trials.
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
    def seeds(self) -> list[str]:
        """The seeds of its parts."""
        return self.words[self.words.index("--seed") + 1].split(",") if "--seed" in self.words else ["0"]

    @property
    def parts(self) -> list[Part]:
        """The commands, one for each seed; another number of trials has another folder."""
        name = f"{self.name}-{self.words[self.words.index('--trials') + 1]}"
        if len(self.seeds) == 1:
            return [Part(self.words, self.folder / name)]
        at = self.words.index("--seed") + 1
        return [
            Part([*self.words[:at], seed, *self.words[at + 1 :]], self.folder / f"{name}-seed-{seed}")
            for seed in self.seeds
        ]

    @property
    def finished(self) -> bool:
        """Whether nothing of it is missing."""
        return all(part.end.exists() for part in self.parts)

    @property
    def cpu_s(self) -> float | None:
        """The CPU time that it took, seconds; None if it was interrupted, so that nobody knows."""
        runs = [part.printed["last_run"]["cpu_s"] for part in self.parts if part.printed]
        return sum(runs) if all(len(read_runs(part.results)) == 1 for part in self.parts) else None

    @property
    def caption(self) -> str:
        """Where the table of a finished campaign comes from."""
        _, *others = self.seeds
        also = f" and with seed {', '.join(others)}" if others else ""
        return f"`wayfarer {' '.join(self.parts[0].words)}`{also} (code {self.folder.name}, {self.took}):"

    @property
    def took(self) -> str:
        """How long it took, in words."""
        return "in several runs" if self.cpu_s is None else f"{self.cpu_s / 60:.1f} min of CPU"

    def open(self) -> Results:
        """Return the results of all parts. The layouts of different seeds are different ones."""
        first, *others = (Results.open(part.results) for part in self.parts)
        most = 1 + max(row.forest for each in (first, *others) for row in each.rows)
        for number, each in enumerate(others, start=1):
            first.rows += [row._replace(forest=row.forest + number * most) for row in each.rows]
        return first


# -- the tables, by their kind -----------------------------------------------------------------------------------------


def outcomes(campaign: Measured) -> Lines:
    """Yield the table of ``wayfarer sim``, with the paper's figures."""
    table = table_of(campaign.open())
    yield table.titles
    for kind, cells in table.rows:
        yield [f"*{cell.strip()}*" if cell else "" for cell in cells] if kind else cells


def gains(campaign: Measured) -> Lines:
    """Yield the table of ``wayfarer compare``, without the worst trials, which one seed alone can name."""
    table = comparison_table(compare(campaign.open().rows))
    yield table.titles[:-1]
    yield from (cells[:-1] for _, cells in table.rows)


def points(campaign: Measured) -> Lines:
    """Yield the table of a sweep's report, without a column of algorithms if there is one only."""
    results = Grid(campaign.open())
    first = 0 if len(results.algorithms) > 1 else 1
    yield point_titles(results)[first:]
    for name in results.algorithms:
        for cells in point_rows(results, name):
            yield [name, *cells][first:]


def limits(campaigns: Sequence[Measured]) -> Lines:
    """Yield the successes in per cent for other time limits."""
    yield ["campaign", "algorithm", *(f"{limit_s} s" for limit_s in LIMITS_S)]
    for campaign in campaigns:
        for name, rows in campaign.open().by_algorithm.items():
            times_s = [row.time_s for row in rows if row.outcome in SUCCESSES and row.time_s is not None]
            shares = [100 * sum(t_s <= limit_s for t_s in times_s) / len(rows) for limit_s in LIMITS_S]
            yield [campaign.name, name, *(f"{share:.0f}" for share in shares)]


def seeds(campaigns: Sequence[Measured]) -> Lines:
    """Yield the successes in per cent with each seed, which draws other layouts; all campaigns have the same seeds."""
    yield ["campaign", "algorithm", *(f"seed {seed}" for seed in campaigns[0].seeds)]
    for campaign in campaigns:
        found = [Results.open(part.results).by_algorithm for part in campaign.parts]
        for name in found[0]:
            shares = [100 * sum(row.outcome in SUCCESSES for row in each[name]) / len(each[name]) for each in found]
            yield [campaign.name, name, *(f"{share:.1f}" for share in shares)]


def times(campaigns: Sequence[Measured]) -> Lines:
    """Yield how long each campaign took."""
    yield ["campaign", "command", "time"]
    for each in campaigns:
        yield [each.name, f"`{each.arguments}`", each.took]


KINDS: Mapping[str, Callable[[Measured], Lines]] = {"outcomes": outcomes, "gains": gains, "points": points}
"""Those with a table for each campaign."""
TOGETHER: Mapping[str, Callable[[Sequence[Measured]], Lines]] = {"limits": limits, "seeds": seeds, "times": times}
"""Those with one table of all their campaigns; each of these has its table elsewhere."""


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
    campaigns = [finished[name] for name in names]
    if together := TOGETHER.get(place["kind"]):
        blocks = [f"Of all these trials (code {campaigns[0].folder.name}):", "\n".join(markdown(together(campaigns)))]
    else:
        table = KINDS[place["kind"]]
        blocks = ["\n".join([each.caption, "", *markdown(table(each))]) for each in campaigns]
    return "\n\n".join([f"<!-- measured {place['kind']}: {place['names']} -->", *blocks, "<!-- end of measured -->"])
