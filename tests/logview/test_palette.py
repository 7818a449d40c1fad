"""Every colour is seen on light and on dark ground, and colour-blind readers tell those of one map apart."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.logview import palette
from wayfarer.remote.live.server import document
from wayfarer.reports.page.html import write_page
from wayfarer.reports.page.plots import Plots

CONTRAST = 3.0  # WCAG 2.1, success criterion 1.4.11
APART = 0.06  # of OKLab: three times the difference that is just noticeable, 0.02
# G. Machado, M. Oliveira, L. Fernandes, "A Physiologically-based Model for Simulation of Color Vision Deficiency",
# 2009, at severity 1.0.
EYES = {
    "usual": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
# B. Ottosson, "A perceptual color space for image processing", 2020.
TO_CONES = np.array(
    [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
     [0.0883024619, 0.2817188376, 0.6299787005]]
)  # fmt: skip
TO_OKLAB = np.array(
    [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
     [0.0259040371, 0.7827717662, -0.8086757660]]
)  # fmt: skip

Triple = NDArray[np.float64]


def linear(colour: str) -> Triple:
    """Linear red, green and blue of sRGB (IEC 61966-2-1)."""
    part = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def contrast(first: str, second: str) -> float:
    low, high = sorted(float(linear(colour) @ [0.2126, 0.7152, 0.0722]) for colour in (first, second))
    return (high + 0.05) / (low + 0.05)


def brighter(colour: str) -> str:
    """The colour as a browser shows it in the plots of reports on a dark page."""
    parts = (min(255, round(palette.BRIGHTER * int(colour[at : at + 2], 16))) for at in (1, 3, 5))
    return f"#{bytes(parts).hex()}"


def seen(colour: str, eye: Triple) -> Triple:
    return np.asarray(TO_OKLAB @ np.cbrt(TO_CONES @ np.clip(eye @ linear(colour), 0.0, 1.0)))


@pytest.mark.parametrize("ground", [palette.PAPER, palette.NIGHT])
def test_colours_stand_out_from_the_ground(ground: str) -> None:
    lines = {
        *palette.PHASE_COLOURS.values(), *palette.SERIES, palette.RECKONED, palette.RECEIVER,
        palette.TROUBLE, palette.TRUNK, palette.TREE, palette.GOAL_LINE,
    }  # fmt: skip
    assert {colour: contrast(colour, ground) for colour in lines if contrast(colour, ground) < CONTRAST} == {}


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("eye", EYES)
def test_all_that_is_drawn_in_one_map_is_told_apart_by_every_eye(eye: str, dark: bool) -> None:
    drawn = {
        **palette.PHASE_COLOURS, "reckoned": palette.RECKONED, "receiver": palette.RECEIVER, "anomaly": palette.ANOMALY,
        "mark": palette.MARK, "trouble": palette.TROUBLE, "operator": palette.PERSON, "other": palette.OTHER,
    }  # fmt: skip
    colours = {name: seen(brighter(colour) if dark else colour, EYES[eye]) for name, colour in drawn.items()}
    near = {(one, two): float(np.linalg.norm(colours[one] - colours[two])) for one, two in combinations(colours, 2)}
    assert {pair: apart for pair, apart in near.items() if apart < APART} == {}


def test_every_phase_that_moves_and_every_anomaly_has_a_look() -> None:
    assert set(palette.PHASE_COLOURS) == {phase.value for phase in Phase} - {Phase.HALT.value}
    assert set(palette.ANOMALY_MARKERS) == {anomaly.value for anomaly in Anomaly}
    assert len(set(palette.ANOMALY_MARKERS.values())) == len(palette.ANOMALY_MARKERS)
    assert all(f"--{phase.value}:" in palette.css() for phase in Phase)


def test_pages_take_the_phases_from_the_palette(tmp_path: Path) -> None:
    live, report = document().html.decode(), write_page(tmp_path / "page.html", "A page", [], Plots()).read_text()
    assert all(palette.css() in page for page in (live, report))
