"""A figure: repeated measurements of one thing, and its limit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import ParamSpec

P = ParamSpec("P")


@dataclass(frozen=True, slots=True)
class Figure:
    """What was measured, in ``unit``; ``limit`` is the most that the median may be, None if there is none."""

    name: str
    unit: str
    values: Sequence[float]
    limit: float | None = None

    def row(self) -> tuple[str, ...]:
        """Return the cells of its line in the table."""
        middle = median(self.values)
        verdict = "" if self.limit is None else "met" if middle <= self.limit else "**missed**"
        limit = "" if self.limit is None else f"{self.limit:g}"
        span = f"{min(self.values):.4g} to {max(self.values):.4g}"
        return self.name, self.unit, f"{middle:.4g}", span, str(len(self.values)), limit, verdict


HEADER = ("what", "unit", "median", "min to max", "runs", "limit", "")


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a Markdown table, its columns aligned."""
    lines = [header, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, ["-" * width for width in widths])
    for line in lines:
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |")


def timed(clock: Callable[[], float], work: Callable[P, object], *args: P.args, **kwargs: P.kwargs) -> float:
    """Return how many seconds of a clock some work takes."""
    before_s = clock()
    work(*args, **kwargs)
    return clock() - before_s
