"""A run as GPX 1.1: a track of the receiver's fixes, one of the path, and waypoints where something happened.

Dead reckoning has no latitude. So the path is fitted to all fixes, which finds the declination too, or begins where a
person says that it began; then nothing corrects it. What happened has its place on that path. If nothing could be
reckoned, it is at the fix nearest in time. A track's ``type`` is ``fixes``, ``fitted`` or ``reckoned``.

``elapsed_s`` and the receiver's ``error_m`` are in extensions, because GPX has no element for them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import dist, inf
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import NamedTuple, TextIO, TypeVar
from xml.etree.ElementTree import Element

import msgspec
from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment, GPXWaypoint

from wayfarer import __version__
from wayfarer.angles import Coordinates, clamp, coordinates_deg, wrap180
from wayfarer.errors import BadInput
from wayfarer.export import read_clock_zero_s, utc_time
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.folders import run_title
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import Event, Fix, Outcome, ReckonedPose, Tick
from wayfarer.fieldlog.run_fold import HELD, AnomalyBegan, RunFold, Told
from wayfarer.fieldlog.wording import outcome_text, run_text
from wayfarer.logview.receiver_fit import Fit, MapFix, believable, fit
from wayfarer.vocabulary import in_words

OURS = "urn:wayfarer:gpx"  # what makes the names of extensions unique; nothing is to be found there
GAP_S = 10.0  # without a fix, and a track has a gap: ten readings at the usual ``rates.position_hz`` of 1
SPACING_M = 0.2  # of the path's points: half a rover's length; an hour at 0.5 m/s has 9,000
DECIMALS = 8  # of a degree: a millimetre
_time = attrgetter("t_s")
AnyPlace = TypeVar("AnyPlace", Fix, "PathPoint")


def write_gpx(run: Path, file: TextIO, origin: str | None = None) -> Damage:
    """Write a run as GPX, and return what of it could not be read.

    ``origin`` is where one without a receiver began, latitude and longitude in degrees: ``50.937,-1.397``.
    """
    places = read_places(run, None if origin is None else Origin.of(origin))
    gpx = GPX()
    gpx.creator = f"wayfarer {__version__}"
    gpx.nsmap["wayfarer"] = OURS
    gpx.name, gpx.description = places.title, places.about
    gpx.time = utc_time(places.zero_s + places.began_t_s)
    gpx.waypoints = [_waypoint(each, places.zero_s) for each in places.waypoints]
    if places.segments:
        gpx.tracks.append(_track(places.title, "fixes", places.segments, places.zero_s))
    if places.path:
        kind = "fitted" if places.segments else "reckoned"
        gpx.tracks.append(_track(f"{places.title}: {places.path_name}", kind, places.path, places.zero_s))
    # Characters as numbers, because a terminal may not be UTF-8.
    file.write(gpx.to_xml().encode("ascii", "xmlcharrefreplace").decode() + "\n")
    return places.damage


# -- the run on the globe ----------------------------------------------------------------------------------------------


class PlacedEvent(NamedTuple):
    """Something that happened at a place: ``mark``, ``anomaly``, ``hold`` or ``fault`` (wheels stopped), ``end``."""

    kind: str
    text: str
    t_s: float
    elapsed_s: float


class Waypoint(NamedTuple):
    """The place of something that happened, degrees; ``placed`` says how it was found."""

    placed_event: PlacedEvent
    latitude_deg: float
    longitude_deg: float
    placed: str


class Places(NamedTuple):
    """A run on the globe: its fixes and its path in segments without a gap, what happened, and the log's damage.

    ``path`` is dead reckoning, and ``path_name`` says how it was laid there. ``title`` is the name of the run's folder,
    ``about`` says what ran, ``zero_s`` is the wall time at which ``t_s`` was zero.
    """

    title: str
    about: str
    zero_s: float
    segments: list[list[Fix]]
    path: list[list[PathPoint]]
    path_name: str
    waypoints: list[Waypoint]
    damage: Damage

    @property
    def began_t_s(self) -> float:
        """Return the time of the first fix, else that of the first point of the path."""
        return next((segment[0].t_s for tracks in (self.segments, self.path) for segment in tracks), 0.0)


def read_places(run: Path, origin: Origin | None) -> Places:
    """Read where a run was; ``origin`` is where one without fixes began."""
    reader = RunReader(run)
    zero_s, fold = read_clock_zero_s(reader), RunFold()
    fixes: list[Fix] = []
    compared: list[MapFix] = []
    moments: list[tuple[float, int, ReckonedPose]] = []
    placed_events: list[PlacedEvent] = []
    for record in RunReader(run):
        placed_events += _happened(fold.add(record))
        match record:
            case Tick() if (place := record.place) is not None:
                moments.append((record.elapsed_s, fold.state.stretch, place))
            case Fix():
                latitude_deg, longitude_deg = on_globe(record.latitude_deg, record.longitude_deg)
                fixes.append(msgspec.structs.replace(record, latitude_deg=latitude_deg, longitude_deg=longitude_deg))
                compared.append(MapFix.of(record, fold.state.place))
    poses = [place for _, _, place in moments]
    _check_origin(run, origin, fixes, poses)
    fixes.sort(key=_time)
    given = OnGlobe(Fit(1.0, 0.0), origin, "dead reckoning from the given origin") if origin else None
    onto = given or onto_fixes(compared)
    laid, how = (path_of(moments, onto), onto.how) if onto else ([], "")
    waypoints = [_placed(each, fixes, poses, onto) for each in placed_events]
    title, about = run_title(run), run_text(fold.state.header)
    return Places(title, about, zero_s, cut(fixes, GAP_S), laid, how, waypoints, reader.damage)


def _check_origin(run: Path, origin: Origin | None, fixes: Sequence[Fix], poses: Sequence[ReckonedPose]) -> None:
    if origin is not None and fixes:
        raise BadInput(f"{run} has GPS positions, which say where it was: leave --origin out")
    if origin is None and not fixes:
        raise BadInput(
            f"{run} has no GPS position, so there is no gpx: dead reckoning has no latitude. Say where it began "
            f"with --origin LAT,LON, or use csv or mcap; for the next run give the rover a receiver "
            f"(parts.position in its file)"
        )
    if origin is not None and not poses:
        raise BadInput(f"{run} has no heading, so no path leads away from --origin: see wayfarer logs check")


def _happened(events: Sequence[Told]) -> Iterator[PlacedEvent]:
    """Yield the events of a record that have a place; anomalies that begin at the same tick are one."""
    begun = [in_words(event.kind) for event in events if isinstance(event, AnomalyBegan)]
    if begun:
        yield PlacedEvent("anomaly", ", ".join(begun), events[0].t_s, events[0].elapsed_s)
    for event in events:
        match event:
            case Event(name="mark"):
                yield PlacedEvent("mark", event.text, event.t_s, event.elapsed_s)
            case Event(name="health", data={"level": str(level)}) if level in HELD:
                cause = event.word("cause") or "unknown"
                yield PlacedEvent(level, f"{level}: {in_words(cause)}", event.t_s, event.elapsed_s)
            case Outcome():
                yield PlacedEvent("end", outcome_text(event), event.t_s, event.elapsed_s)


def cut(places: Iterable[AnyPlace], gap_s: float = inf) -> list[list[AnyPlace]]:
    """Cut a track at gaps in time, and at the date line, where maps draw a line around the world."""
    segments: list[list[AnyPlace]] = []
    last: AnyPlace | None = None
    for place in places:
        if last is None or place.t_s - last.t_s > gap_s or abs(place.longitude_deg - last.longitude_deg) > 180.0:
            segments.append([])
        segments[-1].append(place)
        last = place
    return segments


def _placed(
    placed_event: PlacedEvent, fixes: Sequence[Fix], poses: Sequence[ReckonedPose], onto: OnGlobe | None
) -> Waypoint:
    """Return where something happened: on the path, else at the nearest fix."""
    t_s = placed_event.t_s
    if onto is not None:
        return Waypoint(placed_event, *onto(poses[max(0, bisect_right(poses, t_s, key=_time) - 1)]), onto.how)
    fix = min(fixes, key=lambda each: abs(each.t_s - t_s))
    error = "" if fix.error_m is None else f" (error {fix.error_m:.1f} m)"
    placed = f"the fix at {duration_text(fix.elapsed_s, 2)}{error}"
    return Waypoint(placed_event, fix.latitude_deg, fix.longitude_deg, placed)


# -- the path ----------------------------------------------------------------------------------------------------------


class Origin(NamedTuple):
    """Where on the globe a run began, degrees; a person says so."""

    latitude_deg: float
    longitude_deg: float

    @classmethod
    def of(cls, text: str) -> Origin:
        """Return the place of a text such as ``50.937,-1.397``: latitude, longitude."""
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
    """Return what lays the path onto the fixes that can be believed; None if dead reckoning knows of none."""
    believed = believable(fixes)
    laid = fit(believed, believed[0]) if believed else None
    return OnGlobe(laid, believed[0], "dead reckoning fitted to the fixes") if laid else None


@dataclass(frozen=True, slots=True)
class PathPoint:
    """A place of the path, degrees."""

    t_s: float
    elapsed_s: float
    latitude_deg: float
    longitude_deg: float


def path_of(moments: Iterable[tuple[float, int, ReckonedPose]], onto: OnGlobe) -> list[list[PathPoint]]:
    """Return the path on the globe as points ``SPACING_M`` apart, cut at gaps in the log and at the date line.

    ``moments`` are a time in seconds, a number that is another one after missing records, and where the rover was.
    """
    segments: list[list[PathPoint]] = []
    for _, stretch in groupby(moments, key=itemgetter(1)):
        segments.append([])
        last_m = (inf, inf)
        for elapsed_s, _, place in stretch:
            here_m = place.north_m, place.east_m
            if dist(last_m, here_m) >= SPACING_M:
                last_m = here_m
                segments[-1].append(PathPoint(place.t_s, elapsed_s, *onto(place)))
    return [points for segment in segments for points in cut(segment) if len(points) > 1]


def on_globe(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return a latitude in [-90, 90] and a longitude in [-180, 180), as written: 180 itself is -180 in GPX.

    Only dead reckoning that went astray leads beyond a pole.
    """
    longitude_deg = round(wrap180(longitude_deg), DECIMALS)
    return round(clamp(latitude_deg, -90.0, 90.0), DECIMALS), -180.0 if longitude_deg == 180.0 else longitude_deg


