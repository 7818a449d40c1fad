"""What was met so far: trunks, as lines through the places where the rover was stopped.

All places are of the rover's *middle*, in metres ahead along and right of the goal heading. So a line is where the
middle cannot pass, and a way may run right along it: the body has its half width to the wood.
"""

from __future__ import annotations

from math import hypot
from typing import Final, NamedTuple

Point = tuple[float, float]

# What depends on the body is in widths of it, so that it fits each rover; how long trunks are does not, and is in
# metres. All were chosen on the reference forests of even number (docs/explanation/better-escape.md).
# Wood is assumed this far to both sides of a first contact, and the way passes this far beyond an end.
HALF_FIRST: Final = 1.5
MARGIN: Final = 0.5
# A way along a trunk stays this far off its line. Nearer, the corners of a body that turns there would touch it.
OFF_LINE: Final = 0.3
# Each further contact of a trunk makes the guess longer by this share, up to this many times.
GROWTH: Final = 0.25
MOST_GROWTH: Final = 2.0
# The direction of an end is taken over at least this length, because a contact may be at either corner of the body.
BASE: Final = 1.5
# Between two trunks that a contact could belong to, the latest is preferred by this.
LATEST: Final = 0.75
# A contact whose course was within 37 degrees of the trunk's direction was met in a corner.
ALONG: Final = 0.8
# The line bends there by more than 20 degrees: a way may go round it.
BEND: Final = 0.35
# A way that crosses a line by more than this on both sides has shown that nothing is there; less can be an error of
# dead reckoning.
CLEAR: Final = 0.5
# What a way across a line costs, in metres of path: more than any detour in a wood of 50 m.
WALL_M: Final = 30.0
# What a metre of a guessed piece costs. It is cheap, so that a gap is looked for there if there is no other way.
GUESS_PER_M: Final = 1.0
MOST_CONTACTS: Final = 64


class Barrier(NamedTuple):
    """A piece of a line, and what a way across it costs, in metres of path."""

    ahead0_m: float
    right0_m: float
    ahead1_m: float
    right1_m: float
    price_m: float


class Trunk:
    """One obstacle: an open line through its contacts, in order.

    ``met_m`` is the path at its latest contact. ``near`` is the unit vector from the line back to the side that was
    driven on.
    """

    def __init__(self, place: Point, near: Point, met_m: float) -> None:
        self.points = [place]
        self.near = near
        self.met_m = met_m


