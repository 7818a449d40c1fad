"""Marks shared by the figures of one run: colours, symbols and names of anomalies, phases and events."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from wayfarer.escape.api import Phase
from wayfarer.fieldlog.fields import name, number, span
from wayfarer.views.run_report.data import GAP_S, PHASES, Floats, LoggedEvent, RunData
from wayfarer.views.run_report.drawing import BLACK, GREEN, GREY, ORANGE, SKY, VERMILION
from wayfarer.views.run_report.forest_map import STROKES
from wayfarer.views.text.wording import Tone, event_tone

# Told apart by shape alone; the triangles point to where the body tips.
ANOMALY_MARKS = {
    "immobilised": ("o", VERMILION),
    "nose_up": ("^", GREEN),
    "nose_down": ("v", GREEN),
    "right_down": (">", GREEN),
    "left_down": ("<", GREEN),
    "touched": ("s", SKY),
}
LEVEL_COLOURS = {"degrade": "#F3DFA8", "hold": ORANGE, "fault": VERMILION}

LONGEST = 30  # letters of a mark that stand in a figure; the list of events has all
AGAIN = 0.04  # of the run: the same event again so soon is counted, not labelled again
UNLABELLED = {"opened", "arming", "wheels_stopped"}
MARK_RANK, TROUBLE_RANK, HAND_RANK, OTHER_RANK = range(4)


class Labelled(NamedTuple):
    """An event with a label: rank 0 is the most worth to be seen."""

    t_s: float
    text: str
    rank: int
    colour: str


def anomaly_style(kind: str, size_pt: float) -> dict[str, Any]:
    """Return how an anomaly is marked."""
    marker, colour = ANOMALY_MARKS[kind]
    return {
        "linestyle": "none", "marker": marker, "markersize": size_pt, "color": colour, "markeredgecolor": BLACK,
        "markeredgewidth": 0.5,
    }  # fmt: skip


def stroke_of(phases: Floats) -> Floats:
    """Return for each phase which of ``STROKES`` draws it; standing still and what is not known have none (NaN)."""
    strokes = [
        next((float(at) for at, stroke in enumerate(STROKES) if Phase(phase) in stroke.phases), np.nan)
        if phase != Phase.HALT.value
        else np.nan
        for phase in PHASES
    ]
    return np.array([*strokes, np.nan])[np.where(np.isnan(phases), len(strokes), phases).astype(np.intp)]


def labelled(data: RunData) -> list[Labelled]:
    """Return the labels of a run in the order of time."""
    events = [_label(event) for event in data.events if _tells(event)]
    return _counted(sorted([*events, *_silences(data)]), AGAIN * data.summary.lasted_s)


def _tells(event: LoggedEvent) -> bool:
    """Leave out what another label or the band of holds says as well."""
    if event.name == "health":
        return event.record.get("level") != "well" and event.record.get("cause") != "operator_hold"
    return event.name not in UNLABELLED


def _label(event: LoggedEvent) -> Labelled:
    trouble = is_trouble(event)
    by_hand = event_tone(event.record) is Tone.PERSON
    rank = MARK_RANK if event.mark else TROUBLE_RANK if trouble else HAND_RANK if by_hand else OTHER_RANK
    return Labelled(event.t_s, event_label(event), rank, VERMILION if trouble else BLACK)


def is_trouble(event: LoggedEvent) -> bool:
    """Return whether an event tells of something that went wrong; a hold that somebody asked for did not."""
    tone = event_tone(event.record)
    return tone in (Tone.WARNING, Tone.FAULT) and event.record.get("cause") != "operator_hold"


def event_label(event: LoggedEvent) -> str:
    """Return an event in a few words."""
    record = event.record
    if event.mark:
        text = name(record, "text") or ""
        return f"{event.mark} {text if len(text) <= LONGEST else text[: LONGEST - 1] + '…'}".rstrip()
    if event.name == "goal" and (goal_deg := number(record, "goal_heading_deg")) is not None:
        return f"goal {goal_deg:.0f}°"
    if event.name == "health":
        return (name(record, "cause") or "health").replace("_", " ")
    if event.name == "sensor_failed":
        return f"{name(record, 'sensor') or 'sensor'} failed"
    if event.name == "clock_step" and (by_s := number(record, "by_s")) is not None:
        return f"clock {by_s:+.0f} s"
    return event.name.replace("_", " ")[:LONGEST]


def _silences(data: RunData) -> Iterator[Labelled]:
    """Yield the times in which nothing was logged of the control loop."""
    for before_s, t_s in pairwise(data.ticks["t_s"].tolist()):
        if t_s - before_s > GAP_S:
            yield Labelled(before_s, f"no ticks for {span(t_s - before_s, 1)}", TROUBLE_RANK, GREY)


def _counted(labels: list[Labelled], within_s: float) -> list[Labelled]:
    """Return labels in which repeats are counted where they began."""
    last_s: dict[str, float] = {}
    counts: list[tuple[Labelled, int]] = []
    at: dict[str, int] = {}
    for label in labels:
        if label.text in at and label.t_s - last_s[label.text] <= within_s:
            first, count = counts[at[label.text]]
            counts[at[label.text]] = (first, count + 1)
        else:
            at[label.text] = len(counts)
            counts.append((label, 1))
        last_s[label.text] = label.t_s
    return [label if count == 1 else label._replace(text=f"{label.text} ({count} times)") for label, count in counts]
