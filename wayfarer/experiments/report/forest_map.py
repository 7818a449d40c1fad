"""Drawing of a forest seen from above and of a path through it, shared by all figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.patches import Circle

from wayfarer.escape.api import Phase
from wayfarer.experiments.report.drawing import BLACK, BLUE, GREY, ORANGE, PURPLE, VERMILION, Style
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest

MARGIN_M = 1.5  # around the map: a rover may leave it
TRUNK, TREE, GOAL = "#a3a3a3", "#B7D3B0", "#00754A"


class Stroke(NamedTuple):
    """How the way is drawn while some phases last."""

    text: str
    phases: tuple[Phase, ...]
    colour: str
    width: float


# Told apart by lightness too, for a page printed in grey.
STROKES = (
    Stroke("follow the goal", (Phase.FOLLOW,), BLUE, 1.1),
    Stroke("probe", (Phase.PROBE,), ORANGE, 1.1),
    Stroke("stride", (Phase.STRIDE,), PURPLE, 1.1),
    Stroke("back off, turn away", (Phase.BACK_OFF, Phase.TURN_AWAY, Phase.HALT), BLACK, 1.1),
)
START: Style = {"marker": "*", "markersize": 9, "color": VERMILION, "markeredgecolor": "white", "markeredgewidth": 0.5}
SLIP: Style = {"marker": "o", "markersize": 2.8, "color": "#C1121F", "markeredgecolor": "white", "markeredgewidth": 0.3}
END: Style = {"marker": "X", "markersize": 6, "color": BLACK, "markeredgecolor": "white", "markeredgewidth": 0.5}
GOAL_LINE: Style = {"color": GOAL, "linewidth": 2.2}


def draw_forest(axes: Axes, forest: Forest, points_per_m: float) -> None:
    """Draw trunks and trees to scale, the goal line and the edge of the map."""
    lines = [((trunk.x0_m, trunk.y0_m), (trunk.x1_m, trunk.y1_m)) for trunk in forest.trunks]
    thick = [max(1.0, diameter_m * points_per_m) for _, diameter_m in forest.thick_trunks]
    axes.add_collection(LineCollection(lines, colors=TRUNK, linewidths=thick, capstyle="round", zorder=1.5))
    trees = [Circle(tree_m, forest.tree_radius_m) for tree_m in forest.trees_m]
    axes.add_collection(PatchCollection(trees, facecolor=TREE, edgecolor=GOAL, linewidth=0.7, zorder=1.4))
    axes.plot([0.0, WORLD_SIZE_M], [forest.goal_y_m] * 2, zorder=1.3, label="goal line", **GOAL_LINE)
    edge_m = [(0.0, 0.0), (0.0, WORLD_SIZE_M), (WORLD_SIZE_M, WORLD_SIZE_M), (WORLD_SIZE_M, 0.0), (0.0, 0.0)]
    axes.plot(*columns(edge_m), color=GREY, linewidth=0.5, zorder=1)


def columns(points_m: Sequence[tuple[float, ...]]) -> tuple[list[float], list[float]]:
    """Return the x and the y of points apart, as matplotlib wants them."""
    return [point[0] for point in points_m], [point[1] for point in points_m]
