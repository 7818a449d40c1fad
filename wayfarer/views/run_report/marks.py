"""Marks shared by the figures of one run: colours and symbols of anomalies, phases and levels."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayfarer.escape.api import Phase
from wayfarer.fieldlog.wording import Tone, event_tone
from wayfarer.views.run_report.data import PHASES, Floats, LoggedEvent
from wayfarer.views.run_report.drawing import BLACK, GREEN, ORANGE, SKY, VERMILION
from wayfarer.views.run_report.forest_map import STROKES

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


def is_trouble(event: LoggedEvent) -> bool:
    """Return whether an event tells of something that went wrong; a hold that somebody asked for did not."""
    tone = event_tone(event.record)
    return tone in (Tone.WARNING, Tone.FAULT) and event.record.get("cause") != "operator_hold"
