"""The cheapest way to the goal line: A* over the places past the ends of trunks."""

from __future__ import annotations

from heapq import heappop, heappush
from math import hypot

from wayfarer.escape.memory.trunks import Barrier, Point, crosses


def cross_price(barriers: list[Barrier], a0: float, r0: float, a1: float, r1: float) -> float:
    """Return the price of what a straight piece crosses."""
    price = 0.0
    lo_a, hi_a = (a0, a1) if a0 < a1 else (a1, a0)
    lo_r, hi_r = (r0, r1) if r0 < r1 else (r1, r0)
    for b in barriers:
        ba0, br0, ba1, br1, p = b
        if (ba0 < lo_a and ba1 < lo_a) or (ba0 > hi_a and ba1 > hi_a):
            continue
        if (br0 < lo_r and br1 < lo_r) or (br0 > hi_r and br1 > hi_r):
            continue
        if crosses(a0, r0, a1, r1, ba0, br0, ba1, br1):
            price += p
    return price


def plan(start: Point, nodes: list[Point], barriers: list[Barrier], beyond_m: float, heading: Point = (0.0, 0.0), turn_m: float = 0.0, hand: float = 0.0, switch_m: float = 0.0) -> tuple[list[Point], float]:
    """Return the waypoints (without the start; empty if straight ahead is best) and the cost."""
    line_a = max([start[0], *(max(b.a0, b.a1) for b in barriers)]) + beyond_m
    places = [start, *nodes]
    n = len(places)
    best = [1e18] * n
    came = [-1] * n
    closed = [False] * n
    best[0] = 0.0
    goal_cost, goal_from = 1e18, 0
    heap: list[tuple[float, int]] = [(line_a - start[0], 0)]
    while heap:
        f, i = heappop(heap)
        if f >= goal_cost:
            break
        if closed[i]:
            continue
        closed[i] = True
        a, r = places[i]
        g = best[i]
        straight = g + (line_a - a) + cross_price(barriers, a, r, line_a, r)
        if i == 0:
            straight += turn_m * (1.0 - heading[0])
        if straight < goal_cost:
            goal_cost, goal_from = straight, i
        for j in range(1, n):
            if closed[j]:
                continue
            b, s = places[j]
            length = hypot(b - a, s - r)
            d = g + length
            if i == 0 and length > 0.0:
                d += turn_m * (1.0 - (heading[0] * (b - a) + heading[1] * (s - r)) / length)
                if hand * (heading[0] * (s - r) - heading[1] * (b - a)) < 0.0:
                    d += switch_m
            if d >= best[j] or d + line_a - b >= goal_cost:
                continue
            d += cross_price(barriers, a, r, b, s)
            if d < best[j]:
                best[j] = d
                came[j] = i
                heappush(heap, (d + line_a - b, j))
    way: list[Point] = []
    i = goal_from
    while i > 0:
        way.append(places[i])
        i = came[i]
    way.reverse()
    return way, goal_cost - (line_a - start[0])
