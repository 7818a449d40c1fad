"""The receiver's fixes and dead reckoning: which fixes to believe, and the best fit of the whole path to all of them.

Places are complex numbers, metres east + 1j * metres north.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isnan, nan
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.angles import Coordinates, offset_m, wrap180
from wayfarer.fieldlog.record import Fix, ReckonedPose, or_nan

Places = NDArray[np.complex128]

FAR_M = 10_000.0  # fixes this far from the median are start-up errors
# What a compass and an odometer can be wrong by before the fixes have said anything: one part in five, 11 degrees (the
# declination, which nobody corrects) or 20 % of the distance (slip). Chosen by us; in a run that is long against
# the receiver's error it does not matter.
FREEDOM = 0.2
# A receiver's error stays nearly the same for about so long, so its fixes count once per minute. Chosen by us.
WANDER_S = 60.0
CAUCHY = 2.385  # standard deviations: 95 % efficient for normal errors (W. Rey, "Introduction to Robust Methods", 1983)
RAYLEIGH = 1.1774  # the median distance in standard deviations of one axis
ROUNDS = 30  # weights change by less than 1 % after some ten


class MapFix(NamedTuple):
    """A position: degrees, the horizontal error in metres, and where dead reckoning had the rover then."""

    t_s: float
    latitude_deg: float
    longitude_deg: float
    error_m: float
    north_m: float
    east_m: float

    @classmethod
    def of(cls, fix: Fix, place: ReckonedPose | None) -> MapFix:
        """Return a fix of the log, with where dead reckoning had the rover then."""
        here_m = (place.north_m, place.east_m) if place else (nan, nan)
        return cls(fix.elapsed_s, fix.latitude_deg, fix.longitude_deg, or_nan(fix.error_m), *here_m)


class Fit(NamedTuple):
    """What lays dead reckoning onto the fixes: ``factor`` turns and stretches, ``shift_m`` moves."""

    factor: complex
    shift_m: complex

    def __call__(self, places_m: Places) -> Places:
        """Return where places are on the receiver's map."""
        return self.factor * places_m + self.shift_m

    @property
    def turned_deg(self) -> float:
        """Return by how much the path was turned clockwise."""
        return round(-degrees(float(np.angle(self.factor))), 3) + 0.0  # not -0.0

    @property
    def stretched(self) -> float:
        """Return the factor of all distances."""
        return abs(self.factor)


def believable(fixes: Sequence[MapFix]) -> list[MapFix]:
    """Return the fixes that are not ``FAR_M`` from most others."""
    if not fixes:
        return []
    first = fixes[0]
    middle = first._replace(
        latitude_deg=median(fix.latitude_deg for fix in fixes),
        longitude_deg=first.longitude_deg + median(wrap180(fix.longitude_deg - first.longitude_deg) for fix in fixes),
    )
    return [fix for fix in fixes if max(map(abs, offset_m(middle, fix))) < FAR_M]


def places_of(fixes: Sequence[MapFix], origin: Coordinates) -> Places:
    """Return where fixes are, from an origin."""
    offsets_m = [offset_m(origin, fix) for fix in fixes]
    return np.array([complex(east_m, north_m) for north_m, east_m in offsets_m], dtype=np.complex128)


def paired(fixes: Sequence[MapFix]) -> tuple[list[MapFix], Places]:
    """Return the fixes at which dead reckoning had the rover somewhere, and where."""
    both = [fix for fix in fixes if not isnan(fix.north_m + fix.east_m)]
    return both, np.array([complex(fix.east_m, fix.north_m) for fix in both], dtype=np.complex128)


def fit(fixes: Sequence[MapFix], origin: Coordinates) -> Fit | None:
    """Return the similarity that lays the path by dead reckoning onto the fixes; None if nothing can be compared.

    Weighted least squares over all fixes, with Cauchy's weights, so that single wild fixes do not count, and with
    ``FREEDOM`` as the standard deviation of what the path may be turned and stretched by before any fix.
    """
    compared, reckoned_m = paired(fixes)
    if not compared:
        return None
    fixed_m, lasted_s = places_of(compared, origin), compared[-1].t_s - compared[0].t_s
    # Fixes that come often repeat the same error: each counts as this part of an independent one.
    independent = min(1.0, (1.0 + lasted_s / WANDER_S) / len(compared))
    apart_m = fixed_m - reckoned_m
    best = Fit(1.0, complex(np.median(apart_m.real), np.median(apart_m.imag)))
    for _ in range(ROUNDS):
        missed_m = np.abs(fixed_m - best(reckoned_m))
        sigma_m = max(float(np.median(missed_m)) / RAYLEIGH, 1e-3)
        weights = 1.0 / (1.0 + (missed_m / (CAUCHY * sigma_m)) ** 2)
        from_m, to_m = (np.average(places_m, weights=weights) for places_m in (reckoned_m, fixed_m))
        information = weights * independent / sigma_m**2
        # The normal equation of one complex factor. Its prior is 1 (neither turned nor stretched): FREEDOM**-2 in both.
        along = np.sum(information * np.conj(reckoned_m - from_m) * (fixed_m - to_m)) + 1.0 / FREEDOM**2
        factor = along / (np.sum(information * np.abs(reckoned_m - from_m) ** 2) + 1.0 / FREEDOM**2)
        best = Fit(complex(factor), complex(to_m - factor * from_m))
    return best
