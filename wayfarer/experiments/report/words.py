"""Texts of a campaign's report."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from wayfarer import __version__
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.measures import MEASURES, Comparison, Estimate, compare, estimate
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.paper import reported
from wayfarer.experiments.provenance import RecordedRun, facts_of
from wayfarer.experiments.report.worst_trials import ending
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.tables import sentences
from wayfarer.fieldlog.wording import plural
from wayfarer.reports.page import html
from wayfarer.simhal.faults.kinds import parse_fault

ESCAPE = (
    "Share of all trials that have escaped by a path of that length; one that was entrapped, tipped or faulty counts "
    "as not escaped at any length (a tick marks the longest of them). The percentage is where the curve ends, as in "
    "the table. A click on a name hides its curve."
)
GALLERY = (
    "Failures first, then the longest paths; each algorithm is drawn once before one is drawn again. These are "
    "therefore not typical trials but the worst. They are few, because trials.csv has no paths: each was run again for "
    "its drawing, and gave the result in trials.csv, digit for digit. Trunks and trees are to scale, north is up. "
    "Triangle: start, points to the goal; cross: end; green line: goal line."
)


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
        parts, certain = list[str](), 0
        for words, side in ((worse, -sign), (better, sign)):
            sizes = [abs(each.value) for each in changes if min(side * end for end in each.ends) > 0.0]
            if sizes:
                has = "has" if len(sizes) == 1 else "have"
                span = " to ".join(dict.fromkeys(f"{each:.{measure.decimals}f}" for each in (min(sizes), max(sizes))))
                parts.append(f"{len(sizes)} {has} {words} (by {span}{measure.points and f' {measure.points}'})")
                certain += len(sizes)
        if unclear := len(others) - certain:
            parts.append(f"{unclear} {'shows' if unclear == 1 else 'show'} no certain difference in {measure.title}")
        yield f"Of the {len(others)} others, {', '.join(parts)}."


def title(results: Results) -> str:
    """Name the page."""
    names, trials = results.plan.base.algorithms, results.plan.base.trials
    what, each = (names[0], "") if len(names) == 1 else (f"{len(names)} algorithms", " each")
    where = f" at the site {results.plan.base.site}" if results.plan.base.site else ""
    return f"{what} in {plural(trials, 'simulated forest trial')}{each}{where}"


def facts(settings: Campaign, runs: Sequence[RecordedRun] = ()) -> Iterator[tuple[str, str]]:
    """Yield how the results were made, as far as the folder says, and everything that decides them."""
    rover, forests = settings.rover, settings.forests
    yield from facts_of(runs)
    if not runs:
        yield "software", f"wayfarer {settings.version}"
    yield "trials of each algorithm", str(settings.trials)
    if settings.site:
        yield "site", settings.site
    yield "seed", str(settings.seed)
    yield "mean distance between slips", f"{settings.slip_mean_m:g} m"
    yield "path budget", f"{settings.budget_m:g} m"
    yield "rover", str(rover.name)
    yield "obstacles noticed by", str(rover.anomaly_source)
    yield "depth of the simulation", settings.depth.value
    yield "physics", settings.physics
    if settings.physics == "light":
        yield "ground", settings.ground.value
    for key, value in settings.set.items():
        yield key, f"{value[0]:g} to {value[1]:g}, drawn for each trial" if isinstance(value, tuple) else str(value)
    if settings.faults:
        yield "faults in each trial", "; ".join(str(parse_fault(each)) for each in settings.faults)
    if not settings.site:
        yield "forests", f"{forests.name}, BLAKE2b {forests.blake2b}" if forests else "generated"
    yield "algorithms", ", ".join(settings.algorithms)


def unfinished(results: Results) -> Iterator[str]:
    """Yield a paragraph that says how many trials a page shows, if some are missing."""
    if not results.finished:
        yield html.paragraph(
            f"Unfinished: {len(results.rows)} of {results.total} trials. The figures will change until all have ended."
        )


def paths_caption(results: Results) -> str:
    """Explain the figure of paths."""
    shortest_m = results.shortest_paths_m
    papers = reported(results.settings).values()
    paper = ", vermilion: the paper's (section IV)" if any("path_m" in each for each in papers) else ""
    line = f" Broken line: mean shortest path, {statistics.fmean(shortest_m):.1f} m." if shortest_m else ""
    return (
        "Path length of the successes: how many trials had which path; box with quartiles and median, whiskers to the "
        "last trial within 1.5 interquartile ranges, a ring for every trial beyond; blue diamond: mean with one "
        f"standard deviation{paper}.{line}"
    )


def trial_text(row: TrialRow, slips: int) -> str:
    """Say which trial a drawing shows, and how it ended."""
    share = ""
    if row.outcome in SUCCESSES and row.path_m and row.shortest_path_m:
        share = f", {row.path_m / row.shortest_path_m:.1f} times the shortest path"
    return (
        f"{row.algorithm}, trial {row.trial} (forest {row.forest}, noise {row.noise}): {ending(row)}{share}. "
        f"{row.anomalies} anomalies, {slips} slips."
    )


def not_drawn(version: str) -> str:
    """Say why the trials that are named next have no drawing; the table is of ``version``."""
    return (
        f"Not drawn, because their results were different when wayfarer {__version__} ran them again (the table is of "
        f"wayfarer {version}): the code or an algorithm has changed since, and a drawing would show another run."
    )
