"""The tables of results, as texts: a terminal prints them, a page shows the same ones."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from wayfarer.errors import BadInput
from wayfarer.experiments.measures import (
    COMPARED,
    MEASURES,
    METHODS,
    WHAT_COUNTS,
    Comparison,
    Estimate,
    compare,
    estimate,
)
from wayfarer.experiments.paper import Reported, reported
from wayfarer.experiments.results import Results
from wayfarer.fieldlog.wording import plural
from wayfarer.logview.terminal_table import TextTable

INTERVAL = "[95 %]"
NO_SPL = "No SPL: the shortest paths are not known; run the trials with --spl."


class Shown(NamedTuple):
    """A measure as a column: with its interval in a terminal too, and when there is such a column.

    ``if_known``: some row has a value; ``if_any``: some value is not 0; ``beside_paper``: the paper has figures;
    ``on_page``: never in a terminal, which is too narrow for all.
    """

    name: str
    interval: bool = False
    when: Literal["always", "if_known", "if_any", "beside_paper", "on_page"] = "always"


FOREST_COLUMNS = (
    Shown("success_percent", interval=True),
    Shown("left_bounds_percent"),
    Shown("entrapped_percent"),
    Shown("tipped_percent", when="if_any"),
    Shown("fault_percent", when="if_any"),
    Shown("path_m", interval=True),
    Shown("path_sd_m", when="beside_paper"),
    Shown("path_median_m", when="on_page"),
    Shown("spl", when="if_known"),
    Shown("time_s"),
    Shown("anomalies", when="on_page"),
)
SITE_COLUMNS = (
    Shown("success_percent", interval=True),
    Shown("entrapped_percent"),
    Shown("fault_percent", when="if_any"),
    Shown("escape_s", interval=True),
    Shown("escape_sd_s", when="beside_paper"),
    Shown("interventions"),
    Shown("overturned", when="on_page"),
    Shown("off_wheels", when="on_page"),
    Shown("path_m"),
    Shown("spl", when="if_known"),
    Shown("anomalies", when="on_page"),
)
SWEEP_COLUMNS = (
    Shown("success_percent", interval=True),
    Shown("spl", when="if_known"),
    Shown("path_m"),
    Shown("escape_s"),
    Shown("left_bounds_percent", when="if_any"),
    Shown("interventions", when="if_known"),
)


def table_of(results: Results, *, full: bool = False) -> TextTable:
    """Return the table of a campaign or a sweep that has any rows; ``full`` with all intervals, for a page.

    A row is about an algorithm, in a sweep at one point. The paper's figures are below those of a campaign.
    """
    plan = results.plan
    # A word a line: two long keys must fit 80 columns.
    names = ["algorithm", *(axis.key.rpartition(".")[2].replace("_", "\n") for axis in plan.axes)]
    groups = sorted(results.cells.items(), key=lambda group: plan.base.algorithms.index(group[0][1]))
    lines = [((name, *map(str, results.swept[at].values())), rows) for (at, name), rows in groups]
    columns = SWEEP_COLUMNS if plan.axes else FOREST_COLUMNS if plan.base.site is None else SITE_COLUMNS
    papers = {} if plan.axes else reported(results.settings)
    found = [{each.name: estimate(rows, MEASURES[each.name]) for each in columns} for _, rows in lines]
    shown = [each for each in columns if _has_column(each, [row[each.name] for row in found], papers, full=full)]
    methods = [row[each.name] for row in found for each in shown if full or each.interval]
    table = []
    for (labels, _), estimates in zip(lines, found, strict=True):
        table.append(("", [*labels, *(_cell(each, estimates[each.name], full=full) for each in shown)]))
        paper = papers.get(labels[0], {})
        cells = [f"{paper[s.name]:.{MEASURES[s.name].decimals}f}" if s.name in paper else "" for s in shown]
        if any(cells):
            table.append(("paper", ["  paper", *labels[1:], *cells]))
    most = max(lines, key=lambda line: len(line[1]))[1]
    notes = [f"{plural(len(most), 'trial')} in {plural(len({row.forest for row in most}), 'layout')} for each row."]
    notes += [WHAT_COUNTS, methods_note(methods)]
    if papers:
        notes.append("SD: of the trials. The paper's figures are from its trials: 1,000 in a forest, ten at a site.")
    if not any(row.get("spl") for row in found):
        notes.append(NO_SPL)
    titles = (*names, *(_title(each, interval=full or each.interval) for each in shown))
    return TextTable(titles, table, [note for note in notes if note], len(names))


# -- sweeps ------------------------------------------------------------------------------------------------------------


def layouts_of_points(results: Results) -> list[object]:
    """Return for each point of a sweep what its layouts depend on: two points with the same met the same layouts.

    In forests all points meet the same trunks with the same noise. At a site a way is kept open for the rover, so one
    that is wider or longer than both of the paper's rovers gets other layouts.
    """
    points, campaign = results.swept, results.settings
    if campaign["site"] is None:
        return [None] * len(points)
    from wayfarer.experiments.keys import BODY, FOOTPRINT
    from wayfarer.simhal.world.sites import WIDEST

    sizes: list[object] = []
    for point in points:
        body = {key: campaign["rover"]["vehicle"][key.partition(".")[2]] for key in BODY}
        values = {**campaign["set"], **point}
        body |= dict.fromkeys(BODY, values[FOOTPRINT]) if FOOTPRINT in values else values
        length_m, width_m = (max(body[key]) if isinstance(body[key], list) else body[key] for key in BODY)
        sizes.append((max(length_m, WIDEST.length_m), max(width_m, WIDEST.width_m)))
    return sizes


def layouts_note(results: Results) -> str:
    """Say which points of a sweep met the same layouts."""
    groups: dict[object, list[str]] = {}
    for layouts, point in zip(layouts_of_points(results), results.swept, strict=True):
        groups.setdefault(layouts, []).append(", ".join(f"{key}={value}" for key, value in point.items()))
    if len(groups) == 1:
        return "All points met the same layouts with the same noise, so they can be compared trial by trial."
    return (
        "A rover of another size met other layouts of the site. Only points with equal layouts are compared in pairs: "
        f"{'; '.join(' and '.join(group) for group in groups.values())}."
    )


# -- comparisons -------------------------------------------------------------------------------------------------------


def comparison_table(algorithms: Sequence[Comparison]) -> TextTable:
    """Return the table of ``wayfarer compare``: how each algorithm differs from the first one, and its worst trial."""
    base, *others = algorithms
    shown = [each for each in COMPARED if any(one.changes[each.name] for one in others)]
    changes = [f"{each.title} change\n{each.points} {INTERVAL}".replace("\n ", "\n") for each in shown]
    rows = []
    for one in algorithms:
        found = [(one.changes.get(each.name), each.decimals) for each in shown]
        cells = ["" if change is None else change.text(decimals, "+") for change, decimals in found]
        rows.append(("", [one.algorithm, *cells, f"{one.worst.forest}/{one.worst.noise}"]))
    notes = [
        f"Change: against {base.algorithm}, mean over pairs of the same forest and noise; path: pairs in which both "
        "got out, a shorter path is negative. Worst: a failed trial, else the longest path.",
        methods_note([change for one in others for change in one.changes.values()]),
    ]
    if not any(row.counted_spl is not None for one in algorithms for row in one.rows):
        notes.append(NO_SPL)
    return TextTable(("algorithm", *changes, "worst trial\nforest/noise"), rows, notes)


def sentences(algorithms: Sequence[Comparison]) -> Iterator[str]:
    """Yield in words how each algorithm differs from the first one."""
    base, *others = algorithms
    for one in others:
        parts = [_in_words(each.name, change) for each in COMPARED if (change := one.changes[each.name])]
        yield f"{one.algorithm} against {base.algorithm}: {'; '.join(parts) or 'no pair to compare'}"


def unfinished(results: Results) -> str:
    """Say how many trials there are, if some are missing; else nothing."""
    if results.finished:
        return ""
    return f"Unfinished: {len(results.rows)} of {results.total} trials. The figures will change until all have ended."


def result_sentences(results: Results) -> Iterator[str]:
    """Yield the result in words: the best algorithm's figures with their intervals, and how the others differ from it.

    The best is the one with the highest SPL, without shortest paths the one with the most successes, then the shortest
    path.
    """
    found = {
        name: {each: estimate(rows, MEASURES[each]) for each in ("success_percent", "path_m", "spl", "escape_s")}
        for name, rows in results.by_algorithm.items()
        if rows
    }

    def quality(name: str) -> tuple[float, float, float]:
        success, path, spl = (each.value if (each := found[name][key]) else 0.0 for key in list(found[name])[:3])
        return spl, success, -path

    best = max(found, key=quality)
    rows, own = results.by_algorithm[best], found[best]
    figures = [f"got out in {_with_interval(own['success_percent'], 1)} % of {plural(len(rows), 'trial')}"]
    if own["path_m"]:
        figures.append(f"on paths of {_with_interval(own['path_m'], 1)} m")
    if results.plan.base.site and own["escape_s"]:
        figures.append(f"after {_with_interval(own['escape_s'], 1)} s")
    if own["spl"]:
        figures.append(f"with an SPL of {_with_interval(own['spl'], 3)}")
    yield f"{best} {', '.join(figures)} (95 % intervals)."
    if len(found) > 1:
        try:
            base, *others = compare(results.rows, best)
        except BadInput:
            return
        if len(others) == 1:
            yield from (f"{sentence}." for sentence in sentences([base, *others]))
        else:
            yield " ".join(_differences(others, "spl" if own["spl"] else "path_m"))


def _with_interval(found: Estimate | None, decimals: int) -> str:
    return found.text(decimals) if found else "unknown"


def _differences(others: Sequence[Comparison], second: str) -> Iterator[str]:
    """Yield how many others are worse or better by a measure, for certain by its interval, and by how much."""
    for name, worse, better in (
        ("success_percent", "a lower success", "a higher success"),
        (second, *(("a lower SPL", "a higher SPL") if second == "spl" else ("a longer path", "a shorter path"))),
    ):
        measure = MEASURES[name]
        changes = [change for one in others if (change := one.changes[name])]
        sign = 1.0 if measure.better == "more" else -1.0
        parts = list[tuple[int, str]]()
        for words, side in ((worse, -sign), (better, sign)):
            sizes = [abs(each.value) for each in changes if min(side * end for end in each.ends) > 0.0]
            if sizes:
                has = "has" if len(sizes) == 1 else "have"
                span = " to ".join(dict.fromkeys(f"{each:.{measure.decimals}f}" for each in (min(sizes), max(sizes))))
                parts.append((len(sizes), f"{has} {words} (by {span}{measure.points and f' {measure.points}'})"))
        if unclear := len(others) - sum(count for count, _ in parts):
            shows = "shows" if unclear == 1 else "show"
            parts.append((unclear, f"{shows} no certain difference in {measure.title}"))
        if len(parts) == 1:
            yield f"The {len(others)} others {parts[0][1]}."
        else:
            yield f"Of the {len(others)} others, {', '.join(f'{count} {words}' for count, words in parts)}."


def _in_words(name: str, change: Estimate) -> str:
    """Say a difference without a sign, and its interval in the same direction: below 0 is the other one."""
    measure = MEASURES[name]
    less, more = ("shorter", "longer") if name == "path_m" else ("lower", "higher")
    unit, pairs = measure.points and f" {measure.points}", plural(change.trials, "pair")
    if change.method == "no pair differs":
        return f"{measure.title} the same in {pairs} (at most {change.high:.{measure.decimals}f}{unit} either way)"
    sign = -1.0 if change.value < 0.0 else 1.0
    value, *ends = (sign * end for end in change[:3] if end is not None)
    text = f"{measure.title} {value:.{measure.decimals}f}{unit} {less if sign < 0.0 else more}"
    interval = ", ".join(f"{end:.{measure.decimals}f}" for end in sorted(ends))
    return f"{text}{interval and f' [{interval}]'} ({pairs})"


def methods_note(found: Sequence[Estimate | None]) -> str:
    """Return how the intervals among these were made."""
    used = {each.method for each in found if each}
    ways = "; ".join(text for name, text in METHODS.items() if name in used and text)
    return f"95 % intervals: {ways}." if ways else ""


def _has_column(shown: Shown, found: Sequence[Estimate | None], papers: Reported, *, full: bool) -> bool:
    if shown.when == "beside_paper":
        return bool(papers) or full
    if shown.when == "always":
        return True
    if shown.when == "on_page":
        return full and any(found)
    return any(each and (each.value or shown.when == "if_known") for each in found)


def _title(shown: Shown, *, interval: bool) -> str:
    measure = MEASURES[shown.name]
    below = [measure.unit, INTERVAL if interval and measure.kind != "sd" else ""]
    lines = [*textwrap.wrap(measure.title, 9, break_long_words=False), " ".join(filter(None, below))]
    return "\n".join(filter(None, lines))


def _cell(shown: Shown, found: Estimate | None, *, full: bool) -> str:
    if found is None:
        return ""
    decimals = MEASURES[shown.name].decimals
    return found.text(decimals) if full or shown.interval else f"{found.value:.{decimals}f}"
