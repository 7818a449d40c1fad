"""Writes the report of one run, or of two beside each other: one page that needs no network."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path

from markupsafe import Markup

from wayfarer.fieldlog.folders import run_title
from wayfarer.views import palette
from wayfarer.views.page import html
from wayfarer.views.page.frame import PAGE, write_page
from wayfarer.views.page.plots import Plots
from wayfarer.views.run_report import words
from wayfarer.views.run_report.data import RunData, read_run
from wayfarer.views.run_report.events import LAYERS
from wayfarer.views.run_report.map import map_plot
from wayfarer.views.run_report.panels import draw_panels
from wayfarer.views.run_report.tables import (
    anomalies_table,
    conditions_table,
    episodes_table,
    events_list,
    facts_table,
    sensors_table,
    settings_table,
)
from wayfarer.views.run_report.track import Track, tracks_of

(_run,) = html.macros("wayfarer.views.run_report", "run")


def write_run_report(run: Path, out: Path | None = None) -> Path:
    """Write the report of the run in a folder, and return the page's path: ``out``, or ``report.html`` in the folder.

    The same log gives the same bytes. A log that is damaged or cut off gives a page that says what is not there.

    Raises:
        BadInput: there is no log in the folder, nothing in it can be read, or the report cannot be written.
    """
    data, plots = read_run(run), Plots()
    body = [
        html.facts(words.facts(data, run_title(run))),
        _drawn([data], [words.number_of(run)], plots),
        html.section("Anomalies and episodes", anomalies_table(data), episodes_table(data)),
        html.section("Conditions", conditions_table(data)),
        html.section("Events", events_list(data)),
        html.section("Sensors", sensors_table(data)),
    ]
    return write_page(run / PAGE, words.title(data), body, plots, _cursor_js(), out=out)


def write_comparison(first: Path, second: Path, out: Path | None = None) -> Path:
    """Write two runs into one page, and return its path: ``out``, or ``report-N-M.html`` in the second folder.

    Raises:
        BadInput: as ``write_run_report``.
    """
    runs, plots = [read_run(first), read_run(second)], Plots()
    names = [words.number_of(first), words.number_of(second)]
    body = [
        html.section("Figures", facts_table(runs, names)),
        _drawn(runs, names, plots),
        html.section("What changed in the rover file", settings_table(runs, names)),
    ]
    usual = second / f"report-{'-'.join(names)}.html"
    return write_page(usual, f"Runs {names[0]} and {names[1]}", body, plots, _cursor_js(), out=out)


def _drawn(runs: Sequence[RunData], names: Sequence[str], plots: Plots) -> Markup:
    """Return the map, the time panels, and the cursor that they share; it begins at the end, with how that was."""
    track_map = list(_map(tracks_of(runs), names, plots))
    panels = list(draw_panels(runs, plots))
    time_series = [html.paragraph(words.panels_text(runs)), *panels] if panels else [html.paragraph(words.NO_TICKS)]
    ends_s = [data.summary.lasted_s for data in runs]
    end_s = max(1.0, *ends_s)
    told = [{"name": name, "end": end_s} for name, end_s in zip(names, ends_s, strict=True)]
    return _run(track_map, time_series, told, end_s)


def _map(tracks: Sequence[Track], names: Sequence[str], plots: Plots) -> Iterator[Markup]:
    if not any(track.data.has_way or track.reckoned for track in tracks):
        yield html.paragraph(words.NO_WAY)
        return
    yield html.layers("Shown on the map and in the time series", _layers(tracks))
    if len(tracks) > 1:
        yield html.key("", zip(names, palette.RUNS, strict=True))
    yield html.figure(plots.place(map_plot(tracks)), words.track_caption(tracks))
    for track, name in zip(tracks, names, strict=True):
        run = "" if len(tracks) == 1 else f"Run {name}: "
        yield html.paragraph(words.fitted(track, run))
        yield words.where_link(track, run)
    if len(tracks) == 1 and tracks[0].data.summary.simulated and tracks[0].forest is None:
        yield html.paragraph(words.NO_FOREST)


def _layers(tracks: Sequence[Track]) -> Iterator[html.PlotLayer]:
    """Yield what can be switched off: of one run also its phases."""
    if len(tracks) == 1:
        yield from html.phase_layers()
    if any(track.reckoned for track in tracks):
        yield html.PlotLayer("reckoned", "dead reckoning", palette.RECKONED, shown=len(tracks) == 1)
    if any(track.fixes for track in tracks):
        yield html.PlotLayer("fixes", "receiver", palette.RECEIVER, shown=len(tracks) == 1)
    yield from LAYERS


def _cursor_js() -> str:
    return (files("wayfarer.views.run_report") / "cursor.js").read_text(encoding="utf-8")