class ObstacleMap:
    """The trunks that are remembered.

    Args:
        width_m: width of the body.
        reach_m: how far a trunk is assumed to go on beyond its contacts.
        link_m: two contacts no further apart are of one trunk.
        forget_m: a trunk's belief falls to 0 over so much path since its latest contact, as the doubt in dead reckoning
            grows.
    """

    def __init__(self, width_m: float, reach_m: float, link_m: float, forget_m: float) -> None:
        self._width_m = width_m
        self._reach_m, self._link_m, self._forget_m = reach_m, link_m, forget_m
        self.trunks: list[Trunk] = []

    def add(self, place: Point, course: Point, path_m: float) -> None:
        """Take in a contact: the rover was stopped here, on this course (a unit vector), after this much path."""
        self._forget(path_m)
        near = -course[0], -course[1]
        trunk, at_last = self._trunk_at(place)
        if trunk is None:
            self.trunks.append(Trunk(place, near, path_m))
            return
        end = trunk.points[-1] if at_last else trunk.points[0]
        trunk.points.insert(len(trunk.points) if at_last else 0, place)
        trunk.near, trunk.met_m = near, path_m
        self.trunks.remove(trunk)
        self.trunks.append(trunk)  # the latest is the last
        ahead, right = unit(end, place)
        if abs(ahead * course[0] + right * course[1]) > ALONG:
            self.trunks.append(Trunk(place, near, path_m))

    def drive(self, start: Point, end: Point) -> bool:
        """Cut the lines that the rover has driven across; return whether there was one."""
        clear_m = CLEAR * self._width_m
        found = False
        for trunk in list(self.trunks):
            points = self.line(trunk)
            for i in range(len(points) - 1):
                a, b = points[i], points[i + 1]
                if not crosses(start, end, a, b):
                    continue
                if min(aside_m(start, a, b), aside_m(end, a, b)) >= clear_m:
                    found = True
                    self._cut(trunk, i)
                    break
        return found

    def belief(self, trunk: Trunk, path_m: float) -> float:
        """Return the belief that a trunk is where it was met, 1 to 0."""
        return max(0.0, 1.0 - (path_m - trunk.met_m) / self._forget_m)

    def line(self, trunk: Trunk) -> list[Point]:
        """Return a trunk's line; of a single contact, the wood that is assumed around it."""
        return trunk.points if len(trunk.points) > 1 else self._core(trunk)

    def barriers(self, path_m: float) -> list[Barrier]:
        """Return all that a way may have to cross."""
        found = []
        for trunk in self.trunks:
            wall_m = WALL_M * self.belief(trunk, path_m)
            points = self.line(trunk)
            for i in range(len(points) - 1):
                (a0, r0), (a1, r1) = points[i], points[i + 1]
                found.append(Barrier(a0, r0, a1, r1, wall_m))
            if len(trunk.points) > 1:
                reach_m = self._guess_m(trunk)
                for at_last in (True, False):
                    (a0, r0), (ahead, right) = self._end(trunk, at_last)
                    to = a0 + ahead * reach_m, r0 + right * reach_m
                    found.append(Barrier(a0, r0, to[0], to[1], GUESS_PER_M * reach_m))
        return found

    def waypoints(self) -> list[Point]:
        """Return the places where a way may turn: beyond the ends of trunks, and outside their bends."""
        found = []
        margin_m, off_m = MARGIN * self._width_m, OFF_LINE * self._width_m
        for trunk in self.trunks:
            near_a, near_r = trunk.near[0] * off_m, trunk.near[1] * off_m
            if len(trunk.points) == 1:
                for a, r in self._core(trunk, margin_m):
                    found.append((a + near_a, r + near_r))
                continue
            out_m = self._guess_m(trunk) + margin_m
            for at_last in (True, False):
                (a, r), (ahead, right) = self._end(trunk, at_last)
                found.append((a + ahead * out_m + near_a, r + right * out_m + near_r))
            found += bends(trunk.points, margin_m)
        return found

    def _forget(self, path_m: float) -> None:
        """Drop what is too old, and the oldest of too many."""
        self.trunks = [trunk for trunk in self.trunks if self.belief(trunk, path_m) > 0.0]
        count = sum(len(trunk.points) for trunk in self.trunks)
        while count >= MOST_CONTACTS:
            count -= len(self.trunks.pop(0).points)

    def _trunk_at(self, place: Point) -> tuple[Trunk | None, bool]:
        """Return the trunk that a contact belongs to, and whether it is at its last end."""
        best: Trunk | None = None
        best_m, best_at_last = self._link_m, True
        for number, trunk in enumerate(reversed(self.trunks)):
            more_m = LATEST * self._width_m if number else 0.0
            for at_last in (True, False):
                a, r = trunk.points[-1] if at_last else trunk.points[0]
                gap_m = hypot(a - place[0], r - place[1]) + more_m
                if gap_m < best_m:
                    best, best_m, best_at_last = trunk, gap_m, at_last
        return best, best_at_last

    def _core(self, trunk: Trunk, beyond_m: float = 0.0) -> list[Point]:
        """Return the two ends of the wood that is assumed around a single contact, across the course."""
        (a, r), (near_a, near_r) = trunk.points[0], trunk.near
        half_m = HALF_FIRST * self._width_m + beyond_m
        return [(a + near_r * half_m, r - near_a * half_m), (a - near_r * half_m, r + near_a * half_m)]

    def _end(self, trunk: Trunk, at_last: bool) -> tuple[Point, Point]:
        """Return an end of a line and the direction that leads on from it, a unit vector."""
        points = trunk.points if at_last else trunk.points[::-1]
        tip = points[-1]
        inner = points[-2]
        for i in range(len(points) - 2, -1, -1):
            inner = points[i]
            if hypot(inner[0] - tip[0], inner[1] - tip[1]) >= BASE * self._width_m:
                break
        return tip, unit(inner, tip)

    def _guess_m(self, trunk: Trunk) -> float:
        """Return how far a trunk is assumed to go on: the longer it was found to be, the further."""
        return self._reach_m * min(1.0 + GROWTH * (len(trunk.points) - 2), MOST_GROWTH)

    def _cut(self, trunk: Trunk, i: int) -> None:
        """Cut a line behind its point i: two trunks remain, or of a single contact none."""
        rest = trunk.points[i + 1 :]
        if len(trunk.points) == 1:
            self.trunks.remove(trunk)
            return
        del trunk.points[i + 1 :]
        part = Trunk(rest[0], trunk.near, trunk.met_m)
        part.points = rest
        self.trunks.insert(self.trunks.index(trunk), part)


