"""The cheapest way to the goal line: A* over the places where a way may turn.

The goal line lies across the goal heading, beyond all that was met. A way is straight pieces; each costs its length and
the price of what it crosses. The distance left straight ahead never overestimates that, so the first way found is the
cheapest.
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
    cost_m = [inf] * len(places)
    came_from = [-1] * len(places)
    done = [False] * len(places)
    cost_m[0] = 0.0
    best_m, best_last = inf, 0
    pieces = 0
    queue: list[tuple[float, int]] = [(line_m - start[0], 0)]
    while queue and pieces < MOST_PIECES:
        least_m, here = heappop(queue)
        if least_m >= best_m:
            break
        if done[here]:
            continue
        done[here] = True
        a, r = places[here]
        ahead_m = cost_m[here] + (line_m - a) + price_m(barriers, a, r, line_m, r)
        pieces += 1
        if ahead_m < best_m:
            best_m, best_last = ahead_m, here
        for there in range(1, len(places)):
            if done[there]:
                continue
            to_a, to_r = places[there]
            there_m = cost_m[here] + hypot(to_a - a, to_r - r)
            if there_m >= cost_m[there] or there_m + line_m - to_a >= best_m:
                continue  # before it is looked at what the piece crosses: most end here
            there_m += price_m(barriers, a, r, to_a, to_r)
            pieces += 1
            if there_m < cost_m[there]:
                cost_m[there], came_from[there] = there_m, here
                heappush(queue, (there_m + line_m - to_a, there))
    way: list[Point] = []
    while best_last > 0:
        way.append(places[best_last])
        best_last = came_from[best_last]
    way.reverse()
    return way
