"""The page of a search: ``report.html`` in the folder of ``wayfarer tune``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pydantic import BaseModel

from wayfarer.errors import BadInput
from wayfarer.experiments.provenance import RecordedRun, read_runs
from wayfarer.experiments.report import words
from wayfarer.experiments.report.load_results import CampaignSettings, read_settings
from wayfarer.experiments.report.tune_figures import FRONT_COLOURS, front_figure, history_figure, importance_figure
from wayfarer.experiments.results_folder import SUMMARY
from wayfarer.experiments.tables import number_text
from wayfarer.experiments.tuning.evidence import ended, results, verdict
from wayfarer.experiments.tuning.objective import QUANTITIES
from wayfarer.experiments.tuning.summary import DEVELOPMENT, PairedResult, TuneSummary
from wayfarer.views.page import html
from wayfarer.views.page.frame import PAGE, write_page
from wayfarer.views.page.plots import Plots

SETTINGS = "search.json"
HISTORY = (
    "Each point: the mean gain over the present settings in the same trials; up is better. Line: the best so far. "
    "Rings: given up early, so their gain is of fewer trials. Points with more failures than the present settings are "
    "left out."
)
IMPORTANCE = (
    "How much each key decides whether a point is among the best tenth, by PED-ANOVA (Watanabe, Bansal and Hutter, "
    "2023); together 1. A rough guide: of 96 points, keys without any influence got up to 0.15."
)
FRONT = (
    "Mean path of the successes against mean anomalies; down and left is better. Line: points that no other one beats "
    "in both, of those with all trials and no more failures than the present settings."
)
SIDE_BY_SIDE = (
    "Means over the same trials (path: those that both got out of), and tuned less present with its 95 % interval by a "
    "bootstrap of layouts. The point was chosen on the development forests, so its figures there are too good; the "
    "held-out ones are of forests that the search never saw. A difference whose interval contains 0 is none."
)


class SearchSettings(BaseModel):
    """What the page takes from ``search.json``, as ``SearchPlan.settings`` wrote it."""

    campaign: CampaignSettings


def is_tuned(folder: Path) -> bool:
    """Return whether a folder is that of a search."""
    return (folder / SETTINGS).is_file()


def read_summary(folder: Path) -> TuneSummary:
    """Read what a search has found.

    Raises:
        BadInput: it is not finished, or its summary is damaged.
    """
    if not (folder / SUMMARY).exists():
        raise BadInput(
            f"{folder}: its search is not finished; repeat its `wayfarer tune` and add --resume to finish it first"
        )
    return read_settings(folder / SUMMARY, TuneSummary, "search")


def write_tune_report(folder: Path, out: Path | None = None) -> Path:
    """Write the page of the search in ``folder``, and return its path: ``out``, or ``report.html`` in it.

    Raises:
        BadInput: the folder holds no finished search, is damaged, or cannot be written.
    """
    summary, plots = read_summary(folder), Plots()
    settings = read_settings(folder / SETTINGS, SearchSettings, "search").campaign
    title = f"Search for {QUANTITIES[summary.objective].title}: {summary.algorithm} on {summary.rover}"
    return write_page(folder / PAGE, title, list(_body(summary, settings, plots, read_runs(folder))), plots, out=out)


def _body(summary: TuneSummary, settings: CampaignSettings, plots: Plots, runs: Sequence[RecordedRun]) -> Iterator[str]:
    yield html.facts([*_facts(summary), *words.facts(settings, runs)])
    yield html.section("What was found", html.bullets(verdict(summary)), *_found(summary))
    yield html.section("History", html.paragraph(HISTORY), html.figure(plots.place(history_figure(summary))))
    if summary.importance:
        drawn = html.figure(plots.place(importance_figure(summary)))
        yield html.section("Importance", html.paragraph(IMPORTANCE), drawn)
    key, front = html.key("Settings", FRONT_COLOURS.items()), html.figure(plots.place(front_figure(summary)))
    yield html.section("Path against anomalies", html.paragraph(FRONT), key, front)
    yield html.section("Points", html.folded(f"{len(summary.points)} points", _points(summary)))


def _facts(summary: TuneSummary) -> Iterator[tuple[str, str]]:
    yield "objective", QUANTITIES[summary.objective].title
    yield "points", f"{len(summary.points) - 1}: {ended(summary)}"
    for key, (low, high) in summary.space.items():
        yield key, f"{low:g} to {high:g} (present: {summary.points[0].values[key]:g})"


def _found(summary: TuneSummary) -> Iterator[str]:
    """Yield development and held-out figures side by side, and what was changed."""
    if found := results(summary):
        head = ["", *(f"{each.forests},\n{each.physics}, {each.trials} trials" for each in found)]
        rows = [
            ("", [one.title, *(_cell(each, one.name, one.decimals) for each in found)]) for one in QUANTITIES.values()
        ]
        rows.append(("", ["did not get out", *(f"{each.present_failures}, {each.tuned_failures}" for each in found)]))
        rows.append(("", ["verdict", *(_verdict(each) for each in found)]))
        yield html.table("Present, tuned, and the difference [95 % interval]", head, rows)
        yield html.paragraph(SIDE_BY_SIDE)
        changed = [("", [key, f"{before:g}", f"{after:g}"]) for key, (before, after) in summary.changed.items()]
        yield html.table("The tuned values, as in tuned.toml", ["key", "present", "tuned"], changed)


def _verdict(each: PairedResult) -> str:
    return "chosen on these" if each.forests == DEVELOPMENT else each.verdict


def _cell(each: PairedResult, name: str, decimals: int) -> str:
    change = each.changes[name]
    if not (text := change.text(decimals)):
        return "not known"
    return f"{number_text(change.present, decimals)}, {number_text(change.tuned, decimals)}\n{text}"


def _points(summary: TuneSummary) -> str:
    keys = list(summary.space)
    head = ["point", *keys, "trials", "ended", "failures", "gain", *(one.title for one in QUANTITIES.values())]
    decimals = QUANTITIES[summary.objective].decimals
    rows = [
        (
            "",
            [
                "present" if each.point == 0 else str(each.point),
                *(f"{each.values[key]:g}" for key in keys),
                str(each.trials),
                each.ended,
                str(each.failures),
                number_text(each.gain, decimals),
                *(number_text(each.means[one.name], one.decimals) for one in QUANTITIES.values()),
            ],
        )
        for each in summary.points
    ]
    return html.table("Means over the trials that each point had", head, rows)
