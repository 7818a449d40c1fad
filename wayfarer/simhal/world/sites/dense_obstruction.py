"""Site *dense obstruction*: the rover starts in the middle of tightly cluttered fallen branches."""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt

from wayfarer.simhal.world.collision import Box
from wayfarer.simhal.world.generate import Draw
from wayfarer.simhal.world.sites.field_site import FieldSite, SiteLayout

START_M = (25.0, 20.0)
AHEAD_M = 5.0  # to the destination line, beyond the clutter
CLEAR_M = 0.5  # room in the middle for the rover to turn
FENCE, FENCE_FROM_M, FENCE_BRANCH_M = 8, (0.8, 1.3), (0.5, 1.0)  # branches that lie across each way out of there
MAX_TILT_DEG = 40.0
RING_M = (1.2, 4.0)  # where the middles of the other branches lie
BRANCHES = 55  # 1.2 in a square metre
BRANCH_M = (0.4, 2.0)
DIAMETER_M = (0.02, 0.14)
TREES = 4


def lay(draw: Draw) -> SiteLayout:
    """Draw the ground of one layout."""
    ground = SiteLayout(START_M, AHEAD_M)
    for number in range(FENCE):
        bearing_deg = (number + draw(0.0, 1.0)) * 360.0 / FENCE
        place_m = _away(draw(*FENCE_FROM_M), radians(bearing_deg))
        across_deg = bearing_deg + 90.0 + draw(-MAX_TILT_DEG, MAX_TILT_DEG)
        ground.lay_branch(place_m, across_deg, draw(*FENCE_BRANCH_M), draw(*DIAMETER_M))
    for _ in range(BRANCHES):
        ground.lay_branch(_in_the_ring(draw), draw(0.0, 180.0), draw(*BRANCH_M), draw(*DIAMETER_M))
    ground.keep_free(CLEAR_M)
    x_m, y_m = START_M
    around = Box(x_m - RING_M[1], y_m - RING_M[1], x_m + RING_M[1], y_m + RING_M[1])
    ground.place_trees(TREES, around, draw, clear_m=1.2)
    return ground


def _in_the_ring(draw: Draw) -> tuple[float, float]:
    """Return a place in the ring; any square metre of it is as likely as any other."""
    inner_m, outer_m = RING_M
    from_start_m = sqrt(draw(inner_m * inner_m, outer_m * outer_m))
    return _away(from_start_m, draw(0.0, 2.0 * pi))


def _away(distance_m: float, bearing_rad: float) -> tuple[float, float]:
    return START_M[0] + distance_m * sin(bearing_rad), START_M[1] + distance_m * cos(bearing_rad)


DENSE_OBSTRUCTION = FieldSite("dense-obstruction", 300.0, lay)
