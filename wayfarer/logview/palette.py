"""The colours of everything that shows a run: the same on light and on dark ground. Pure.

M. Okabe, K. Ito, "Color Universal Design", 2008, without their light hues, which are hardly seen on white paper. VIOLET
is ours: of all colours it is the farthest from the others for every eye. Each colour has a contrast of 3 or more to
``PAPER`` and to ``NIGHT`` (WCAG 2.1, 1.4.11), and colour-blind people can distinguish all that are drawn in one map too
(G. Machado, 2009; ``tests/logview/test_palette.py`` computes both). ORANGE, SKY and SAND are for marks with a dark edge
only. MAGENTA, RED, SKY, SAND and INDIGO were searched for: of all colours they are far from the others.
"""

from __future__ import annotations

from collections.abc import Mapping

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.safety.conditions import Level

PAPER, NIGHT = "#ffffff", "#121412"  # the ground of a light and of a dark page
BLUE, VERMILION, GREEN, PURPLE, ORANGE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"
VIOLET, GREY, EDGE = "#9C6CFC", "#6E6E6E", "#4A4A4A"
MAGENTA, RED, SKY, SAND, INDIGO = "#CC00AA", "#CC0022", "#66CCFF", "#B4B49C", "#8800FF"
BRIGHTER = 1.2  # times each part of a colour, for the plots of reports on a dark page

PHASE_COLOURS: Mapping[str, str] = {
    Phase.FOLLOW.value: BLUE,
    Phase.PROBE.value: VERMILION,
    Phase.STRIDE.value: GREEN,
    Phase.TURN_AWAY.value: PURPLE,
    Phase.BACK_OFF.value: VIOLET,
    Phase.MANUAL.value: INDIGO,
}  # a rover that stands draws no path
STANDS = RECKONED = GREY  # no phase that moves, and the path by dead reckoning

# Distinguished by shape: Bokeh's name, and by how many degrees it is turned to the left. The triangles point to where
# the body tips.
ANOMALY_MARKERS: Mapping[str, tuple[str, float]] = {
    Anomaly.IMMOBILISED.value: ("circle", 0.0),
    Anomaly.NOSE_UP.value: ("triangle", 0.0),
    Anomaly.NOSE_DOWN.value: ("triangle", 180.0),
    Anomaly.RIGHT_DOWN.value: ("triangle", -90.0),
    Anomaly.LEFT_DOWN.value: ("triangle", 90.0),
    Anomaly.TOUCHED.value: ("square", 0.0),
}
ANOMALY, MARK, TROUBLE, PERSON, OTHER = ORANGE, PAPER, RED, SKY, SAND
LEVEL_COLOURS: Mapping[str, str] = {
    Level.DEGRADE.name.lower(): ORANGE,
    Level.HOLD.name.lower(): RED,
    Level.FAULT.name.lower(): PURPLE,
}
SERIES = (BLUE, VERMILION, GREEN, PURPLE, VIOLET)  # curves beside each other; with dashes for more
MEASURED, LIMIT = BLUE, VERMILION
RECEIVER = MAGENTA
TRUNK, TREE, GOAL_LINE = "#9C7A54", "#63926B", "#00804F"


def css() -> str:
    """Return the colours that the style and the scripts of a page use, as variables: a phase's by its name in a log."""
    named = {
        **PHASE_COLOURS, Phase.HALT.value: STANDS, "trunk": TRUNK, "tree": TREE, "goal-line": GOAL_LINE,
        "anomaly": ANOMALY, "mark-edge": EDGE, "paper": PAPER, "night": NIGHT, "brighter": BRIGHTER,
    }  # fmt: skip
    return f":root {{ {' '.join(f'--{name}: {value};' for name, value in named.items())} }}\n"
