"""The path by dead reckoning on the globe: fitted to the receiver's fixes, or laid at a place that a person gave.

Dead reckoning counts from magnetic north. A fit to fixes finds the declination; from a given place nothing corrects it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import dist
from typing import NamedTuple

from wayfarer.angles import Coordinates, coordinates_deg, wrap180
from wayfarer.clamp import clamp
from wayfarer.errors import BadInput
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.views.receiver_fit import Fit, MapFix, believable, fit

SPACING_M = 0.2  # of the points: half a rover's length; an hour at 0.5 m/s has 9,000
DECIMALS = 8  # of a degree: a millimetre


class Origin(NamedTuple):
    """Where on the globe a run began, degrees; a person says so."""

    latitude_deg: float
    longitude_deg: float

    @classmethod
    def of(cls, text: str) -> Origin:
        """Return the place of a text such as ``50.937,-1.397``: latitude, longitude.

        Raises:
            BadInput: it is no such text.
        """
        try:
            latitude_deg, longitude_deg = map(float, text.split(","))
        except ValueError:
            latitude_deg = longitude_deg = float("nan")
        if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0):
            raise BadInput(
                f"--origin {text}: give latitude and longitude in degrees, south and west negative, as 50.937,-1.397"
            )
        return cls(latitude_deg, longitude_deg)


class OnGlobe(NamedTuple):
    """Lays places by dead reckoning onto the globe: by a fit, whose zero is at an origin; ``how`` says it in words."""

    fit: Fit
    origin: Coordinates
    how: str

    def __call__(self, place: ReckonedPose) -> tuple[float, float]:
        """Return latitude and longitude, degrees."""
        there_m = self.fit.factor * complex(place.east_m, place.north_m) + self.fit.shift_m
        return on_globe(*coordinates_deg(self.origin, there_m.imag, there_m.real))


def onto_fixes(fixes: Sequence[MapFix]) -> OnGlobe | None:
    """Return what lays the path onto the fixes that can be believed; None where dead reckoning knows of none."""
    believed = believable(fixes)
    found = fit(believed, believed[0]) if believed else None
    return OnGlobe(found, believed[0], "dead reckoning fitted to the fixes") if found else None


def from_origin(origin: Origin) -> OnGlobe:
    """Return what lets the path begin at a given place."""
    return OnGlobe(Fit(1.0, 0.0), origin, "dead reckoning from the given origin")


@dataclass(frozen=True, slots=True)
class PathPoint:
    """A place of the path, degrees."""

    t_s: float
    elapsed_s: float
    latitude_deg: float
    longitude_deg: float


class ReckonedPath:
    """Collects the path of a run, as points that are ``SPACING_M`` apart; a gap in the log cuts it."""

    def __init__(self) -> None:
        self._segments: list[list[tuple[float, ReckonedPose]]] = []
        self._stretch = -1

    def take(self, elapsed_s: float, place: ReckonedPose, stretch: int) -> None:
        """Take where the rover was; ``stretch`` is another number after missing records."""
        if stretch != self._stretch:
            self._stretch = stretch
            self._segments.append([])
        segment = self._segments[-1]
        if segment:
            before = segment[-1][1]
            if dist((before.north_m, before.east_m), (place.north_m, place.east_m)) < SPACING_M:
                return
        segment.append((elapsed_s, place))

    def laid(self, onto: OnGlobe) -> list[list[PathPoint]]:
        """Return the path on the globe, cut at the date line as well, as RFC 7946 asks (3.1.9)."""
        found: list[list[PathPoint]] = []
        for segment in self._segments:
            points: list[PathPoint] = []
            for elapsed_s, place in segment:
                latitude_deg, longitude_deg = onto(place)
                if points and abs(longitude_deg - points[-1].longitude_deg) > 180.0:
                    found.append(points)
                    points = []
                points.append(PathPoint(place.t_s, elapsed_s, latitude_deg, longitude_deg))
            found.append(points)
        return [points for points in found if len(points) > 1]


def on_globe(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return a latitude in [-90, 90] and a longitude in [-180, 180), as written: 180 itself is -180 in GPX.

    Only dead reckoning that went astray leads beyond a pole.
    """
    longitude_deg = round(wrap180(longitude_deg), DECIMALS)
    return round(clamp(latitude_deg, -90.0, 90.0), DECIMALS), -180.0 if longitude_deg == 180.0 else longitude_deg
