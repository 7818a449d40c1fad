"""Writes the report of a run: one page that needs no network."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from importlib.resources import files
from itertools import groupby, islice
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from wayfarer import __version__
from wayfarer.config.rover_file import RoverConfig, flat
from wayfarer.errors import BadInput
from wayfarer.escape.settings import Vehicle
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.folders import run_title
from wayfarer.fieldlog.run_fold import Episode
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.wording import sentence
from wayfarer.logview import palette
from wayfarer.logview.summary import result_sentences, summary_facts
from wayfarer.reports.data import LAYERS, PHASES, RunData, is_trouble, read_run, worded_events
from wayfarer.reports.map import ALONE_PX, Track, map_plot, track_of
from wayfarer.reports.page import html
from wayfarer.reports.page.html import PAGE, Plot, write_page
from wayfarer.reports.page.plots import Plots
from wayfarer.reports.panels import draw_panels
from wayfarer.vocabulary import in_words, response_text, whole_deg

ROWS = 500  # of a table; the log has all of them
LAST_GOALS = 5  # as many are shown
NO_WAY = "The log has no heading, so the path of the rover is unknown."
NO_TICKS = "No time series: the log has no control ticks, or ticks without values."
NO_FOREST = "The log is of a simulated run, but its forest or its true path is missing or cannot be read."
BANDS = "Colours behind the lines: what the rover did; none: it was stopped."
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
        html.result(result_sentences(data.summary, data.damage)),
        _drawn(data, plots),
        html.section("Anomalies and episodes", anomalies_table(data), episodes_table(data)),
        html.section("Conditions", conditions_table(data)),
        html.section("Sensors", sensors_table(data)),
        html.section("Settings", own_settings_table(data)),
        html.section("Events", events_list(data)),
        html.folded("All facts of this run", html.facts(run_facts(data, run_title(run)))),
    ]
    folder = run if run.is_dir() else run.parent
    cursor_js = (files("wayfarer.reports") / "cursor.js").read_text(encoding="utf-8")
    return write_page(folder / PAGE, _title(data), body, plots, cursor_js, out=out)


def run_plot(run: Path) -> Plot:
    """Return the map of the run in a folder on its own.

    Raises:
        BadInput: nothing in the log can be read, or it has no path.
    """
    data, plots = read_run(run), Plots()
    track = track_of(data)
    if not data.has_way and not track.reckoned:
        raise BadInput(f"{run}: there is no map of this run: the log has no heading, so nobody knows the rover's path")
    drawn = map_plot(track)
    drawn.max_width = ALONE_PX
    tags = {tag for each in drawn.renderers for tag in each.tags}
    layers = [each for each in _layers(track) if f"layer:{each.name}" in tags]
    body = [html.layers("Show", layers), html.figure(plots.place(drawn), track_caption(track)), _fitted(track)]
    return Plot(_title(data), body, plots)


def _title(data: RunData) -> str:
    summary = data.summary
    rover, algorithm = summary.rover or "unknown rover", summary.algorithm or "unknown algorithm"
    return f"{rover}, {algorithm}: {duration_text(summary.lasted_s)} {'simulated run' if summary.simulated else 'run'}"


def _drawn(data: RunData, plots: Plots) -> Markup:
    """Return the map, the time panels, and the cursor that they share; it begins at the end, with how that was."""
    track_map = list(_map(track_of(data), plots))
    panels = list(draw_panels(data, plots))
    time_series = [html.paragraph(f"{BANDS} {PANELS}"), *panels] if panels else [html.paragraph(NO_TICKS)]
    return html.run(track_map, time_series, max(1.0, data.summary.lasted_s))


def _map(track: Track, plots: Plots) -> Iterator[Markup]:
    if not track.data.has_way and not track.reckoned:
        yield html.paragraph(NO_WAY)
        return
    yield html.layers("Shown on the map and in the time series", _layers(track))
    yield html.figure(plots.place(map_plot(track)), track_caption(track))
    yield _fitted(track)
    if track.end_deg is not None:  # who says so, with links that the map of a telephone, or a browser, opens
        latitude, longitude = (f"{degrees:.6f}" for degrees in track.end_deg)
        whose = "End of the fitted path (the last fix is below, under “where”)" if track.fit else "The last fix"
        yield html.place(whose, latitude, longitude)
    if track.data.summary.simulated and track.forest is None:
        yield html.paragraph(NO_FOREST)


def track_caption(track: Track) -> str:
    """Explain the map."""
    path = TRUE if track.reckoned else f"{RECKONED} {'True' if track.origin else 'Magnetic'} north is up."
    more = ((track.forest, FOREST), (track.fixes, FIXES), (np.isnan(track.path.east_m).any(), GAPS))
    return " ".join([path, *(text for is_there, text in more if is_there)])


def _fitted(track: Track) -> Markup:
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
    return html.paragraph(" ".join(parts))


def _layers(track: Track) -> Iterator[html.PlotLayer]:
    """Yield what can be switched off."""
    phases = track.data.ticks["phase"]
    yield from html.phase_layers({PHASES[int(index)] for index in np.unique(phases[~np.isnan(phases)])})
    if track.reckoned:
        yield html.PlotLayer("reckoned", "dead reckoning", palette.RECKONED)
    if track.fixes:
        yield html.PlotLayer("fixes", "receiver", palette.RECEIVER)
    yield from LAYERS


def own_settings_table(data: RunData) -> Markup:
    """Return the keys of a run's rover file whose values are not the defaults, or which have none."""
    settings, usual = flat(data.header.config or {}), default_settings()
    if not settings:
        return html.paragraph("The log does not have the rover file.")
    rows = [
        ("setting", (key, _text(value), _text(usual[key])))
        for key, value in settings.items()
        if key in usual and usual[key] != value
    ]
    rows += [("setting", (key, _text(value), "")) for key, value in settings.items() if key not in usual]
    if not rows:
        return html.paragraph("Everything in the rover file is as wayfarer has it by default.")
    caption = (
        f"Keys of the rover file whose value is not the default of wayfarer {__version__}; below them those without a "
        "default, as of body and parts."
    )
    return html.table(caption, ("key", "value", "default"), rows)


