"""Texts of one run's report."""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import isnan

import numpy as np

from wayfarer.fieldlog.fields import name, span
from wayfarer.fieldlog.printable import clean
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.track import drift_m

NO_WAY = "The log has no heading, so the path of the rover is unknown."
NO_TICKS = "No time lines: the log has no control ticks, or they hold no values."
NO_FOREST = "The log is of a simulated run, but its forest or its true path is missing or cannot be read."
NO_EPISODE = "There was no escape episode: the rover followed its goal all the time."
NO_EVENT = "No events."
LAST_GOALS = 5  # as many stand in the header
NO_SENSOR = "The log has no sensor readings."


def title(data: RunData) -> str:
    """Name the page."""
    summary = data.summary
    rover, algorithm = summary.rover or "unknown rover", summary.algorithm or "unknown algorithm"
    how = "simulated run" if summary.simulated else "run"
    return f"{rover}, {algorithm}: {span(summary.lasted_s)} {how}"


def facts(data: RunData, folder: str) -> Iterator[tuple[str, str]]:
    """Yield what ran, when, how far and to what end."""
    summary, header = data.summary, data.header
    yield "outcome", _outcome(data)
    yield "rover", summary.rover or "unknown"
    yield "algorithm", summary.algorithm or "unknown"
    yield "kind", _kind(data)
    yield "began", _began(data)
    yield "duration", _duration(data)
    yield "distance", _way(data)
    yield "anomalies", f"{sum(summary.anomalies.values())} in {len(data.episodes)} episodes"
    yield "where it ended", _where(data)
    yield "goal", _goal(data)
    yield "software", f"wayfarer {name(header, 'version') or 'of an unknown version'}"
    yield "seed", "unknown" if header.get("seed") is None else clean(str(header["seed"]))
    yield "log", f"{clean(folder)}: {data.damage}"


def _outcome(data: RunData) -> str:
    summary = data.summary
    if summary.reason is None:
        return "unknown: the log was cut off (the process was killed, or the power went)"
    reason = summary.reason.replace("_", " ")
    return f"{reason}: {summary.text}" if summary.text else reason


def _kind(data: RunData) -> str:
    if not data.header:
        return "unknown: the log does not begin with what ran"
    what = "simulated" if data.summary.simulated else "on the rover itself"
    return f"{what}, dry run: the wheels were never driven" if data.summary.dry_run else what


def _began(data: RunData) -> str:
    """Return the time in UTC: the same log gives the same page on every computer."""
    began_s = data.summary.began_wall_s
    try:
        if began_s is not None:
            return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(began_s))
    except (OverflowError, ValueError, OSError):
        pass
    return "in simulated time" if data.summary.simulated else "unknown: the clock was not set"


def _duration(data: RunData) -> str:
    summary = data.summary
    held_s = sum(summary.held_s.values())
    held = f", held {span(held_s)} of it" if held_s else ""
    return f"{span(summary.lasted_s)}, armed {span(summary.armed_s)}{held}"


def _way(data: RunData) -> str:
    commanded_m = data.summary.commanded_m
    commanded = "" if commanded_m is None else f", {commanded_m:.1f} m commanded"
    return f"{data.summary.reckoned_m:.1f} m by dead reckoning{commanded}"


def _where(data: RunData) -> str:
    offset = data.summary.where.by_reckoning
    if offset is None:
        return "unknown: there was no heading"
    start = "the start" if data.summary.where.from_start else "where the log begins"
    place = f"{offset.distance_m:.0f} m from {start} at bearing {round(offset.bearing_deg) % 360}°"
    return f"{place}, by dead reckoning{_partly(data)}"


def _partly(data: RunData) -> str:
    missing = data.damage.missing
    records = "1 record is" if missing == 1 else f"{missing} records are"
    return f"; {records} missing, so the path is only partly known" if missing else ""


def _goal(data: RunData) -> str:
    goals_deg = data.ticks["goal_heading_deg"]
    whole_deg = np.round(goals_deg[~np.isnan(goals_deg)]) % 360.0
    changes_deg = whole_deg[np.append(True, np.diff(whole_deg) != 0)[: whole_deg.size]]
    return ", then ".join(f"{goal_deg:.0f}°" for goal_deg in changes_deg[-LAST_GOALS:]) or "none"


# -- figures -----------------------------------------------------------------------------------------------------


def track_caption(data: RunData) -> str:
    """Explain the drawing of the way."""
    fixes = ""
    if data.fixes:
        fixes = (
            " Green crosses and circles: the receiver's fixes with their error, laid so that the first fix is where "
            "dead reckoning had the rover then; the receiver counts from true north."
        )
    marks = " Numbers: marks, as in the list of events." if data.summary.marks else ""
    gaps = ""
    if np.diff(data.ticks["stretch"]).any():
        gaps = (
            " White diamonds: records are missing there. Nobody knows how the rover moved meanwhile; the way goes on "
            "where it broke off."
        )
    return (
        "The way by dead reckoning (measured motion, else the wheels' commands; the compass), from where the log "
        f"begins; magnetic north is up. An error of the compass turns it, slip stretches it.{gaps}{fixes}{marks}"
    )


def track_alt(data: RunData) -> str:
    """Say in words what the drawing of the way shows."""
    return f"Map of the way: {_way(data)}; it ended {_where(data)}. {_anomalies(data)}"


def forest_caption(data: RunData) -> str:
    """Explain the drawing of a simulated run in its forest."""
    drift = drift_m(data)
    apart = "" if isnan(drift) else f" At the end they are {drift:.1f} m apart."
    return f"Where the simulated rover really went (coloured), and where dead reckoning had it (dashed).{apart}"


def forest_alt(data: RunData) -> str:
    """Say in words what the drawing of a simulated run in its forest shows."""
    return f"Map of the forest with trunks, trees, goal line and the true way of the rover. {forest_caption(data)}"


def timeline_caption(unplaced: int) -> str:
    """Explain the time lines."""
    left_out = f" {unplaced} labels found no room; the list of events has them." if unplaced else ""
    return (
        "Colours behind the lines: what the rover did; white: it stood. The heading is drawn around the first goal, so "
        "that nothing jumps at north. Lines are thinned without losing an extreme, and broken where nothing is known; "
        f"a late tick is one after which the gate holds the wheels.{left_out}"
    )


def timeline_alt(data: RunData) -> str:
    """Say in words what the time lines show."""
    return (
        "Time lines of anomalies, heading and goal, counter, tilt, speed, battery and control period over "
        f"{span(data.summary.lasted_s)}. {_anomalies(data)}"
    )


def _anomalies(data: RunData) -> str:
    told = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in data.summary.anomalies.items())
    return f"Anomalies: {told or 'none'}."
