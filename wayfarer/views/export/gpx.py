"""A run as GPX 1.1: a track of what the receiver said, and waypoints where something happened.

``elapsed_s`` and the receiver's ``error_m`` stand in extensions, because GPX has no element for them.
gpxpy is imported here only, and only where a file is written.
"""

from __future__ import annotations

from pathlib import Path
from typing import TextIO
from xml.etree.ElementTree import Element

from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment, GPXWaypoint

from wayfarer import __version__
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.typed import Fix
from wayfarer.views.export.gps_places import Waypoint, read_places
from wayfarer.views.export.wall_time import utc_time

OURS = "urn:wayfarer:gpx"  # what makes the names of extensions unique; nothing is to be found there


def write_gpx(run: Path, file: TextIO) -> Damage:
    """Write a run as GPX, and return what of it could not be read.

    Raises:
        BadInput: the run cannot be read, or has no position.
    """
    places = read_places(run, "gpx")
    gpx = GPX()
    gpx.creator = f"wayfarer {__version__}"
    gpx.nsmap["wayfarer"] = OURS
    gpx.name, gpx.description = places.title, places.about
    gpx.time = utc_time(places.zero_s + places.segments[0][0].t_s)
    gpx.waypoints = [_waypoint(each, places.zero_s) for each in places.waypoints]
    track = GPXTrack(places.title)
    track.segments = [GPXTrackSegment([_point(fix, places.zero_s) for fix in each]) for each in places.segments]
    gpx.tracks = [track]
    # Characters as numbers, because a terminal may not be UTF-8.
    file.write(gpx.to_xml().encode("ascii", "xmlcharrefreplace").decode() + "\n")
    return places.damage


def _waypoint(waypoint: Waypoint, zero_s: float) -> GPXWaypoint:
    event = waypoint.placed_event
    point = GPXWaypoint(waypoint.latitude_deg, waypoint.longitude_deg, time=utc_time(zero_s + event.t_s))
    point.name, point.description, point.type = event.text, waypoint.placed, event.kind
    point.extensions = [_extension("elapsed_s", f"{event.elapsed_s:.3f}")]
    return point


def _point(fix: Fix, zero_s: float) -> GPXTrackPoint:
    point = GPXTrackPoint(fix.latitude_deg, fix.longitude_deg, time=utc_time(zero_s + fix.t_s))
    point.extensions = [_extension("elapsed_s", f"{fix.elapsed_s:.3f}")]
    if fix.error_m is not None:
        point.extensions.append(_extension("error_m", f"{fix.error_m:.2f}"))
    return point


def _extension(name: str, text: str) -> Element:
    element = Element(f"{{{OURS}}}{name}")
    element.text = text
    return element
