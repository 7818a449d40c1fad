"""Site *forest escape*: 45 m of woodland to a path, with GPS for the log (paper, section IV-C)."""

from __future__ import annotations

from wayfarer.simhal.world.collision import Box
from wayfarer.simhal.world.forest import WORLD_SIZE_M
from wayfarer.simhal.world.generate import Draw
from wayfarer.simhal.world.sites.field_site import FieldSite, SiteLayout

START_M = (25.0, 2.5)
AHEAD_M = 45.0  # paper: the shortest distance to the path
WORLD = Box(0.5, 0.5, WORLD_SIZE_M - 0.5, WORLD_SIZE_M - 0.5)
TREES = 100  # 400 a hectare: an open broad-leaved wood; the paper's simulation has 80
LARGE, LARGE_M, LARGE_DIAMETER_M = 40, (2.0, 7.0), (0.08, 0.3)
SMALL, SMALL_M, SMALL_DIAMETER_M = 120, (0.4, 2.0), (0.01, 0.1)
CLEAR_M = 0.6


def lay(draw: Draw) -> SiteLayout:
    """Draw the ground of one layout."""
    ground = SiteLayout(START_M, AHEAD_M)
    for count, length_m, diameter_m in ((LARGE, LARGE_M, LARGE_DIAMETER_M), (SMALL, SMALL_M, SMALL_DIAMETER_M)):
        for _ in range(count):
            middle_m = draw(WORLD.west_m, WORLD.east_m), draw(WORLD.south_m, WORLD.north_m)
            ground.lay_branch(middle_m, draw(0.0, 180.0), draw(*length_m), draw(*diameter_m))
    ground.keep_free(CLEAR_M)
    ground.place_trees(TREES, WORLD, draw, clear_m=1.5)
    return ground


FOREST_ESCAPE = FieldSite("forest-escape", 900.0, lay, has_receiver=True)
