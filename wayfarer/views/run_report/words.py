"""Texts of one run's report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import isnan
from pathlib import Path

import numpy as np
from markupsafe import Markup

from wayfarer.fieldlog.fields import duration_text
from wayfarer.fieldlog.folders import short_name
from wayfarer.fieldlog.printable import escape_control_chars
from wayfarer.fieldlog.wording import whole_deg
from wayfarer.views.page import html
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.track import Track
from wayfarer.views.text.summary_text import summary_facts

(_place,) = html.macros("wayfarer.views.run_report", "place")

NO_WAY = "The log has no heading, so the path of the rover is unknown."
NO_TICKS = "No time series: the log has no control ticks, or ticks without values."
NO_FOREST = "The log is of a simulated run, but its forest or its true path is missing or cannot be read."
LAST_GOALS = 5  # as many stand in the header
BANDS = "Colours behind the lines: what the rover did; none: it stood."
PANELS = (
    "Drag over a panel to zoom, or use Ctrl and the wheel. Lines keep every extreme, and have gaps where data "
    "are missing."
)
RECKONED = (
    "The path by dead reckoning: measured motion, else the wheels' commands, and the compass. Slip stretches it, an "
    "error of the compass turns it. Star: start; cross: end; arrow: goal."
)
TRUE = (
    "The true path of the simulated rover (coloured), and its path by dead reckoning (dashed). Star: start; cross: "
    "end; arrow: goal."
)
FIXES = "Small crosses: the receiver's fixes; thin circles: their error."
FOREST = "Brown: fallen trunks; green dots: trees; green line: goal line."
GAPS = (
    "White diamonds: records are missing there, or no ticks came for a while. The motion in between is unknown; the "
    "path continues from where it ended."
)
SAME_SETTINGS = "Nothing: both runs had the same rover file."


def title(data: RunData) -> str:
    """Name the page."""
    summary = data.summary
    rover, algorithm = summary.rover or "unknown rover", summary.algorithm or "unknown algorithm"
    how = "simulated run" if summary.simulated else "run"
    return f"{rover}, {algorithm}: {duration_text(summary.lasted_s)} {how}"


def facts(data: RunData, folder: str) -> Iterator[tuple[str, str]]:
    """Yield what ran, when, how far and how it ended, as ``wayfarer logs summary`` tells it. Times are UTC."""
    for title_, lines in summary_facts(folder, data.summary, data.damage, utc=True):
        yield title_, "\n".join(lines)
    yield "goal", _goal(data)
    yield "seed", "unknown" if data.summary.seed is None else f"{data.summary.seed}"


def _goal(data: RunData) -> str:
    goals = [goal for goal, _ in groupby(f"{whole_deg(goal_deg)}°" for _, goal_deg in data.goals)]
    return ", then ".join(goals[-LAST_GOALS:]) or "none"


def number_of(run: Path) -> str:
    """Return what a run is called in short: its number, else its folder."""
    return escape_control_chars(short_name(run.resolve()))


def panels_text(runs: Sequence[RunData]) -> str:
    """Explain the time series; two runs have no colours behind them."""
    return f"{BANDS} {PANELS}" if len(runs) == 1 else PANELS


def track_caption(tracks: Sequence[Track]) -> str:
    """Explain the map."""
    gaps = any(np.isnan(track.path.east_m).any() for track in tracks)
    north = f"{'True' if tracks[0].origin else 'Magnetic'} north is up."
    told = [TRUE] if tracks[0].reckoned else [RECKONED, north]
    fixes = any(track.fixes for track in tracks)
    return " ".join([*told, *[FOREST] * bool(tracks[0].forest), *[FIXES] * fixes, *[GAPS] * gaps])


def fitted(track: Track, run: str) -> str:
    """Say how well dead reckoning does, as far as that is known; ``run`` names the run where there are two."""
    parts = []
    if not isnan(track.drift_m):
        parts.append(f"At the end dead reckoning is {track.drift_m:.1f} m from the true path.")
    if track.fit is not None:
        pinned_m, fitted_m = track.missed_m()
        parts.append(
            f"Dead reckoning is laid onto all fixes at once: turned by {track.fit.turned_deg:.1f}° and stretched by "
            f"{track.fit.stretched:.2f}. Median distance of the fixes from it: {fitted_m:.1f} m ({pinned_m:.1f} m if "
            "it began at the first fix)."
        )
    return run + " ".join(parts) if parts else ""


def where_link(track: Track, run: str) -> Markup:
    """Return where a run ended, and who says so, with links that the map of a telephone, or a browser, opens."""
    if track.end_deg is None:
        return Markup("")
    latitude, longitude = (f"{degrees:.6f}" for degrees in track.end_deg)
    whose = "End of the fitted path (the last fix is above, under “where”)" if track.fit else "The last fix"
    return _place(run + whose, latitude, longitude)