def default_settings() -> Mapping[str, Any]:
    """Return what a rover file need not say, by its dotted keys: all but the name, the body and the parts."""
    asked = [field.name for field in fields(Vehicle) if field.default is MISSING]
    usual = RoverConfig(name="any", vehicle=Vehicle(**dict.fromkeys(asked, 1.0)))
    needed = {"name", "parts", *(f"vehicle.{name}" for name in asked)}
    return {key: value for key, value in flat(usual.model_dump(mode="json")).items() if key not in needed}


def _text(value: Any) -> str:
    return "none" if value is None else str(value)


def run_facts(data: RunData, folder: str) -> Iterator[tuple[str, str]]:
    """Yield what ran, when, how far and how it ended, as ``wayfarer logs summary`` does. Times are UTC."""
    for title, lines in summary_facts(folder, data.summary, data.damage, utc=True):
        yield title, "\n".join(lines)
    goals = [goal for goal, _ in groupby(f"{whole_deg(goal_deg)}°" for _, goal_deg in data.goals)]
    yield "goal", ", then ".join(goals[-LAST_GOALS:]) or "none"
    yield "seed", "unknown" if data.summary.seed is None else f"{data.summary.seed}"


def anomalies_table(data: RunData) -> Markup:
    """Return the anomalies by cause."""
    counts = data.summary.anomalies
    if not counts:
        return html.paragraph("There were no anomalies.")
    total, hundred_m = sum(counts.values()), data.summary.reckoned_m / 100.0
    rows = []
    for kind, count in sorted(counts.items(), key=lambda item: -item[1]):
        often = f"{count / hundred_m:.1f}" if hundred_m > 0.0 else ""
        rows.append(("", (in_words(kind), f"{count}", f"{count / total:.0%}", often)))
    caption = "Anomalies by cause. Each is counted when it begins."
    return html.table(caption, ("cause", "times", "share", "in 100 m"), rows)


def episodes_table(data: RunData) -> Markup:
    """Return the episodes, in their order."""
    if not data.episodes:
        return html.paragraph("There was no escape episode: the rover always followed its goal.")
    rows = [("", _episode(number, each)) for number, each in enumerate(data.episodes[:ROWS], start=1)]
    caption = "Episodes: from an anomaly until the goal was followed again."
    head = ("no.", "began", "first turn", "turns", "lasted, s", "distance, m", "how it ended")
    return html.table(caption, head, rows) + _rest(data.episodes)


def _episode(number: int, episode: Episode) -> Sequence[str]:
    ended = in_words(episode.ended_by or "the end of the log").replace("_", " ")
    lasted_s = episode.end_s - episode.start_s
    began = duration_text(episode.start_s, 1)
    return f"{number}", began, episode.side, f"{episode.turns}", f"{lasted_s:.1f}", f"{episode.metres:.1f}", ended


def conditions_table(data: RunData) -> Markup:
    """Return for how long which condition limited or stopped an armed rover, and what it did about that."""
    times_s = [("hold", data.summary.held_s), ("degrade", data.summary.limited_s)]
    rows = [
        ("", (sentence(in_words(cause)), duration_text(for_s, 1), response_text(level, cause)))
        for level, by_cause in times_s
        for cause, for_s in by_cause.items()
    ]
    if not rows:
        return html.paragraph("While it was armed, nothing was wrong with the rover itself.")
    caption = (
        "What was wrong with the rover itself while it was armed, for how long in total, and what it did about it."
    )
    return html.table(caption, ("condition", "for", "response"), rows)


def events_list(data: RunData) -> Markup:
    """Return everything that was reported, in its order; trouble is set in bold."""
    if not data.events:
        return html.paragraph("No events.")
    lines = [
        (duration_text(event.elapsed_s, 1), text, is_trouble(event))
        for event, text in islice(worded_events(data), ROWS)
    ]
    return html.events(lines) + _rest(data.events)


def sensors_table(data: RunData) -> Markup:
    """Return how well each sensor spoke."""
    if not data.sensors:
        return html.paragraph("The log has no sensor readings.")
    rows = [("", (sensor, *_health(data, sensor, health))) for sensor, health in data.sensors.items()]
    caption = (
        "Sensors, as the control loop saw them: it looks at each once per tick. Unsure: readings of motion whose "
        "quality is too low to be used."
    )
    head = ("sensor", "readings", "rate, Hz", "set, Hz", "longest gap, s", "unsure", "failures")
    return html.table(caption, head, rows)


def _health(data: RunData, sensor: str, health: SensorStatus) -> Sequence[str]:
    rate_hz, set_hz = health.rate_hz, data.setting("rates", f"{sensor}_hz")
    unsure = f"{health.doubtful / health.readings:.1%}" if sensor == "motion" and health.readings else ""
    return (
        f"{health.readings}",
        "" if isnan(rate_hz) else f"{rate_hz:.1f}",
        "" if isnan(set_hz) else f"{set_hz:g}",
        f"{health.longest_gap_s:.2f}" if health.readings else "",
        unsure,
        f"{health.failures}",
    )


def _rest(rows: Sequence[object]) -> Markup:
    """Say how many rows are left out, if any."""
    more = len(rows) - ROWS
    return html.paragraph(f"{more} more are in the log: wayfarer logs show." if more > 0 else "")
