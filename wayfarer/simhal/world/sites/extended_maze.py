"""Site *extended maze*: large fallen branches that form barriers, with few gaps and pockets between them."""

from __future__ import annotations

from wayfarer.simhal.world.collision import Box
from wayfarer.simhal.world.generate import Draw
from wayfarer.simhal.world.sites.field_site import FieldSite, SiteLayout

START_M = (25.0, 20.0)
AHEAD_M = 7.0  # to the destination line: MiniRover took 51 s (paper), in which it drives 15 m at most
BARRIERS_M = (1.5, 3.3, 5.1)  # ahead of the start, give or take
SHIFT_M = 0.3
HALF_BARRIER_M = (3.5, 5.5)  # how far a barrier reaches to each side of the start's meridian
BRANCH_M = (1.2, 3.5)
DIAMETER_M = (0.08, 0.3)
MAX_TILT_DEG = 15.0
NARROW_GAP_M = (0.25, 0.45)  # between two branches: MiniRover fits through, ForestRover through few
WIDE_GAP_M = (0.7, 1.3)  # one in each barrier
SPUR_M = (0.8, 1.5)  # a branch that lies along the way before a barrier makes a pocket of it
SPURS = 2  # at each barrier
TWIGS, TWIG_M, TWIG_DIAMETER_M = 12, (0.4, 1.5), (0.01, 0.06)
SOUTH_M = 2.0  # behind the start there is clutter as well
TREES = 8


def lay(draw: Draw) -> SiteLayout:
    """Draw the ground of one layout."""
    ground = SiteLayout(START_M, AHEAD_M)
    for ahead_m in BARRIERS_M:
        _lay_barrier(ground, START_M[1] + ahead_m + draw(-SHIFT_M, SHIFT_M), draw)
    around = Box(START_M[0] - 5.0, START_M[1] - SOUTH_M, START_M[0] + 5.0, START_M[1] + AHEAD_M)
    for _ in range(TWIGS):
        middle_m = draw(around.west_m, around.east_m), draw(around.south_m, around.north_m)
        ground.lay_branch(middle_m, draw(0.0, 180.0), draw(*TWIG_M), draw(*TWIG_DIAMETER_M))
    ground.place_trees(TREES, around, draw, clear_m=1.0)
    return ground


def _lay_barrier(ground: SiteLayout, y_m: float, draw: Draw) -> None:
    """Lay branches from west to east, end to end but for gaps of which one is wide; spurs point back to the start."""
    west_m, east_m = START_M[0] - draw(*HALF_BARRIER_M), START_M[0] + draw(*HALF_BARRIER_M)
    wide_from_m = draw(west_m + BRANCH_M[0], east_m - BRANCH_M[0])
    x_m, has_wide_gap = west_m, False
    while x_m < east_m:
        length_m = draw(*BRANCH_M)
        middle_m = x_m + length_m / 2.0, y_m + draw(-SHIFT_M, SHIFT_M) / 2.0
        ground.lay_branch(middle_m, 90.0 + draw(-MAX_TILT_DEG, MAX_TILT_DEG), length_m, draw(*DIAMETER_M))
        x_m += length_m
        is_wide = not has_wide_gap and x_m >= wide_from_m
        has_wide_gap |= is_wide
        x_m += draw(*(WIDE_GAP_M if is_wide else NARROW_GAP_M))
    for _ in range(SPURS):
        spur_m = draw(*SPUR_M)
        place_m = draw(west_m, east_m), y_m - spur_m / 2.0
        ground.lay_branch(place_m, draw(-MAX_TILT_DEG, MAX_TILT_DEG), spur_m, draw(*DIAMETER_M))


EXTENDED_MAZE = FieldSite("extended-maze", 300.0, lay)
