"""The contact map: keeps trunks, grows them with each contact, and says what a way would have to cross."""

from __future__ import annotations

import os
from math import hypot
from typing import Final

from wayfarer.escape.memory.trunks import Barrier, Point, Trunk, nearest_on

P = {k[2:]: float(v) for k, v in os.environ.items() if k.startswith("M_")}


def par(name: str, default: float) -> float:
    return P.get(name, default)


MOST_TRUNKS: Final = 48


class ContactMap:
    """The trunks that are remembered."""

    def __init__(self, body_m: float) -> None:
        self._body_m = body_m
        self._core_m = par("core", 1.5) * body_m
        self._ext_m = par("ext", 3.0) * body_m
        self._grow = par("grow", 0.25)
        self._most = par("most", 2.0)
        self._link_m = par("link", 6.0) * body_m
        self._wall_m = par("wall", 30.0)
        self._ext_price = par("extp", 1.0)
        self._off_m = par("off", 0.3) * body_m
        self._margin_m = par("margin", 0.5) * body_m
        self._forget_m = par("forget", 200.0)
        self.trunks: list[Trunk] = []

    def clear(self) -> None:
        self.trunks = []

    def add(self, place: Point, heading: Point, path_m: float) -> None:
        """Take in a contact: the rover's middle was stopped here while it drove along this unit vector."""
        self.trunks = [t for t in self.trunks if path_m - t.met_at_m < self._forget_m][-MOST_TRUNKS:]
        trunk, last = self._trunk_at(place)
        if trunk is None:
            trunk = Trunk([place], path_m)
            trunk.headings = [heading]
            self.trunks.append(trunk)
        else:
            tip = trunk.points[-1] if last else trunk.points[0]
            along = self._along(trunk, last, place, heading)
            if last:
                trunk.points.append(place)
                trunk.headings.append(heading)
            else:
                trunk.points.insert(0, place)
                trunk.headings.insert(0, heading)
            trunk.met_at_m = path_m
            self.trunks.remove(trunk)
            self.trunks.append(trunk)
            if along and hypot(tip[0] - place[0], tip[1] - place[1]) < par("corner", 99.0) * self._body_m:
                core = Trunk([place], path_m)
                core.near = (-heading[0], -heading[1])
                core.headings = [heading]
                self.trunks.append(core)
        trunk.near = (-heading[0], -heading[1])

    def _trunk_at(self, place: Point) -> tuple[Trunk | None, bool]:
        best, best_m, best_last = None, self._link_m, True
        for number, trunk in enumerate(reversed(self.trunks)):
            for last in (True, False):
                tip = trunk.points[-1] if last else trunk.points[0]
                gap_m = hypot(tip[0] - place[0], tip[1] - place[1]) + (par("older", 0.3) if number else 0.0)
                if gap_m < best_m:
                    best, best_m, best_last = trunk, gap_m, last
        return best, best_last

    def _along(self, trunk: Trunk, last: bool, place: Point, heading: Point) -> bool:
        """Return whether the contact was met along the trunk rather than across it."""
        tip = trunk.points[-1] if last else trunk.points[0]
        da, dr = place[0] - tip[0], place[1] - tip[1]
        length = hypot(da, dr) or 1.0
        return abs(da * heading[0] + dr * heading[1]) / length > par("cos", 0.8)

    def barriers(self) -> list[Barrier]:
        """Return all that a way may have to cross."""
        found = []
        for trunk in self.trunks:
            points = trunk.points
            if len(points) == 1:
                a, r = points[0]
                ua, ur = -trunk.near[1], trunk.near[0]
                hard = min(par("hard", 0.6) * self._body_m, self._core_m)
                c = self._core_m
                found.append(Barrier(a - ua * hard, r - ur * hard, a + ua * hard, r + ur * hard, self._wall_m))
                if c > hard:
                    soft = par("loose", 75.0) * self._body_m
                    found.append(Barrier(a - ua * c, r - ur * c, a - ua * hard, r - ur * hard, soft))
                    found.append(Barrier(a + ua * hard, r + ur * hard, a + ua * c, r + ur * c, soft))
                continue
            for i in range(len(points) - 1):
                found.append(Barrier(*points[i], *points[i + 1], self._link_price(points, i)))
            c = par("small", 0.0) * self._body_m
            if c:
                for i, ((a, r), (ha, hr)) in enumerate(zip(points, trunk.headings, strict=True)):
                    b, t = points[i - 1] if i else points[1]
                    if abs((a - b) * ha + (r - t) * hr) > par("cosc", 0.5) * hypot(a - b, r - t):
                        continue
                    found.append(Barrier(a + hr * c, r - ha * c, a - hr * c, r + ha * c, self._wall_m))
            for last in (True, False):
                (a, r), (da, dr) = self._end(trunk, last)
                ext = self._extension(trunk)
                found.append(Barrier(a, r, a + da * ext, r + dr * ext, self._ext_price * ext))
        return found

    def _link_price(self, points: list[Point], i: int) -> float:
        (a0, r0), (a1, r1) = points[i], points[i + 1]
        da, dr = a1 - a0, r1 - r0
        length = hypot(da, dr)
        if length <= par("tight", 1.2) * self._body_m:
            return self._wall_m
        for j in (i - 1, i + 1):
            if 0 <= j < len(points) - 1:
                ea, er = points[j + 1][0] - points[j][0], points[j + 1][1] - points[j][1]
                other = hypot(ea, er) or 1.0
                if other > 0.8 * self._body_m and abs(da * er - dr * ea) / (length * other) < par("straight", 0.3):
                    return self._wall_m
        return par("loose", 75.0) * self._body_m

    def _end(self, trunk: Trunk, last: bool) -> tuple[Point, Point]:
        """Return an end and the unit vector that leads on from it."""
        points = trunk.points if last else trunk.points[::-1]
        tip = points[-1]
        inner = points[-2]
        for i in range(len(points) - 2, -1, -1):
            inner = points[i]
            if hypot(inner[0] - tip[0], inner[1] - tip[1]) >= par("base", 1.5) * self._body_m:
                break
        da, dr = tip[0] - inner[0], tip[1] - inner[1]
        length = hypot(da, dr) or 1.0
        return tip, (da / length, dr / length)

    def _extension(self, trunk: Trunk) -> float:
        return self._ext_m * min(1.0 + self._grow * (len(trunk.points) - 2), self._most)

    def nodes(self) -> list[Point]:
        """Return the places past the ends of trunks, and beside their bends."""
        found = []
        margin_m = self._margin_m
        for trunk in self.trunks:
            points = trunk.points
            na, nr = trunk.near[0] * self._off_m, trunk.near[1] * self._off_m
            if len(points) == 1:
                a, r = points[0]
                out = self._core_m + margin_m
                ca, cr = -trunk.near[1] * out, trunk.near[0] * out
                if par("inner", 0.0):
                    inn = par("hard", 0.6) * self._body_m + margin_m
                    ia, ir = -trunk.near[1] * inn, trunk.near[0] * inn
                    found.append((a - ia + na, r - ir + nr))
                    found.append((a + ia + na, r + ir + nr))
                found.append((a - ca + na, r - cr + nr))
                found.append((a + ca + na, r + cr + nr))
                continue
            for last in (True, False):
                (a, r), (da, dr) = self._end(trunk, last)
                out = margin_m + self._extension(trunk)
                found.append((a + da * out + na, r + dr * out + nr))
                if par("short", 0.0):
                    found.append((a + da * margin_m + na, r + dr * margin_m + nr))
            for i in range(1, len(points) - 1):
                a, r = points[i]
                ua, ur = a - points[i - 1][0], r - points[i - 1][1]
                va, vr = points[i + 1][0] - a, points[i + 1][1] - r
                lu, lv = hypot(ua, ur) or 1.0, hypot(va, vr) or 1.0
                bend = (ua * vr - ur * va) / (lu * lv)
                if abs(bend) > 0.35:
                    na, nr = ua / lu - va / lv, ur / lu - vr / lv  # points to the outer side of the bend
                    n = hypot(na, nr) or 1.0
                    found.append((a + na / n * margin_m, r + nr / n * margin_m))
        return found
