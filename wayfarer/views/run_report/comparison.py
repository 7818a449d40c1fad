"""What two runs have in common, and in what they differ by more than runs of one rover do."""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import radians, sqrt
from typing import Any

from markupsafe import Markup

from wayfarer.views.page import html
from wayfarer.views.run_report.data import ANOMALY_KINDS, RunData
from wayfarer.views.run_report.settings import NOT_THERE
from wayfarer.views.run_report.tables import run_facts

SHARE = 0.2  # of the larger of two amounts: by so much two runs differ that nobody changed anything in
CHANCE = 2.0  # standard deviations of the difference of two counts (Poisson: the square root of their sum)
CAPTION = (
    "Bold: what differs by more than a fifth, or in a count by more than chance explains, and other outcomes, goals, "
    "conditions, failures, rovers, algorithms and versions."
)


def _place(data: RunData) -> complex | None:
    """Return where the rover was at the end by dead reckoning, metres from where that began."""
    end = data.summary.where.by_reckoning
    return None if end is None else rect(end.distance_m, radians(end.bearing_deg))


def _battery_was_low(data: RunData) -> bool | None:
    lowest = data.summary.low_battery
    return None if lowest is None else lowest.battery_v <= data.setting("board", "battery_low_v")


# What is compared of the facts with these titles: counts are whole numbers, amounts are others. The titles that are
# missing here never stand out: a seed is another one in each run, and what an operator did is no result.
COMPARED: Mapping[str, Callable[[RunData], Sequence[Any]]] = {
    "run": lambda data: (
        data.summary.rover, data.summary.algorithm, data.summary.version, data.summary.simulated, data.summary.dry_run,
    ),
    "outcome": lambda data: (data.summary.reason,),
    "where": lambda data: (_place(data),),
    "time": lambda data: (
        data.summary.lasted_s, data.summary.armed_s, set(data.summary.held_s), set(data.summary.limited_s),
    ),
    "distance": lambda data: (data.summary.commanded_m, data.summary.reckoned_m),
    "anomalies": lambda data: [data.summary.anomalies.get(kind, 0) for kind in sorted(ANOMALY_KINDS)],
    "escapes": lambda data: (data.summary.episodes, data.summary.recoveries, set(data.summary.exhausted)),
    "battery": lambda data: (_battery_was_low(data),),
    "failures": lambda data: (set(data.summary.failures), set(data.summary.sensor_failures)),
    "ticks": lambda data: (data.summary.period and data.summary.period.p50_s, data.summary.late_ticks),
    "log": lambda data: (bool(data.damage), bool(data.summary.dropped)),
    "goal": lambda data: (dict(run_facts(data, ""))["goal"],),
}  # fmt: skip


def materially_different(runs: Sequence[RunData]) -> list[str]:
    """Return the titles of the facts in which two runs differ by more than runs of the same rover do."""
    return [
        title
        for title, of_run in COMPARED.items()
        if any(_differs(first, second) for first, second in zip(*map(of_run, runs), strict=True))
    ]


def difference_text(runs: Sequence[RunData]) -> str:
    """Say in one line what differs."""
    return f"What differs: {', '.join(materially_different(runs)) or 'nothing of importance'}"


def facts_table(runs: Sequence[RunData], names: Sequence[str]) -> Markup:
    """Return the facts of two runs, one column each; those that differ materially are set in bold."""
    return html.table(CAPTION, ["", *names], _rows(runs, names))


def _rows(runs: Sequence[RunData], names: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    facts, bold = [dict(run_facts(*each)) for each in zip(runs, names, strict=True)], materially_different(runs)
    for title in dict.fromkeys(title for each in facts for title in each):
        yield "differs" if title in bold else "same", [title, *(each.get(title, NOT_THERE) for each in facts)]


def _differs(first: Any, second: Any) -> bool:
    """Return whether two values differ materially."""
    numbers = all(isinstance(each, int | float | complex) and not isinstance(each, bool) for each in (first, second))
    if not numbers:
        return bool(first != second)
    counted = isinstance(first, int) and isinstance(second, int)
    bound = CHANCE * sqrt(first + second) if counted else SHARE * max(abs(first), abs(second))
    return bool(abs(first - second) > bound)
