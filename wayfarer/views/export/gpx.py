"""A run as GPX 1.1: a track of what the receiver said, one of the path, and waypoints where something happened.

The path is dead reckoning fitted to the fixes. A track's ``type`` is ``fixes``, ``fitted`` or ``reckoned``.

``elapsed_s`` and the receiver's ``error_m`` stand in extensions, because GPX has no element for them.
gpxpy is imported here only, and only where a file is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TextIO
from xml.etree.ElementTree import Element

from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment, GPXWaypoint

from wayfarer import __version__
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.typed import Fix
from wayfarer.views.export.gps_places import Waypoint, read_places
from wayfarer.views.export.placed_path import Origin, PathPoint
from wayfarer.views.export.wall_time import utc_time

OURS = "urn:wayfarer:gpx"  # what makes the names of extensions unique; nothing is to be found there


def write_gpx(run: Path, file: TextIO, origin: Origin | None = None) -> Damage:
    """Write a run as GPX, and return what of it could not be read; ``origin`` is where one without a receiver began.

    Raises:
        BadInput: the run cannot be read, or has neither positions nor an origin.
    """
    places = read_places(run, "gpx", origin)
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
