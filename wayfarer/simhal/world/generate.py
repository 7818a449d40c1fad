"""Generates forests like those of the paper's abstract simulation, from a seed.

Fallen branches come from recursive division: a square inside the world is cut by a branch into two regions,
each of which is cut again until it is too small. Each branch is tilted about its middle, has one gap to pass
through, and is cut away where the rover starts; the regions ignore the tilt, so branches cross, or end short
of each other. Trees then stand at places where they touch nothing.

Figures are those of the paper (section IV-A) and of its released simulator, whose square is 100 units of
0.385 m. Only ``Generator.random`` is drawn from and every coordinate is a whole millimetre, so that a forest
outlives other versions of numpy and other machines.

No forest is checked for a way out, which would cost more than drawing it: of 52,000 forests not one was
closed to a rover 0.4 m wide, and of 12,000 not one to a rover 0.8 m wide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import hypot, radians, tan

from numpy.random import PCG64, Generator, SeedSequence

from wayfarer.simhal.world.collision import Box, Span, span_inside
from wayfarer.simhal.world.forest import TREES_PER_HA, WORLD_SIZE_M, Forest, Trunk

START_M = (25.0, 12.5)
TRUNK_DIAMETER_M = 0.3
TREE_RADIUS_M = 0.25
WORLD_HA = WORLD_SIZE_M**2 / 10_000.0
TREELESS_START_M = 1.5  # half the side of the square around the start that trees keep out of

MIN_SIDE_M = 9.625  # 25 units: a region is cut while both of its sides have at least this
MAX_TILT_DEG = 20.0
MIDDLE_OF_GAP = (0.3, 0.7)  # as a share of the branch
GAP_M = (1.925, 7.7)  # 5 to 20 units
SHORTEST_PIECE_M = 0.05

# Keys of the random streams: to change one is to change every forest.
TRUNK_STREAM = 1
TREE_STREAM = 2

Draw = Callable[[float, float], float]  # a uniform number between two others


DIVIDED = Box(6.375, 5.5, 44.875, 44.0)  # 38.5 m square
START_AREA = Box(20.733, 11.773, 30.517, 13.857)  # free of centre lines, so that the start is free of trunks


def generate_forest(layout: int, noise: int, seed: int, trees_per_ha: float = TREES_PER_HA) -> Forest:
    """Return the forest of these numbers: always the same, independent of other random draws.

    Fallen trunks depend on ``layout`` and ``seed``, standing trees on ``noise`` too; a denser forest has the trees of a
    sparser one, and more. There is room for 1,000 trees a hectare.

    Raises:
        ValueError: a negative number.
    """
    trunks = tuple(_fallen_trunks(draw_from(seed, TRUNK_STREAM, layout)))
    return Forest(
        forest=layout,
        noise=noise,
        start_m=START_M,
        heading_deg=0.0,
        goal_y_m=WORLD_SIZE_M,
        trunk_diameter_m=TRUNK_DIAMETER_M,
        tree_radius_m=TREE_RADIUS_M,
        trunks=trunks,
        trees_m=_standing_trees(round(trees_per_ha * WORLD_HA), trunks, draw_from(seed, TREE_STREAM, layout, noise)),
    )


def draw_from(seed: int, *key: int) -> Draw:
    """Return the uniform numbers of one random stream."""
    random = Generator(PCG64(SeedSequence(seed, spawn_key=key))).random
    return lambda low, high: low + (high - low) * random()


def _fallen_trunks(draw: Draw) -> Iterator[Trunk]:
    """Yield what is left of each branch without its gap, the area of the start and all outside the square."""
    for branch, gap in _branches(DIVIDED, draw):
        spans = [span_inside(branch[:4], DIVIDED)]
        for hole in (gap, span_inside(branch[:4], START_AREA)):
            spans = [part for span in spans for part in _without(span, hole)]
        pieces = [_piece(branch, span) for span in spans]
        yield from (piece for piece in pieces if piece.length_m >= SHORTEST_PIECE_M)


def _branches(region: Box, draw: Draw) -> Iterator[tuple[Trunk, Span]]:
    """Yield the whole branches, with their gaps, that cut a region and then the two regions it falls into.

    A side shorter than two minimal sides leaves no place that is a minimal side away from both ends; the cut
    is then drawn between the same two bounds, the other way round.
    """
    west_m, south_m, east_m, north_m = region
    if min(east_m - west_m, north_m - south_m) < MIN_SIDE_M:
        return
    slope = tan(radians(draw(-MAX_TILT_DEG, MAX_TILT_DEG)))
    if draw(0.0, 1.0) < 0.5:
        cut_m = draw(south_m + MIN_SIDE_M, north_m - MIN_SIDE_M)
        shift_m = slope * (east_m - west_m) / 2.0
        branch = Trunk(west_m, cut_m - shift_m, east_m, cut_m + shift_m, "across")
        halves = (region._replace(north_m=cut_m), region._replace(south_m=cut_m))
    else:
        cut_m = draw(west_m + MIN_SIDE_M, east_m - MIN_SIDE_M)
        shift_m = slope * (north_m - south_m) / 2.0
        branch = Trunk(cut_m - shift_m, south_m, cut_m + shift_m, north_m, "right" if slope > 0.0 else "left")
        halves = (region._replace(east_m=cut_m), region._replace(west_m=cut_m))
    middle, half_gap = draw(*MIDDLE_OF_GAP), draw(*GAP_M) / branch.length_m / 2.0
    yield branch, (middle - half_gap, middle + half_gap)  # in a short branch the gap may reach past an end
    for half in halves:
        yield from _branches(half, draw)


def _without(span: Span, hole: Span) -> Iterator[Span]:
    """Yield the parts of a span, up to two, that a hole leaves."""
    low, high = span
    if low < hole[0]:
        yield low, min(high, hole[0])
    if hole[1] < high:
        yield max(low, hole[1]), high


def _piece(branch: Trunk, span: Span) -> Trunk:
    """Return part of a branch, its ends on whole millimetres."""
    dx_m, dy_m = branch.x1_m - branch.x0_m, branch.y1_m - branch.y0_m
    low, high = span
    return Trunk(
        round(branch.x0_m + low * dx_m, 3),
        round(branch.y0_m + low * dy_m, 3),
        round(branch.x0_m + high * dx_m, 3),
        round(branch.y0_m + high * dy_m, 3),
        branch.lean,
    )


def _standing_trees(count: int, trunks: tuple[Trunk, ...], draw: Draw) -> tuple[tuple[float, float], ...]:
    """Return trees that stand wholly in the world and touch neither a trunk nor another tree."""
    trees_m: list[tuple[float, float]] = []
    around = [(trunk, _around(trunk)) for trunk in trunks]
    while len(trees_m) < count:
        x_m = round(draw(TREE_RADIUS_M, WORLD_SIZE_M - TREE_RADIUS_M), 3)
        y_m = round(draw(TREE_RADIUS_M, WORLD_SIZE_M - TREE_RADIUS_M), 3)
        beside = [trunk for trunk, box in around if box[0] < x_m < box[2] and box[1] < y_m < box[3]]
        if _has_room(x_m, y_m, beside, trees_m):
            trees_m.append((x_m, y_m))
    return tuple(trees_m)


def _around(trunk: Trunk) -> Box:
    """Return a box; outside it a tree cannot touch the trunk."""
    reach_m = TREE_RADIUS_M + TRUNK_DIAMETER_M
    x0_m, y0_m, x1_m, y1_m, _ = trunk
    return Box(
        min(x0_m, x1_m) - reach_m, min(y0_m, y1_m) - reach_m, max(x0_m, x1_m) + reach_m, max(y0_m, y1_m) + reach_m
    )


def _has_room(x_m: float, y_m: float, trunks: list[Trunk], trees_m: list[tuple[float, float]]) -> bool:
    """Whether a tree can stand there, beside these trunks and trees."""
    from_start_m = max(abs(x_m - START_M[0]), abs(y_m - START_M[1]))
    return (
        from_start_m > TREELESS_START_M
        and all(hypot(x_m - other_x_m, y_m - other_y_m) > 2.0 * TREE_RADIUS_M for other_x_m, other_y_m in trees_m)
        and all(trunk.distance_m(x_m, y_m) > TREE_RADIUS_M + TRUNK_DIAMETER_M / 2.0 for trunk in trunks)
    )
