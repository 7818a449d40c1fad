"""Tables: why trials failed, and in which layouts most of them did, counted over all trials of a campaign."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from math import inf

from wayfarer.experiments.outcome import SUCCESSES, TIME_PER_BUDGET_S_PER_M
from wayfarer.experiments.report.load_results import CampaignResults, CampaignSettings
from wayfarer.experiments.rows import TrialRow
from wayfarer.fieldlog.wording import plural
from wayfarer.views.page import html

PATH, TIME, GAVE_UP = "path budget\nused up", "time\nused up", "ended its mission\nby itself"
TIPPED, DISARMED, ERROR = "tipped\nover", "disarmed\nby a fault", "error in\nthe trial"
CAUSES = (PATH, TIME, GAVE_UP, TIPPED, DISARMED, ERROR)
MOST_LAYOUTS = 10
ALL = "all"


def cause_of(row: TrialRow, settings: CampaignSettings) -> str | None:
    """Return why a trial failed, one of ``CAUSES``, as far as its row tells; None of a success."""
    if row.outcome in SUCCESSES:
        return None
    if row.outcome == "tipped":
        return TIPPED
    if row.outcome == "fault":
        return ERROR if row.path_m is None else DISARMED
    if (row.path_m or 0.0) >= settings.budget_m:
        return PATH
    return TIME if (row.time_s or 0.0) >= time_limit_s(settings) else GAVE_UP


def time_limit_s(settings: CampaignSettings) -> float:
    """Return after which time a rover counts as entrapped (``OutcomeMonitor``)."""
    from wayfarer.simhal.world.sites import SITES

    site_s = SITES[settings.scenario].time_limit_s if settings.scenario else inf
    return min(site_s, settings.budget_m * TIME_PER_BUDGET_S_PER_M)


def failures_section(results: CampaignResults) -> Iterator[str]:
    """Yield why trials failed and where, or that none did."""
    settings = results.settings
    failed = [row for row in results.rows if row.outcome not in SUCCESSES]
    if not failed:
        yield html.paragraph(f"None of {plural(len(results.rows), 'trial')} failed.")
        return
    yield html.paragraph(
        f"{plural(len(failed), 'failure')} of {plural(len(results.rows), 'trial')}: all are counted, drawn below or "
        f"not. Path budget: {settings.budget_m:g} m; time: {time_limit_s(settings):g} s. What held a rover is not in "
        "trials.csv: the trial must be run again for that, as each drawn one was."
    )
    yield _causes_table(results)
    yield _layouts_table(results)


def _causes_table(results: CampaignResults) -> str:
    counts = {
        name: Counter(cause for row in rows if (cause := cause_of(row, results.settings)))
        for name, rows in results.by_algorithm.items()
    }
    total = sum(counts.values(), Counter[str]())
    if len(counts) > 1:
        counts[ALL] = total
    causes = [cause for cause in CAUSES if total[cause]]
    rows = [
        ("", [name, str(of.total()), *(str(of[cause] or "") for cause in causes)]) for name, of in counts.items()
    ]  # fmt: skip
    return html.table("Failures by cause", ["algorithm", "failures", *causes], rows)


def _layouts_table(results: CampaignResults) -> str:
    """Return the layouts with the most failures: one in which many algorithms fail says more of it than of them."""
    by_layout: dict[int, list[TrialRow]] = defaultdict(list)
    for row in results.rows:
        by_layout[row.forest].append(row)
    failures = {forest: _failures_by_algorithm(rows) for forest, rows in by_layout.items()}
    worst = sorted((forest for forest in failures if failures[forest]), key=lambda at: (-failures[at].total(), at))
    rows = [
        ("", [f"forest {forest}", f"{failures[forest].total()} of {len(by_layout[forest])}", _named(failures[forest])])
        for forest in worst[:MOST_LAYOUTS]
    ]
    more = f", the first {MOST_LAYOUTS} of {len(worst)}" if len(worst) > MOST_LAYOUTS else ""
    return html.table(f"Layouts with failures{more}", ["layout", "failed trials", "algorithms"], rows)


def _failures_by_algorithm(rows: Sequence[TrialRow]) -> Counter[str]:
    return Counter(row.algorithm for row in rows if row.outcome not in SUCCESSES)


def _named(failures: Counter[str]) -> str:
    return ", ".join(name if count == 1 else f"{name} ({count})" for name, count in failures.most_common())