# -- elements of the file ----------------------------------------------------------------------------------------------


def _track(name: str, kind: str, segments: Sequence[Sequence[Fix | PathPoint]], zero_s: float) -> GPXTrack:
    track = GPXTrack(name)
    track.type = kind  # type: ignore[assignment]  # gpxpy's own annotation is that of its default
    track.segments = [GPXTrackSegment([_point(place, zero_s) for place in each]) for each in segments]
    return track


def _waypoint(waypoint: Waypoint, zero_s: float) -> GPXWaypoint:
    event = waypoint.placed_event
    point = GPXWaypoint(waypoint.latitude_deg, waypoint.longitude_deg, time=utc_time(zero_s + event.t_s))
    point.name, point.description, point.type = event.text, waypoint.placed, event.kind
    point.extensions = [_extension("elapsed_s", f"{event.elapsed_s:.3f}")]
    return point


def _point(place: Fix | PathPoint, zero_s: float) -> GPXTrackPoint:
    point = GPXTrackPoint(place.latitude_deg, place.longitude_deg, time=utc_time(zero_s + place.t_s))
    point.extensions = [_extension("elapsed_s", f"{place.elapsed_s:.3f}")]
    if isinstance(place, Fix) and place.error_m is not None:
        point.extensions.append(_extension("error_m", f"{place.error_m:.2f}"))
    return point


def _extension(name: str, text: str) -> Element:
    element = Element(f"{{{OURS}}}{name}")
    element.text = text
    return element
