"""What a search has found, in words: the line with the best so far, a terminal's table, comments of a rover file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import Console

from wayfarer import __version__
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.tables import number_text
from wayfarer.experiments.tuning.objective import LEAST_LAYOUTS, QUANTITIES
from wayfarer.experiments.tuning.summary import DEVELOPMENT, PairedResult, TuneSummary
from wayfarer.fieldlog.wording import plural
from wayfarer.views.text.terminal_table import Column, print_in_full, table

if TYPE_CHECKING:  # a report is also read where there is no optuna
    from wayfarer.experiments.tuning.search import Search

VERDICTS = {
    "gain": "a gain: the 95 % interval does not contain 0",
    "none": "no gain: the 95 % interval contains 0",
    "loss": "a loss: the 95 % interval does not contain 0",
    "too few": f"which says nothing: fewer than {LEAST_LAYOUTS} layouts",
}


def best_so_far(search: Search) -> str:
    """Return a line: how far the search is, and the best point so far."""
    best, quantity = search.best, search.plan.quantity
    done = len(search.points) - 1
    given_up = sum(point.ended != "whole" for point in search.points[1:])
    trials = sum(len(point.rows) for point in search.points)
    faults = sum(row.outcome == "fault" for point in search.points for row in point.rows)
    told = f", {plural(faults, 'fault')}" if faults else ""
    head = f"{done} of {search.plan.proposals} points, {given_up} given up early, {trials:,} trials{told}"
    if best is search.present or best.gain is None:
        return f"{head}; none is better than the present settings"
    gained, value = quantity.sign * best.gained, quantity.mean(best.rows)
    values = ", ".join(f"{key} = {value:g}" for key, value in best.values.items())
    return (
        f"{head}; best: point {best.number}, {quantity.title} {number_text(value, quantity.decimals)} "
        f"({gained:+.{quantity.decimals}f}) with {values}"
    )


def results(summary: TuneSummary) -> list[PairedResult]:
    """Return the comparisons of a summary, that of the search first."""
    return [*([summary.development] if summary.development else []), *summary.held_out]


def verdict(summary: TuneSummary) -> Iterator[str]:
    """Yield in words what was confirmed."""
    quantity = QUANTITIES[summary.objective]
    if summary.best is None:
        yield "no point was better than the present settings: nothing to confirm, and no rover file was written"
    for each in summary.held_out:
        change = each.changes[quantity.name].text(quantity.decimals)
        yield f"held-out forests, physics {each.physics}: {quantity.title} {change}, {VERDICTS[each.verdict]}" + (
            f"; but {each.tuned_failures} of {each.trials} trials did not get out, {each.present_failures} before"
            if each.tuned_failures > each.present_failures
            else ""
        )
    yield from summary.notes


def ended(summary: TuneSummary) -> str:
    """Say how the evaluation of the points ended."""
    counts = Counter(point.ended for point in summary.points[1:])
    words = {
        "whole": "had all their trials",
        "worse": "were given up as worse",
        "failures": "had more failures than the present settings",
        "refused": "were refused: their values do not go together",
    }
    return ", ".join(f"{counts[name]} {text}" for name, text in words.items() if counts[name])


def print_summary(console: Console, summary: TuneSummary) -> None:
    """Print the table of development and held-out figures, the tuned values and the verdict; "not out" is of both."""
    if found := results(summary):
        whole, closer = (table(list(_columns(summary)), found) for _ in range(2))
        print_in_full(console, whole, [closer])
    for key, (before, after) in summary.changed.items():
        say(console, f"{key} = {after:g} (before: {before:g})")
    for line in verdict(summary):
        say(console, line)


def _columns(summary: TuneSummary) -> Iterator[Column[PairedResult]]:
    quantity = QUANTITIES[summary.objective]
    name, decimals = quantity.name, quantity.decimals
    yield Column("forests, physics", lambda each: f"{each.forests}, {each.physics}", left=True)
    yield Column("trials", lambda each: str(each.trials))
    yield Column(f"{quantity.title}\npresent", lambda each: number_text(each.changes[name].present, decimals))
    yield Column("tuned", lambda each: number_text(each.changes[name].tuned, decimals))
    yield Column("change [95 %]", lambda each: each.changes[name].text(decimals))
    yield Column("not out", lambda each: f"{each.present_failures}, {each.tuned_failures}")
    yield Column("verdict", lambda each: each.verdict if each.forests != DEVELOPMENT else "")


def evidence(summary: TuneSummary, command: str | None) -> Iterator[str]:
    """Yield the texts that stand above the tuned rover file; ``command`` is what was asked, where that is known."""
    quantity = QUANTITIES[summary.objective]
    yield f"Tuned by wayfarer {__version__} for {summary.algorithm}: {quantity.title} of {summary.rover}."
    tried = len(summary.points) - 1
    yield f"Best of {tried} points on {summary.trials} development trials; {ended(summary)}."
    if command:
        yield f"Command: {command}"
    yield from verdict(summary)
    for each in results(summary):
        where = f"{each.forests}, physics {each.physics}"
        yield f"{where}, {each.trials} trials in {plural(each.layouts, 'layout')}, tuned less present:"
        for one in QUANTITIES.values():
            if change := each.changes[one.name].text(one.decimals):
                yield f"  {one.title}: {change}"
        yield f"  trials that did not get out: {each.tuned_failures}, before {each.present_failures}"
    yield "Development figures are of the forests that the point was chosen on: only the held-out ones count."
    yield ""
