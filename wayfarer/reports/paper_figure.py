"""The paper's figure of a campaign, as the paper draws it (arXiv 2503.07492, its figure of simulations); by Matplotlib.

Text stays text: PDF embeds its font, SVG names it. A reader's ``matplotlibrc`` has no effect, and no date is kept: the
same results and the same Matplotlib give the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from statistics import fmean
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from wayfarer.errors import BadInput
from wayfarer.experiments.measures import MEASURES, estimate
from wayfarer.experiments.results import Results
from wayfarer.files import write_atomically
from wayfarer.logview import palette
from wayfarer.reports.figures import grouped, short

SIZE_IN = (7.16, 3.2)  # as wide as a page of IEEE's two columns, 181.9 mm
DPI = 300
NO_DATE: Mapping[str, dict[str, None]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}, ".png": {}}
STYLE: Mapping[Any, Any] = {
    "svg.fonttype": "none", "svg.hashsalt": "wayfarer", "pdf.fonttype": 42,  # TrueType: publishers refuse Type 3
    "font.family": "DejaVu Sans", "font.size": 7.0, "axes.linewidth": 0.6, "axes.spines.top": False,
    "xtick.major.width": 0.6, "ytick.major.width": 0.6, "legend.frameon": False, "figure.constrained_layout.use": True,
    "text.parse_math": False,  # the name of an algorithm is not a formula
}  # fmt: skip
DASHED: Mapping[str, Any] = {"linestyle": (0, (5, 3)), "linewidth": 0.9}


def write_paper_figure(results: Results, path: Path) -> None:
    """Draw the figure of a campaign into a file, whose ending says its format.

    Raises:
        BadInput: the file has another ending, or cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in NO_DATE:
        raise BadInput(f"--figure {path}: expected a name that ends in .pdf, .svg or .png")
    file = BytesIO()
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        paper_figure(results).savefig(file, format=ending[1:], metadata=NO_DATE[ending], dpi=DPI)
    try:
        write_atomically(path, file.getvalue(), follow_symlink=True)
    except OSError as error:
        raise BadInput(f"--figure {path} cannot be written: {error.strerror or error}; name another file") from error


def paper_figure(results: Results) -> Figure:
    """Return box plots of the successes' paths, with bars of the trials that failed and a line at the shortest path.

    Whiskers go to the last path within 1.5 quartile ranges, each path beyond is a circle. Groups are as in the paper.
    """
    groups = grouped(results.plan.base.algorithms)
    names = [name for group in groups for name in group.algorithms]
    by_algorithm = results.by_algorithm
    paths_m = [[row.escape_path_m for row in by_algorithm[name] if row.escape_path_m] for name in names]
    success = [estimate(by_algorithm[name], MEASURES["success_percent"]) for name in names]
    failed = [100.0 - found.value if found else 0.0 for found in success]
    figure, at = Figure(figsize=SIZE_IN), range(len(names))
    boxes = figure.add_subplot(ylabel="path to the destination line, m", xlim=(-0.5, len(names) - 0.5))
    bars = boxes.twinx()
    bars.set(ylabel="trials that did not get out, %", ylim=(0.0, max(5.0, 1.1 * max(failed))))
    bars.bar(at, failed, 0.7, color=palette.ORANGE, alpha=0.5, label="did not get out (right axis)")
    boxes.set_zorder(bars.get_zorder() + 1.0)
    boxes.patch.set_visible(False)  # the bars are behind it
    line = {"color": palette.BLUE, "linewidth": 0.8}
    circles = {"markersize": 2.5, "markerfacecolor": "none", "markeredgecolor": palette.GREY, "markeredgewidth": 0.5}
    boxes.boxplot(
        paths_m, positions=at, widths=0.4, boxprops=line, whiskerprops=line, capprops=line, flierprops=circles,
        medianprops=line | {"linewidth": 1.6}, manage_ticks=False,
    )  # fmt: skip
    if (shortest := _shortest(results)) is not None:
        shortest_m, what = shortest
        boxes.axhline(shortest_m, color=palette.RED, label=f"shortest distance, {shortest_m:.1f} m ({what})", **DASHED)
    boxes.set_xticks(at, list(map(short, names)), rotation=30.0, ha="right", rotation_mode="anchor")
    boxes.set_ylim(bottom=0.0)
    first = 0
    for group in groups:
        last = first + len(group.algorithms)
        middle = (first + last - 1) / 2.0
        boxes.text(middle, 1.02, group.title, ha="center", transform=boxes.get_xaxis_transform(), weight="bold")
        if first:
            boxes.axvline(first - 0.5, color=palette.GREY, **DASHED)
        first = last
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _shortest(results: Results) -> tuple[float, str] | None:
    """Return the shortest distance to the destination line, metres, and what it is; None if nothing says it."""
    if results.shortest_paths_m:
        return fmean(results.shortest_paths_m), "mean shortest path"
    try:
        forest = results.rebuild().make_forest(0)
    except BadInput:
        return None
    return forest.goal_y_m - forest.start_m[1], "a straight line"
