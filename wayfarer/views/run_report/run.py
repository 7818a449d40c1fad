"""Writes the report of one run, or of two beside each other: one page that needs no network."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files
from math import isnan
from pathlib import Path

import numpy as np
from markupsafe import Markup

from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.fieldlog.folders import run_title, short_name
from wayfarer.views import palette
from wayfarer.views.page import html
from wayfarer.views.page.frame import PAGE, write_page
from wayfarer.views.page.plots import Plots
from wayfarer.views.run_report.comparison import difference_text, facts_table
from wayfarer.views.run_report.data import RunData, read_run
from wayfarer.views.run_report.events import LAYERS
from wayfarer.views.run_report.map import map_plot
from wayfarer.views.run_report.memory import LAYER
from wayfarer.views.run_report.panels import draw_panels
from wayfarer.views.run_report.settings import changed_settings_table, own_settings_table
from wayfarer.views.run_report.tables import (
    anomalies_table,
    conditions_table,
    episodes_table,
    events_list,
    lead,
    run_facts,
    sensors_table,
)
from wayfarer.views.run_report.track import Track, tracks_of

_run, _place = html.macros("wayfarer.views.run_report", "run", "place")

ON_MAP = {"anomaly", "mark"}
LONGEST_NAME = 6  # of two runs beside each value
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
REMEMBERED = (
    "Red, as of the time of the cursor: the trunks that the algorithm remembers, fainter where it doubts them, and the "
    "way that it plans, dashed; laid at where the rover was then."
)
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
        _drawn([data], [number_of(run)], plots),
        html.section("Anomalies and episodes", anomalies_table(data), episodes_table(data)),
        html.section("Conditions", conditions_table(data)),
        html.section("Sensors", sensors_table(data)),
        html.section("Settings", own_settings_table(data)),
        html.section("Events", events_list(data)),  # the longest
    ]
    return write_page(run / PAGE, _title(data), body, plots, _cursor_js(), out=out)


def write_comparison(first: Path, second: Path, out: Path | None = None) -> Path:
    """Write two runs into one page, and return its path: ``out``, or ``report-N-M.html`` in the second folder.

    Raises:
        BadInput: as ``write_run_report``.
    """
    runs, plots = [read_run(first), read_run(second)], Plots()
    names = [number_of(first), number_of(second)]
    body = [
        html.folded(difference_text(runs), facts_table(runs, names)),
        _drawn(runs, names, plots),
        html.section("What changed in the rover file", changed_settings_table(runs, names)),
    ]
    usual = second / f"report-{'-'.join(names)}.html"
    return write_page(usual, f"Runs {names[0]} and {names[1]}", body, plots, _cursor_js(), out=out)


def _title(data: RunData) -> str:
    """Name the page."""
    summary = data.summary
    rover, algorithm = summary.rover or "unknown rover", summary.algorithm or "unknown algorithm"
    how = "simulated run" if summary.simulated else "run"
    return f"{rover}, {algorithm}: {duration_text(summary.lasted_s)} {how}"


def number_of(run: Path) -> str:
    """Return what a run is called in short: its number, else its folder."""
    return escape_control_chars(short_name(run.resolve()))


def _drawn(runs: Sequence[RunData], names: Sequence[str], plots: Plots) -> Markup:
    """Return the map, the time panels, and the cursor that they share; it begins at the end, with how that was."""
    track_map = list(_map(tracks_of(runs), names, plots))
    panels = list(draw_panels(runs, plots))
    how_to_read = f"{BANDS} {PANELS}" if len(runs) == 1 else PANELS  # two runs have no colours behind them
    time_series = [html.paragraph(how_to_read), *panels] if panels else [html.paragraph(NO_TICKS)]
    ends_s = [data.summary.lasted_s for data in runs]
    end_s = max(1.0, *ends_s)
    called = names if max(map(len, names)) <= LONGEST_NAME else ("first", "second")  # at each value of the cursor
    told = [{"name": name, "end": end_s} for name, end_s in zip(called, ends_s, strict=False)]
    return _run(track_map, time_series, told, end_s)


def _map(tracks: Sequence[Track], names: Sequence[str], plots: Plots) -> Iterator[Markup]:
    if not any(track.data.has_way or track.reckoned for track in tracks):
        yield html.paragraph(NO_WAY)
        return
    yield html.layers("Shown on the map and in the time series", _layers(tracks))
    if len(tracks) > 1:
        yield html.key("", zip(names, palette.RUNS, strict=True))
    yield html.figure(plots.place(map_plot(tracks)), track_caption(tracks))
    for track, name in zip(tracks, names, strict=True):
        run = "" if len(tracks) == 1 else f"Run {name}: "
        yield html.paragraph(_fitted(track, run))
        yield _where_link(track, run)
    if len(tracks) == 1 and tracks[0].data.summary.simulated and tracks[0].forest is None:
        yield html.paragraph(NO_FOREST)


def track_caption(tracks: Sequence[Track]) -> str:
    """Explain the map."""
    gaps = any(np.isnan(track.path.east_m).any() for track in tracks)
    north = f"{'True' if tracks[0].origin else 'Magnetic'} north is up."
    told = [TRUE] if tracks[0].reckoned else [RECKONED, north]
    fixes = any(track.fixes for track in tracks)
    forest, remembers = bool(tracks[0].forest), _remembers(tracks)
    return " ".join([*told, *[FOREST] * forest, *[REMEMBERED] * remembers, *[FIXES] * fixes, *[GAPS] * gaps])


def _remembers(tracks: Sequence[Track]) -> bool:
    return any(track.data.contact_maps for track in tracks)


def _fitted(track: Track, run: str) -> str:
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


def _where_link(track: Track, run: str) -> Markup:
    """Return where a run ended, and who says so, with links that the map of a telephone, or a browser, opens."""
    if track.end_deg is None:
        return Markup("")
    latitude, longitude = (f"{degrees:.6f}" for degrees in track.end_deg)
    whose = "End of the fitted path (the last fix is above, under “where”)" if track.fit else "The last fix"
    return _place(run + whose, latitude, longitude)


def _layers(tracks: Sequence[Track]) -> Iterator[html.PlotLayer]:
    """Yield what can be switched off: of one run also its phases."""
    if len(tracks) == 1:
        yield from html.phase_layers()
    if any(track.reckoned for track in tracks):
        yield html.PlotLayer("reckoned", "dead reckoning", palette.RECKONED, shown=len(tracks) == 1)
    if _remembers(tracks):
        yield LAYER._replace(shown=len(tracks) == 1)
    if any(track.fixes for track in tracks):
        yield html.PlotLayer("fixes", "receiver", palette.RECEIVER, shown=len(tracks) == 1)
    for each in LAYERS:  # of two runs, the panel of events has the colours of the runs
        yield each if len(tracks) == 1 or each.name in ON_MAP else each._replace(colour="")


def _cursor_js() -> str:
    return (files("wayfarer.views.run_report") / "cursor.js").read_text(encoding="utf-8")
