"""Position fixes on the dead reckoning map: in metres, relative to the first fix."""

from __future__ import annotations

from math import isnan
from statistics import median
from typing import NamedTuple

from wayfarer.angles import offset_m, wrap180
from wayfarer.views.run_report.data import MapFix

FAR_M = 10_000.0  # from the middle of all fixes: no rover walks there, a receiver that just woke up says so


class LocalFix(NamedTuple):
    """A fix in metres; ``error_m`` is NaN where the receiver did not tell."""

    north_m: float
    east_m: float
    error_m: float


def local_metres(fixes: list[MapFix]) -> list[LocalFix]:
    """Return fixes in metres north and east, where dead reckoning had the rover at the first of them.

    Fixes that are ``FAR_M`` from most others are left out. Nobody turns them: dead reckoning counts from magnetic
    north, the receiver from true north.
    """
    near = _believable(fixes)
    if not near:
        return []
    first = near[0]
    north_m, east_m = (0.0 if isnan(place_m) else place_m for place_m in (first.north_m, first.east_m))
    return [
        LocalFix(north_m + dn_m, east_m + de_m, fix.error_m) for fix in near for dn_m, de_m in [offset_m(first, fix)]
    ]


def _believable(fixes: list[MapFix]) -> list[MapFix]:
    if not fixes:
        return []
    first = fixes[0]
    middle = first._replace(
        latitude_deg=median(fix.latitude_deg for fix in fixes),
        longitude_deg=first.longitude_deg + median(wrap180(fix.longitude_deg - first.longitude_deg) for fix in fixes),
    )
    return [fix for fix in fixes if max(map(abs, offset_m(middle, fix))) < FAR_M]
