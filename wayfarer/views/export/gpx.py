"""A run as GPX 1.1: a track of what the receiver said, and waypoints where something happened.

The order of elements is that of the schema, http://www.topografix.com/GPX/1/1/gpx.xsd. ``elapsed_s`` and the receiver's
``error_m`` stand in extensions, because GPX has no element for them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TextIO
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from wayfarer import __version__
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.typed import Fix
from wayfarer.views.export.gps_places import DECIMALS, Places, Waypoint, read_places
from wayfarer.views.export.wall_time import utc_text

GPX = "http://www.topografix.com/GPX/1/1"
OURS = "urn:wayfarer:gpx"  # what makes the names of extensions unique; nothing is to be found there


def write_gpx(run: Path, file: TextIO) -> Damage:
    """Write a run as GPX, and return what of it could not be read.

    Raises:
        BadInput: the run cannot be read, or has no position.
    """
    places = read_places(run, "gpx")
    root = _document(places)
    indent(root)
    file.write('<?xml version="1.0" encoding="UTF-8"?>\n')
    file.write(tostring(root, encoding="us-ascii").decode())  # also on a terminal that is not UTF-8
    file.write("\n")
    return places.damage


def _document(places: Places) -> Element:
    attributes = {"version": "1.1", "creator": f"wayfarer {__version__}", "xmlns": GPX, "xmlns:wayfarer": OURS}
    root = Element("gpx", attributes)
    metadata = SubElement(root, "metadata")
    _text(metadata, "name", places.title)
    _text(metadata, "desc", places.about)
    _text(metadata, "time", utc_text(places.zero_s + places.segments[0][0].t_s))
    for waypoint in places.waypoints:
        _waypoint(root, waypoint, places.zero_s)
    track = SubElement(root, "trk")
    _text(track, "name", places.title)
    for segment in places.segments:
        points = SubElement(track, "trkseg")
        for fix in segment:
            _fix(points, fix, places.zero_s)
    return root


def _waypoint(root: Element, waypoint: Waypoint, zero_s: float) -> None:
    placed_event = waypoint.placed_event
    point = _point(root, "wpt", waypoint.latitude_deg, waypoint.longitude_deg, zero_s + placed_event.t_s)
    _text(point, "name", placed_event.text)
    _text(point, "desc", waypoint.placed)
    _text(point, "type", placed_event.kind)
    _extensions(point, placed_event.elapsed_s, None)


def _fix(segment: Element, fix: Fix, zero_s: float) -> None:
    point = _point(segment, "trkpt", fix.latitude_deg, fix.longitude_deg, zero_s + fix.t_s)
    _extensions(point, fix.elapsed_s, fix.error_m)


def _point(parent: Element, tag: str, latitude_deg: float, longitude_deg: float, wall_s: float) -> Element:
    point = SubElement(parent, tag, {"lat": f"{latitude_deg:.{DECIMALS}f}", "lon": f"{longitude_deg:.{DECIMALS}f}"})
    _text(point, "time", utc_text(wall_s))
    return point


def _extensions(point: Element, elapsed_s: float, error_m: float | None) -> None:
    extensions = SubElement(point, "extensions")
    _text(extensions, "wayfarer:elapsed_s", f"{elapsed_s:.3f}")
    if error_m is not None:
        _text(extensions, "wayfarer:error_m", f"{error_m:.2f}")


def _text(parent: Element, tag: str, text: str) -> None:
    SubElement(parent, tag).text = text
