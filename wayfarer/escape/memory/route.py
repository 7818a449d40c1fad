"""The cheapest way to the goal line: lazy A* over the places where a way may turn.

The goal line lies across the goal heading, beyond all that was met. A way is straight pieces; each costs its length and
the price of what it crosses. The distance left straight ahead never overestimates that, so the first way found is the
cheapest. To look at what a piece crosses is what takes time, so it is done only when the piece, as if it crossed
nothing, would be on the cheapest way (lazy A*): most pieces never are.
"""

from __future__ import annotations

from heapq import heappop, heappush
from math import hypot, inf
from typing import Final

from wayfarer.escape.memory.obstacle_map import Barrier, Point, price_m

# The goal line is this far beyond the last trunk: nothing depends on how far.
BEYOND_M: Final = 2.0
# A plan looks at no more pieces than this, each against all barriers: it must fit into a control tick. What was found
# by then is used.
MOST_PIECES: Final = 700


def find_way(start: Point, waypoints: list[Point], barriers: list[Barrier]) -> list[Point]:
    """Return the places to drive to, the nearest first; none where straight ahead is cheapest."""
    line_m = start[0]
    for barrier in barriers:
        line_m = max(line_m, barrier.ahead0_m, barrier.ahead1_m)
    line_m += BEYOND_M
    places = [start, *waypoints]
    came_from = [-1] * len(places)
    done = [False] * len(places)
    best_m, best_last = inf, 0
    pieces = 0
    # The least cost of a whole way, the cost so far, the place, the place before it, and whether the price of the piece
    # between the two is in both costs.
    queue: list[tuple[float, float, int, int, bool]] = [(line_m - start[0], 0.0, 0, -1, True)]
    while queue and pieces < MOST_PIECES:
        least_m, cost_m, here, before, priced = heappop(queue)
        if least_m >= best_m:
            break
        if done[here]:
            continue
        a, r = places[here]
        if not priced:
            pieces += 1
            more_m = price_m(barriers, places[before][0], places[before][1], a, r)
            if more_m > 0.0:
                heappush(queue, (least_m + more_m, cost_m + more_m, here, before, True))
                continue
        done[here], came_from[here] = True, before
        ahead_m = cost_m + (line_m - a) + price_m(barriers, a, r, line_m, r)
        pieces += 1
        if ahead_m < best_m:
            best_m, best_last = ahead_m, here
        for there in range(1, len(places)):
            if not done[there]:
                to_a, to_r = places[there]
                there_m = cost_m + hypot(to_a - a, to_r - r)
                if there_m + line_m - to_a < best_m:
                    heappush(queue, (there_m + line_m - to_a, there_m, there, here, False))
    way: list[Point] = []
    while best_last > 0:
        way.append(places[best_last])
        best_last = came_from[best_last]
    way.reverse()
    return way