def bends(points: list[Point], margin_m: float) -> list[Point]:
    """Return a place outside each bend of a line, this far from it."""
    found = []
    for i in range(1, len(points) - 1):
        (ua, ur), (va, vr) = unit(points[i - 1], points[i]), unit(points[i], points[i + 1])
        if abs(ua * vr - ur * va) > BEND:
            out_a, out_r = unit((va, vr), (ua, ur))
            found.append((points[i][0] + out_a * margin_m, points[i][1] + out_r * margin_m))
    return found


def unit(start: Point, end: Point) -> Point:
    """Return the direction from one place to another; (0, 0) where both are the same."""
    ahead, right = end[0] - start[0], end[1] - start[1]
    length_m = hypot(ahead, right) or 1.0
    return ahead / length_m, right / length_m


def aside_m(place: Point, start: Point, end: Point) -> float:
    """Return how far a place is from the straight line through two others."""
    ahead, right = unit(start, end)
    return abs((place[0] - start[0]) * right - (place[1] - start[1]) * ahead)


def crosses(start: Point, end: Point, a: Point, b: Point) -> bool:
    """Return whether the way from ``start`` to ``end`` crosses the piece from ``a`` to ``b``; its ends do not count."""
    return _meets(start[0], start[1], end[0], end[1], a[0], a[1], b[0], b[1])


def _meets(a0: float, r0: float, a1: float, r1: float, b0: float, s0: float, b1: float, s1: float) -> bool:
    way_a, way_r, piece_a, piece_r = a1 - a0, r1 - r0, b1 - b0, s1 - s0
    across = way_a * piece_r - way_r * piece_a
    if across == 0.0:
        return False
    to_a, to_r = b0 - a0, s0 - r0
    share = (to_a * piece_r - to_r * piece_a) / across
    return 0.0 < share < 1.0 and 0.0 <= (to_a * way_r - to_r * way_a) / across <= 1.0


def price_m(barriers: list[Barrier], a0: float, r0: float, a1: float, r1: float) -> float:
    """Return what a straight way costs beside its length: the prices of all that it crosses."""
    found_m = 0.0
    from_a, to_a = (a0, a1) if a0 < a1 else (a1, a0)
    from_r, to_r = (r0, r1) if r0 < r1 else (r1, r0)
    for b0, s0, b1, s1, cost_m in barriers:
        if (b0 < from_a and b1 < from_a) or (b0 > to_a and b1 > to_a):
            continue
        if (s0 < from_r and s1 < from_r) or (s0 > to_r and s1 > to_r):
            continue
        if _meets(a0, r0, a1, r1, b0, s0, b1, s1):
            found_m += cost_m
    return found_m
