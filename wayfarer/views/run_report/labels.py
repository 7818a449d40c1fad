"""Placement of labels beside a time axis without overlap."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import count
from math import cos, hypot, sin, tau
from typing import NamedTuple

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath

SIZE_PT = 7.0
ROUNDING_PT = 1e-6
APART_PT = 5.0  # between two labels of a lane


class Label(NamedTuple):
    """A text that belongs to a place on the axis, in points from its left end; rank 0 is placed first."""

    text: str
    at_pt: float
    rank: int
    colour: str


class PlacedLabel(NamedTuple):
    """Where a label goes: its lane counts from 0, the top; ``left_pt`` is where its text begins."""

    label: Label
    lane: int
    left_pt: float


def place(labels: Sequence[Label], room_pt: float, lanes: int) -> list[PlacedLabel]:
    """Return where labels go that find room, in the order in which they were given.

    A text begins at its place, or ends there where it would leave the axis on the right. What finds no free lane is
    left out.
    """
    taken: list[list[tuple[float, float]]] = [[] for _ in range(lanes)]
    found: dict[int, PlacedLabel] = {}
    for index in sorted(range(len(labels)), key=lambda index: labels[index].rank):
        label = labels[index]
        width_pt = text_width_pt(label.text)
        left_pt = label.at_pt if label.at_pt + width_pt <= room_pt else max(0.0, label.at_pt - width_pt)
        span = (left_pt, left_pt + width_pt)
        lane = next((lane for lane in range(lanes) if _is_free(taken[lane], span)), None)
        if lane is not None:
            taken[lane].append(span)
            found[index] = PlacedLabel(label, lane, left_pt)
    return [found[index] for index in sorted(found)]


@cache
def text_width_pt(text: str) -> float:
    """Return how wide a text is in the font of the figures."""
    font = FontProperties(family="DejaVu Sans", size=SIZE_PT)
    width_pt, _, _ = TextToPath().get_text_width_height_descent(text, font, False)
    return float(width_pt)


def _is_free(taken: list[tuple[float, float]], span: tuple[float, float]) -> bool:
    return all(span[1] + APART_PT <= left or right + APART_PT <= span[0] for left, right in taken)


def spread(places_pt: Sequence[tuple[float, float]], size_pt: float) -> list[tuple[float, float]]:
    """Return where badges go, each as near to its place as can be without lying on the place or on another badge."""
    taken: list[tuple[float, float]] = []
    for x_pt, y_pt in places_pt:
        around = (
            (x_pt + ring * size_pt * cos(turn), y_pt + ring * size_pt * sin(turn))
            for ring in count(1)
            for turn in (tau * (step + 0.5) / (6 * ring) for step in range(6 * ring))
        )
        taken.append(
            next(at for at in around if all(hypot(at[0] - x, at[1] - y) >= size_pt - ROUNDING_PT for x, y in taken))
        )
    return taken
