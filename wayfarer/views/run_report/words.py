"""Texts of one run's report."""

from __future__ import annotations

from collections.abc import Iterator
from math import isnan

import numpy as np

from wayfarer.fieldlog.fields import span
from wayfarer.fieldlog.printable import clean
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.track import drift_m
from wayfarer.views.text.summary_text import counted, distance_line, summary_facts, where_lines

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
    """Yield what ran, when, how far and how it ended, as ``wayfarer logs summary`` tells it. Times are UTC."""
    for title_, lines in summary_facts(clean(folder), data.summary, data.damage, utc=True):
        yield title_, "\n".join(lines)
    yield "goal", _goal(data)
    yield "seed", "unknown" if data.summary.seed is None else f"{data.summary.seed}"


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
    where = "; ".join(where_lines(data.summary.where, data.damage.missing))
    return f"Map of the way: {distance_line(data.summary)}; it ended {where}. {_anomalies(data)}"


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
    left_out = f" {unplaced} kinds of events found no room; the list of events has them." if unplaced else ""
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
    return f"Anomalies: {counted(data.summary.anomalies) or 'none'}."
