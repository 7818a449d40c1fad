"""Writes the report of a run: one page that needs no network."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from math import isnan
from pathlib import Path

import numpy as np
from markupsafe import Markup

from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.folders import run_title
from wayfarer.logview import palette
from wayfarer.reports.data import RunData, read_run
from wayfarer.reports.events import LAYERS
from wayfarer.reports.map import map_plot
from wayfarer.reports.page import html
from wayfarer.reports.page.frame import PAGE, write_page
from wayfarer.reports.page.plots import Plots
from wayfarer.reports.panels import draw_panels
from wayfarer.reports.tables import (
    anomalies_table,
    conditions_table,
    episodes_table,
    events_list,
    lead,
    own_settings_table,
    run_facts,
    sensors_table,
)
from wayfarer.reports.track import Track, track_of

_run, _place = html.macros("wayfarer.reports", "run", "place")

NO_WAY = "The log has no heading, so the path of the rover is unknown."
NO_TICKS = "No time series: the log has no control ticks, or ticks without values."
NO_FOREST = "The log is of a simulated run, but its forest or its true path is missing or cannot be read."
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
FIXES = "Small crosses: the receiver's fixes; thin circles: the error of some. Of a long run not all are drawn."
FOREST = "Brown: fallen trunks; green dots: trees; green line: goal line."
GAPS = (
    "White diamonds: records are missing there, or no ticks came for a while. The motion in between is unknown; the "
    "path continues from where it ended."
)


def write_run_report(run: Path, out: Path | None = None) -> Path:
    """Write the report of the run in a folder, and return the page's path: ``out``, or ``report.html`` in the folder.

    The same log gives the same bytes. A log that is damaged or cut off gives a page that says what is not there.

    Raises:
        BadInput: there is no log in the folder, nothing in it can be read, or the report cannot be written.
    """
    data, plots = read_run(run), Plots()
    body = [
        html.folded(lead(data), html.facts(run_facts(data, run_title(run)))),
        _drawn(data, plots),
        html.section("Anomalies and episodes", anomalies_table(data), episodes_table(data)),
        html.section("Conditions", conditions_table(data)),
        html.section("Sensors", sensors_table(data)),
        html.section("Settings", own_settings_table(data)),
        html.section("Events", events_list(data)),  # the longest
    ]
    folder = run if run.is_dir() else run.parent
    return write_page(folder / PAGE, _title(data), body, plots, _cursor_js(), out=out)


def _title(data: RunData) -> str:
    """Name the page."""
    summary = data.summary
    rover, algorithm = summary.rover or "unknown rover", summary.algorithm or "unknown algorithm"
    how = "simulated run" if summary.simulated else "run"
    return f"{rover}, {algorithm}: {duration_text(summary.lasted_s)} {how}"


def _drawn(data: RunData, plots: Plots) -> Markup:
    """Return the map, the time panels, and the cursor that they share; it begins at the end, with how that was."""
    track_map = list(_map(track_of(data), plots))
    panels = list(draw_panels(data, plots))
    time_series = [html.paragraph(f"{BANDS} {PANELS}"), *panels] if panels else [html.paragraph(NO_TICKS)]
    return _run(track_map, time_series, max(1.0, data.summary.lasted_s))


def _map(track: Track, plots: Plots) -> Iterator[Markup]:
    if not track.data.has_way and not track.reckoned:
        yield html.paragraph(NO_WAY)
        return
    yield html.layers("Shown on the map and in the time series", _layers(track))
    yield html.figure(plots.place(map_plot(track)), track_caption(track))
    yield html.paragraph(_fitted(track))
    yield _where_link(track)
    if track.data.summary.simulated and track.forest is None:
        yield html.paragraph(NO_FOREST)


def track_caption(track: Track) -> str:
    """Explain the map."""
    told = [TRUE] if track.reckoned else [RECKONED, f"{'True' if track.origin else 'Magnetic'} north is up."]
    if track.forest:
        told.append(FOREST)
    if track.fixes:
        told.append(FIXES)
    if np.isnan(track.path.east_m).any():
        told.append(GAPS)
    return " ".join(told)


def _fitted(track: Track) -> str:
    """Say how well dead reckoning does, as far as that is known."""
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
    return " ".join(parts)


def _where_link(track: Track) -> Markup:
    """Return where the run ended, and who says so, with links that the map of a telephone, or a browser, opens."""
    if track.end_deg is None:
        return Markup("")
    latitude, longitude = (f"{degrees:.6f}" for degrees in track.end_deg)
    whose = "End of the fitted path (the last fix is above, under “where”)" if track.fit else "The last fix"
    return _place(whose, latitude, longitude)


def _layers(track: Track) -> Iterator[html.PlotLayer]:
    """Yield what can be switched off."""
    yield from html.phase_layers()
    if track.reckoned:
        yield html.PlotLayer("reckoned", "dead reckoning", palette.RECKONED)
    if track.fixes:
        yield html.PlotLayer("fixes", "receiver", palette.RECEIVER)
    yield from LAYERS


def _cursor_js() -> str:
    return (files("wayfarer.reports") / "cursor.js").read_text(encoding="utf-8")
