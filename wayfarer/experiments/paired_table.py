"""The table of ``wayfarer compare``: how each algorithm differs from one of them, and how it can fail."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Console

from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.paired_statistics import Comparison, Difference
from wayfarer.experiments.statistics import Estimate
from wayfarer.experiments.tables import number_text, spl_hint
from wayfarer.logview.terminal_table import Column, known, print_in_full, table

LEGEND = """change: against the baseline, mean over pairs of the same forest and noise
[95 %]: of changes by bootstrap of {} layouts, of shares exact
path: pairs in which both escaped; a shorter path is negative
worst: a failed trial, else the longest path"""


SMALLEST_P = 0.001  # 4,000 resamples tell 0.0005 at best


def print_comparison(console: Console, algorithms: Sequence[Comparison]) -> None:
    """Print one table, or where the console is too narrow for it gains and outcomes below each other."""
    whole, *parts = (
        table(known(columns, algorithms), algorithms)
        for columns in (COLUMNS, (NAME_COLUMN, *GAIN_COLUMNS), (NAME_COLUMN, *OUTCOME_COLUMNS))
    )
    print_in_full(console, whole, parts)
    console.print(LEGEND.format(algorithms[0].layouts), highlight=False, soft_wrap=True)
    if hint := spl_hint(algorithms):
        console.print(hint, highlight=False, soft_wrap=True)
    console.print()
    for sentence in sentences(algorithms):
        console.print(sentence, highlight=False, markup=False)


def sentences(algorithms: Sequence[Comparison]) -> Iterator[str]:
    """Yield in words how each algorithm differs from the first one."""
    base, *others = algorithms
    for one in others:
        success = one.success_gain if one.success_gain and one.success_gain.estimate.value else None
        parts = [
            _in_words(success, "success", (" %-points lower", " %-points higher"), 1),
            _in_words(one.path_gain_m, "path", (" m shorter", " m longer"), 1),
            _in_words(one.spl_gain, "SPL", (" lower", " higher"), 3),
        ]
        told = "; ".join(part for part in parts if part) or "no pair to compare"
        yield f"{one.algorithm} against {base.algorithm}: {told}"


def _in_words(gain: Difference | None, what: str, less_and_more: tuple[str, str], decimals: int) -> str:
    """Say a difference without a sign, and its interval in the same direction: below 0 is the other one."""
    if gain is None:
        return ""
    mean, low, high = gain.estimate
    if mean < 0.0:
        shown, word = Estimate(-mean, 0.0 - high, 0.0 - low), less_and_more[0]
    else:
        shown, word = gain.estimate, less_and_more[1]
    value, *ends = (f"{part:.{decimals}f}" for part in shown)
    p = f"p = {gain.p:.3f}" if gain.p >= SMALLEST_P else f"p < {SMALLEST_P}"
    return f"{what} {value}{word} [{', '.join(ends)}], {p} ({gain.pairs} pairs)"


def _gain(gain: Difference | None, decimals: int) -> str:
    return "" if gain is None else gain.estimate.text(decimals, "+")


def _share(share: Estimate, decimals: int) -> str:
    return Estimate(*(100 * part for part in share)).text(decimals)


def _worst(one: Comparison) -> str:
    row = one.worst
    what = row.outcome if row.outcome not in SUCCESSES or row.path_m is None else f"{row.path_m:.0f} m"
    return f"{what}, {row.forest}/{row.noise}"


NAME_COLUMN: Column[Comparison] = Column("algorithm", lambda one: one.algorithm, left=True)
GAIN_COLUMNS: tuple[Column[Comparison], ...] = (
    Column("trials", lambda one: str(one.trials)),
    Column("success change\n%-points [95 %]", lambda one: _gain(one.success_gain, 1), wraps=True, if_known=True),
    Column("SPL", lambda one: number_text(one.spl, 3), if_known=True),
    Column("SPL change\n[95 %]", lambda one: _gain(one.spl_gain, 3), wraps=True, if_known=True),
    Column("path change, m\n[95 %]", lambda one: _gain(one.path_gain_m, 1), wraps=True),
)
OUTCOME_COLUMNS: tuple[Column[Comparison], ...] = (
    Column("entrapped %\n[95 %]", lambda one: _share(one.entrapped, 2)),
    Column("left the map %\n[95 %]", lambda one: _share(one.left_bounds, 1)),
    Column("worst\nforest/noise", _worst),
)
COLUMNS = (NAME_COLUMN, *GAIN_COLUMNS, *OUTCOME_COLUMNS)
