"""A run as GeoJSON (RFC 7946): lines of what the receiver said, and points where something happened.

Times, errors and ``elapsed_s`` of the positions of a line stand in its ``coordinateProperties``, as converters from GPX
write them. A fix with none within ten seconds is a point.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.typed import Fix
from wayfarer.views.export.gps_places import Waypoint, read_places
from wayfarer.views.export.wall_time import utc_text


def write_geojson(run: Path, file: TextIO) -> Damage:
    """Write a run as GeoJSON, and return what of it could not be read.

    Raises:
        BadInput: the run cannot be read, or has no position.
    """
    places = read_places(run, "geojson")
    lines = [_line(segment, places.zero_s) for segment in places.segments]
    points = [_point(waypoint, places.zero_s) for waypoint in places.waypoints]
    document = {"type": "FeatureCollection", "run": places.title, "about": places.about, "features": [*lines, *points]}
    json.dump(document, file, allow_nan=False)
    file.write("\n")
    return places.damage


def _line(segment: Sequence[Fix], zero_s: float) -> dict[str, Any]:
    """Return a piece of the track; a line has two positions or more."""
    if len(segment) == 1:
        (fix,) = segment
        told = {"time": utc_text(zero_s + fix.t_s), "elapsed_s": fix.elapsed_s, "error_m": fix.error_m}
        return _feature("Point", _position(fix.latitude_deg, fix.longitude_deg), {"kind": "fix", **told})
    along = {
        "times": [utc_text(zero_s + fix.t_s) for fix in segment],
        "elapsed_s": [fix.elapsed_s for fix in segment],
        "error_m": [fix.error_m for fix in segment],
    }
    positions = [_position(fix.latitude_deg, fix.longitude_deg) for fix in segment]
    return _feature("LineString", positions, {"kind": "track", "coordinateProperties": along})


def _point(waypoint: Waypoint, zero_s: float) -> dict[str, Any]:
    placed_event = waypoint.placed_event
    properties = {
        "kind": placed_event.kind,
        "name": placed_event.text,
        "time": utc_text(zero_s + placed_event.t_s),
        "elapsed_s": placed_event.elapsed_s,
        "placed": waypoint.placed,
        "fix_elapsed_s": waypoint.fix.elapsed_s,
        "fix_error_m": waypoint.fix.error_m,
        "offset_north_m": round(waypoint.north_m, 3),
        "offset_east_m": round(waypoint.east_m, 3),
    }
    return _feature("Point", _position(waypoint.latitude_deg, waypoint.longitude_deg), properties)


def _feature(geometry: str, coordinates: list[Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": geometry, "coordinates": coordinates}, "properties": properties}


def _position(latitude_deg: float, longitude_deg: float) -> list[float]:
    """Return a position as RFC 7946 has it: longitude first."""
    return [longitude_deg, latitude_deg]
