"""Where a rover went: by dead reckoning, laid onto the receiver's fixes, or truly in the forest of a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot, isnan, nan
from typing import NamedTuple

import numpy as np

from wayfarer.angles import Coordinates, coordinates_deg
from wayfarer.fieldlog.record import WORLD_CORNER, World
from wayfarer.logview.receiver_fit import Fit, MapFix, Places, believable, fit, paired, places_of
from wayfarer.reports.data import Columns, Floats, RunData
from wayfarer.reports.series import breaks

Point = tuple[float, float]  # metres east and north


class TimedPath(NamedTuple):
    """A path over time, metres east and north; all but the time is NaN if records are missing."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    phase: Floats

    def at(self, t_s: float) -> Point:
        """Return the place at a time; NaN if nothing is known."""
        if not self.t_s.size:
            return nan, nan
        return float(np.interp(t_s, self.t_s, self.east_m)), float(np.interp(t_s, self.t_s, self.north_m))

    def beginning_at(self, east_m: float, north_m: float) -> TimedPath:
        """Return the path moved so that it begins there."""
        first_m = self.east_m[:1].sum(), self.north_m[:1].sum()
        return self._replace(east_m=self.east_m - first_m[0] + east_m, north_m=self.north_m - first_m[1] + north_m)

    def mapped(self, onto: Fit) -> TimedPath:
        """Return the path laid onto the receiver's fixes."""
        places_m = onto(self.east_m + 1j * self.north_m)
        return self._replace(east_m=places_m.real, north_m=places_m.imag)


@dataclass(frozen=True)
class Track:
    """What the map shows of one run.

    ``path`` is the best that is known, ``reckoned`` dead reckoning beside it where the run was simulated. ``fixes_m``
    are the places of ``fixes``, and ``origin`` is where the map's zero is; without fixes nobody knows that.
    """

    data: RunData
    path: TimedPath
    reckoned: TimedPath | None = None
    forest: World | None = None
    origin: Coordinates | None = None
    fixes: Sequence[MapFix] = ()
    fit: Fit | None = None

    @property
    def fixes_m(self) -> Places:
        """Return the places of the fixes, metres east + 1j * metres north."""
        return places_of(self.fixes, self.origin) if self.origin else np.array([], dtype=np.complex128)

    @property
    def end_deg(self) -> tuple[float, float] | None:
        """Return latitude and longitude of the end: of the whole path as fitted, else of the last fix."""
        path = self.path if self.reckoned is None else self.reckoned
        if self.origin and self.fit and path.t_s.size:
            return coordinates_deg(self.origin, float(path.north_m[-1]), float(path.east_m[-1]))
        return (self.fixes[-1].latitude_deg, self.fixes[-1].longitude_deg) if self.fixes else None

    @property
    def drift_m(self) -> float:
        """Return how far dead reckoning is from the true path at the end; NaN if one of them is not known."""
        if self.reckoned is None or not (self.reckoned.t_s.size and self.path.t_s.size):
            return nan
        return hypot(self.reckoned.east_m[-1] - self.path.east_m[-1], self.reckoned.north_m[-1] - self.path.north_m[-1])

    def missed_m(self, *, true: bool = False) -> tuple[float, float]:
        """Return the median distance of dead reckoning from the fixes, unfitted (from the first fix) and fitted.

        It is in metres, at the times of the fixes; with ``true`` it is that from the true path of a simulated rover.
        """
        if not self.fit or not self.origin:
            return nan, nan
        compared, reckoned_m = paired(self.fixes)
        fixed_m = places_of(compared, self.origin)
        pinned_m = reckoned_m - reckoned_m[0] + fixed_m[0]
        there_m = np.array([complex(*self.path.at(fix.t_s)) for fix in compared]) if true else fixed_m
        return float(np.median(np.abs(pinned_m - there_m))), float(np.median(np.abs(self.fit(reckoned_m) - there_m)))

    def goals(self) -> Iterator[tuple[Point, float]]:
        """Yield where the rover took a goal, and its heading in degrees on this map."""
        turned_deg = self.fit.turned_deg if self.fit and self.reckoned is None else 0.0
        for t_s, goal_deg in self.data.goals:
            place_m = self.path.at(t_s)
            if not isnan(sum(place_m)):
                yield place_m, goal_deg + turned_deg


def track_of(data: RunData) -> Track:
    """Return what the map shows of a run; with a receiver, zero is at its first fix."""
    path, fixes, forest = _path(data.ticks, "east_m", "north_m"), believable(data.fixes), data.header.world
    if forest is not None and data.truth["x_m"].size:
        found = fit(fixes, WORLD_CORNER)
        true = _path(data.truth, "x_m", "y_m")
        beside = path.mapped(found) if found else path.beginning_at(*true.at(path.t_s[:1].sum()))
        return Track(data, true, beside, forest, WORLD_CORNER if fixes else None, fixes, found)
    if not fixes:
        return Track(data, path)
    found = fit(fixes, fixes[0])
    return Track(data, path.mapped(found) if found else path, None, None, fixes[0], fixes, found)


def _path(columns: Columns, east: str, north: str) -> TimedPath:
    """Return the path of a table of ``RunData``, as far as it is known, with a gap where the log has one."""
    known = {name: columns[name][~np.isnan(columns[east])] for name in ("t_s", east, north, "phase", "stretch")}
    t_s, *others = (known[name] for name in ("t_s", east, north, "phase"))
    at = np.flatnonzero(breaks(known)) + 1
    return TimedPath(np.insert(t_s, at, t_s[at]), *(np.insert(each, at, nan) for each in others))
