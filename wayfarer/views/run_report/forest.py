"""A forest seen from above, to scale."""

from __future__ import annotations

import numpy as np
from bokeh.plotting import ColumnDataSource

from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure

CAP = np.linspace(-np.pi / 2.0, np.pi / 2.0, 7)  # the round end of a trunk, by its corners


def draw_forest(map_: Figure, forest: Forest) -> None:
    """Draw trunks, trees, the goal line, and the edge of the world."""
    capsules = [_capsule(complex(t.x0_m, t.y0_m), complex(t.x1_m, t.y1_m), d / 2.0) for t, d in forest.thick_trunks]
    map_.patches(
        [capsule.real.tolist() for capsule in capsules], [capsule.imag.tolist() for capsule in capsules],
        fill_color=palette.TRUNK, line_color=None, fill_alpha=0.8,
    )  # fmt: skip
    x_m, y_m = np.array(forest.trees_m, dtype=np.float32).reshape(-1, 2).T
    map_.circle(
        "x", "y", radius=forest.tree_radius_m, source=ColumnDataSource({"x": x_m, "y": y_m}),
        fill_color=palette.TREE, line_color=None, fill_alpha=0.8,
    )  # fmt: skip
    map_.line([0.0, WORLD_SIZE_M], [forest.goal_y_m] * 2, line_color=palette.GOAL_LINE, line_width=3)
    edge_m = np.array([0.0, 1.0, 1.0, 0.0, 0.0]) * WORLD_SIZE_M
    map_.line(edge_m, np.roll(edge_m, 1), line_color=palette.GREY, line_width=0.5)


def _capsule(first: complex, last: complex, radius_m: float) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    """Return the outline of all points within a radius of a straight line."""
    along = (last - first) / (abs(last - first) or 1.0)
    ahead = radius_m * along * np.exp(1j * CAP)
    return np.concatenate([last + ahead, first - ahead])
